"""Training runs, their tests and their statistics."""
