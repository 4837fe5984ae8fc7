"""Geometrically Exact Dynamic Splines: kernels over arrays below, the thin class `GedsHose` above.

basis.py (B-splines, quadrature, mass) <- energy.py (strain energy, its derivatives) and band.py
(banded Cholesky) <- kkt.py (with Lagrange multipliers) <- newton.py (Newton for one stage, statics)
<- integrators.py (time stepping) <- hose.py (GedsHose).
"""
