"""Plots of hoses, errors and costs, in one style."""
