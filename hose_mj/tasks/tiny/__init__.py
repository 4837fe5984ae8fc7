"""Grids small enough to solve exactly: a corridor and a maze."""
