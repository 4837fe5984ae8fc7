"""Geometrically Exact Dynamic Splines: kernels over arrays below, the thin class `GedsHose` above.

basis.py (B-splines, quadrature, mass) <- energy.py (strain energy, its derivatives) and band.py
(banded Cholesky) <- solver.py (Newton for one stage, statics) <- schemes.py (time stepping) <-
model.py (GedsHose).
"""
