"""The comparison on a user's own hose."""
