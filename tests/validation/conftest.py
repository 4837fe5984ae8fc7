"""A tiny case and a make-believe hose, for the logic of ladders and ratios."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.errors import StepError
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import settings
from hose_mj.validation.case import Case, Motion
from hose_mj.validation.run import RunResult
from hose_mj.validation.settings import Setting

SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=1e4,
    bending_stiffness=0.05,
    torsional_stiffness=0.0,
    linear_density=0.1,
)


class FakeHose:
    """Stays where it is, but for an error of the time step and the resolution.

    Attributes:
        stable: largest time step (s) that does not raise.
        error: takes a time step and a resolution, gives the offset of every point (m).
        made: one record per hose made since the fixture began.
    """

    stable = np.inf
    made: list[FakeHose]

    @staticmethod
    def error(timestep, resolution):
        return 0.0

    def __init__(self, model, spec, *, timestep, **options):
        self.model, self.spec, self.timestep, self.options = model, spec, timestep, options
        self.resolution = options.get("control_points") or options.get("segments")
        self.fallbacks = 3
        self.n_steps = 0
        type(self).made.append(self)

    def position(self, arc_length):
        s = np.atleast_1d(arc_length)
        offset = self.error(self.timestep, self.resolution) if self.n_steps else 0.0
        return np.stack([s, 0.0 * s, 0.0 * s + offset], axis=1)

    def step(self, n_steps=1):
        self.n_steps += n_steps
        if self.timestep > self.stable:
            raise StepError(f"{self.timestep} s is too long")


@pytest.fixture
def fake(monkeypatch):
    """The class of hoses that `Setting.make` makes; set `stable` and `error` on it."""
    kind = type("Fake", (FakeHose,), {"made": []})
    monkeypatch.setattr(
        settings, "make_hose", lambda model, spec, **options: kind(model, spec, **options)
    )
    return kind


@pytest.fixture
def case():
    """A motion of 0.1 s, sampled five times, of a hose that does not move."""
    return Case(
        id="fake",
        family="fake",
        title="Fake",
        about="Nothing moves.",
        spec=SPEC,
        gravity=(0.0, 0.0, 0.0),
        lay=lambda hose: [],
        probe=lambda hose: hose.position(1.0)[0],
        scale=1.0,
        motion=Motion(0.1, 5),
        clamped=True,
    )


@pytest.fixture
def make_outcome():
    """Makes an outcome that needs no run."""

    def make(model="geds", *, error=0.005, wall=1.0, scheme="bdf2", n=10, clamp=None, **options):
        timestep = options.pop("timestep", 0.001)
        values = options.pop("values", np.zeros((2, 3)))
        assert not options
        setting = Setting(model, scheme, n, clamp, timestep)
        times, points = np.array([0.0, 1.0]), np.zeros((2, 41, 3))
        return RunResult(
            "fake", setting, error, "converged", wall, 1.0, 0, times, points, np.asarray(values)
        )

    return make


@pytest.fixture
def make_result(case):
    """A case result of these outcomes, with a reference of these values (by default none)."""
    from hose_mj.validation.case import Reference
    from hose_mj.validation.compare import CaseResult

    def make(*outcomes, reference=None):
        result = CaseResult(case, list(outcomes))
        if reference is not None:
            result.inextensible = Reference(np.asarray(reference), 0.0)
        return result

    return make
