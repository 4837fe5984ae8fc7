"""Measures of speed, one file for each group of `hose-mj bench`."""
