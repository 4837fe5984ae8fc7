"""Random sequences of all public calls on all hose models: nothing but a HoseError comes out.

Seeded, so that a failure is one that can be had again: the message of the assertion has the seed
and the calls that led there.
"""

import warnings

import numpy as np
import pytest

from hose_mj.errors import HoseError
from hose_mj.hoses.geds.loops import make_circle
from hose_mj.hoses.registry import MODELS, make_hose
from hose_mj.hoses.spec import Fitting, HoseSpec

PLAIN = {
    "length": 1.0,
    "axial_stiffness": 2e3,
    "bending_stiffness": 0.05,
    "torsional_stiffness": 0.04,
    "linear_density": 0.1,
    "damping_time": 0.01,
}
KINDS = {
    "geds": ({}, {"control_points": 8}),
    "geds without GJ": ({"torsional_stiffness": 0.0}, {"control_points": 8}),
    "geds in a plane": ({}, {"control_points": 8, "plane": "xz"}),
    "geds theta": ({}, {"control_points": 8, "twist": "theta"}),
    "geds coil": ({"rest_curvature": 3.0, "rest_torsion": 1.0}, {"control_points": 8}),
    "geds chain": ({"bending_stiffness": 0.0, "torsional_stiffness": 0.0}, {"control_points": 8}),
    "geds fitted": (
        {"fittings": (Fitting(start=0.3, end=0.4, bending_stiffness=2.0, linear_density=1.0),)},
        {"control_points": 8},
    ),
    "cable": ({}, {"segments": 6}),
    "hinge-chain": ({}, {"segments": 6}),
    "flex": ({}, {"segments": 6}),
}
KINDS |= {name: ({}, {}) for name in MODELS if name not in {kind.split()[0] for kind in KINDS}}
BUDGET, SLOW_BUDGET = 120, 10_000
JUNK = (
    *(None, True, -1, 0, 3, 0.3, -0.0, 1e308, np.nan, np.inf, 1e-320, 2j, "", "x", b"x"),
    *((), [], {}, [1], [1, 2, 3], [[0, 0, 0], [1, 0, 0]], np.zeros(3), np.ones((2, 3)), object()),
    *([np.nan, 0, 0], [1e200, 0, 0], [[0, 0], [1, 0]], ["a", "b", "c"], [None, None, None]),
)


def circle(s):
    return make_circle(1.0)(s)


CURVES = (
    [[0, 0, 0], [1, 0, 0]],
    [[0, 0, 0], [0, 0, -1]],
    [[0, 0, 0], [0.6, 0, 0.2], [0.8, 0, -0.4]],
    lambda s: np.stack([s**2, 0 * s, 0.2 * s], axis=1),
    circle,
)


class Player:
    """One hose and the calls that are made on it."""

    def __init__(self, kind, seed):
        self.rng = np.random.default_rng(seed)
        changes, options = KINDS[kind]
        spec = HoseSpec(**(PLAIN | changes))
        self.hose = make_hose(kind.split()[0], spec, timestep=2e-3, **options)
        self.hold_list, self.saved, self.log = [], [], []
        self.acts = {name[4:]: getattr(self, name) for name in dir(self) if name[:4] == "act_"}

    def play(self, n_calls):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for _ in range(n_calls):
                name = str(self.rng.choice(sorted(self.acts)))
                self.log.append(name)
                try:
                    self.acts[name]()
                except HoseError:
                    self.log[-1] += " (refused)"
                except Exception as error:
                    raise AssertionError(f"{type(error).__name__}: {error}; {self.log}") from error
                self.check()

    def check(self):
        s = [0.0, 0.37, 1.0]
        hose = self.hose
        for query in (hose.position, hose.velocity, hose.tangent, hose.curvature):
            assert np.all(np.isfinite(query(s))), self.log
        assert np.isfinite(hose.energies().total), self.log

    # What the arguments are drawn from: mostly sensible ones, sometimes junk.

    def draw(self, sensible):
        if self.rng.random() < 0.12:
            return JUNK[self.rng.integers(len(JUNK))]
        return sensible()

    def place(self):
        places = (0.0, 1.0, 0.5, float(self.rng.random()))
        return self.draw(lambda: places[self.rng.integers(len(places))])

    def vector(self, size=1.0):
        def make():
            vector = size * self.rng.normal(size=3)
            if self.rng.random() < 0.5:
                vector[1] = 0.0
            return vector

        return self.draw(make)

    def hold(self):
        if not self.hold_list:
            return JUNK[self.rng.integers(len(JUNK))]
        return self.draw(lambda: self.hold_list[self.rng.integers(len(self.hold_list))])

    def maybe(self, value):
        return value if self.rng.random() < 0.5 else None

    # The calls.

    def act_reset(self):
        curve = self.draw(lambda: CURVES[self.rng.integers(len(CURVES))])
        self.hose.reset(curve, self.maybe(self.vector()))

    def act_clamp(self):
        self.hold_list.append(self.hose.clamp(self.place(), None, self.maybe(self.vector())))

    def act_attach(self):
        place = self.place()
        self.hold_list.append(self.hose.attach(place, self.maybe(self.vector(0.3))))

    def act_move(self):
        position, tangent = self.maybe(self.vector(0.3)), self.maybe(self.vector())
        self.hose.move(self.hold(), position, tangent, self.draw(lambda: float(self.rng.normal())))

    def act_nudge(self):
        hold = self.hold()
        if any(hold is one for one in self.hold_list):
            place = self.hose.position(hold.arc_length)[0]
            self.hose.move(hold, place + 0.01 * self.rng.normal(size=3) * [1, 0, 1])

    def act_release(self):
        self.hose.release(self.hold())

    def act_reaction(self):
        assert np.all(np.isfinite(self.hose.reaction(self.hold()).force)), self.log

    def act_apply_force(self):
        self.hose.apply_force(self.place(), self.vector())

    def act_apply_moment(self):
        moment = self.vector(0.05)
        if self.rng.random() < 0.3:
            moment = [0.0, 0.02, 0.0]
        self.hose.apply_moment(self.place(), moment)

    def act_clear_loads(self):
        self.hose.clear_loads()

    def act_step(self):
        self.hose.step(self.draw(lambda: int(self.rng.integers(4))))

    def act_solve_static(self):
        self.hose.solve_static()

    def act_linearize(self):
        assert np.all(np.isfinite(self.hose.linearize().stiffness)), self.log

    def act_query(self):
        s = self.place()
        names = ("position", "velocity", "tangent", "tension", "curvature", "twist", "torque")
        getattr(self.hose, names[self.rng.integers(len(names))])(s)
        self.hose.momentum()

    def act_snapshot(self):
        self.saved.append((self.hose.snapshot(), list(self.hold_list)))

    def act_restore(self):
        if self.saved and self.rng.random() < 0.7:
            state, holds = self.saved[self.rng.integers(len(self.saved))]
            self.hose.restore(state)
            self.hold_list = list(holds)
        else:
            self.hose.restore(JUNK[self.rng.integers(len(JUNK))])

    def act_restore_spoilt(self):
        state = self.hose.snapshot()
        spoil(state, self.rng)
        self.hose.restore(state)

    def act_close(self):
        if hasattr(self.hose, "close"):
            if self.rng.random() < 0.5:
                self.hose.reset(circle)
            self.hose.close(self.draw(lambda: float(self.rng.normal())))

    def act_open(self):
        if hasattr(self.hose, "open"):
            self.hose.open()


def spoil(state, rng):
    """Puts junk in the place of one leaf of a snapshot, or takes it away."""
    keys = list(state) if isinstance(state, dict) else list(range(len(state)))
    if not keys:
        return
    key = keys[rng.integers(len(keys))]
    if isinstance(state[key], (dict, list)) and len(state[key]) > 0 and rng.random() < 0.8:
        spoil(state[key], rng)
    elif isinstance(state, dict) and rng.random() < 0.3:
        del state[key]
    else:
        state[key] = JUNK[rng.integers(len(JUNK))]


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_random_calls(kind):
    for seed in range(2):
        Player(kind, seed).play(BUDGET // 2)


@pytest.mark.slow
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_many_random_calls(kind):
    for seed in range(SLOW_BUDGET // 100):
        Player(kind, 1000 + seed).play(100)
