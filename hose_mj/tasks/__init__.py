"""Grid tasks of the thesis: rules compiled on an array of integers, open to compiled loops."""
