"""Readable implementations in plain Python: each is the specification of a compiled task.

A reference is made from the task's settings, holds the state in lists and names events and
variables by strings. It is slow and shares no rule with the kernels; the tests hold the two equal
bit for bit.
"""
