"""Closed forms, converged references and the cases that hold hose models against them."""
