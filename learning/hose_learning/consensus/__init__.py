"""Agents that agree on whose turn it is, by messages."""
