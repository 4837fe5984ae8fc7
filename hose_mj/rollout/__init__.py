"""Episodes in worlds: policies that act in them, and what watches."""
