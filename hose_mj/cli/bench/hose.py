"""The group `hose`: time steps of the spline hose, and of MuJoCo's cable beside it."""

from __future__ import annotations

import numpy as np

from hose_mj.cli.bench import Bench, Record, measure_rate
from hose_mj.hoses.protocol import HoseModel
from hose_mj.hoses.registry import make_hose
from hose_mj.hoses.spec import HoseSpec

SIZES = (8, 16, 32, 64)  # control points, or segments
TIMESTEP = {"geds": 5e-3, "cable": 2e-3}
"""The cable's explicit elastic forces want a smaller step (s)."""
LENGTH = 1.0
UNIT = "simulated s/s"


def measure(quick: bool, seed: int) -> Bench:
    """Times a hose that swings from its clamp, released from the horizontal; `seed` is not used.

    The sizes are equal, not the errors: `hose-mj compare` is about those.
    """
    sizes = SIZES[:2] if quick else SIZES
    rounds, seconds = (2, 0.1) if quick else (5, 0.4)
    bench = Bench()
    for size in sizes:
        cable = measure_rate(_Swing("cable", size), rounds, seconds) * TIMESTEP["cable"]
        peer = f"cable, n = {size}"
        bench.records.append(Record("hose", peer, cable, UNIT))
        for plane in ("xz", None):
            rate = measure_rate(_Swing("geds", size, plane), rounds, seconds) * TIMESTEP["geds"]
            name = f"geds, n = {size}, {'plane' if plane else 'space'}"
            bench.records.append(Record("hose", name, rate, UNIT, peer, rate / cable))
    return bench


class _Swing:
    """A clamped hose that swings; a call is a tenth of a second of it.

    Every two simulated seconds it starts anew, so that all rounds see the same motion.
    """

    def __init__(self, model: str, size: int, plane: str | None = None) -> None:
        spec = HoseSpec.from_material(
            length=LENGTH,
            youngs_modulus=5e6,
            poisson_ratio=0.45,
            density=1200.0,
            outer_radius=0.0125,
            inner_radius=0.0095,
            damping_time=0.02,
        )
        options = {"timestep": TIMESTEP[model]}
        if model == "geds":
            self.hose = make_hose(model, spec, control_points=size, plane=plane, **options)
        else:
            self.hose = make_hose(model, spec, segments=size, **options)
        self.steps = round(0.1 / TIMESTEP[model])
        _start(self.hose)

    def __call__(self) -> int:
        """Does a tenth of a second and returns its number of steps."""
        if self.hose.time > 2.0:
            _start(self.hose)
        self.hose.step(self.steps)
        return self.steps


def _start(hose: HoseModel) -> None:
    hose.reset(np.array([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]]))
    hose.clamp(0.0)
