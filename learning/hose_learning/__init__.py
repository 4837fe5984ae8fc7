"""Learners, the loops that train them and the studies that compare them.

They see environments only through what those publish, and know nothing of hoses or of MuJoCo.
"""
