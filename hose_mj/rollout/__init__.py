"""Episodes in worlds: policies that act in them, what watches and records."""
