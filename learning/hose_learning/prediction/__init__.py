"""Classifiers that predict which moves break a constraint."""
