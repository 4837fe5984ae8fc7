"""The dynamic cases: motions, compared with their converged limit."""

from __future__ import annotations

import math
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation.case import (
    GRAVITY,
    LENGTH,
    ROD,
    Case,
    Motion,
    find_tip,
    lay_between,
    lay_cantilever,
)


def make_released_rod() -> Case:
    """A horizontal cantilever let go."""
    return Case(
        id="released-rod",
        family="released-rod",
        title="Released rod: a horizontal cantilever let go",
        about="A straight horizontal cantilever is let go and swings for a second under gravity. "
        "Compared: the place of the tip, largest distance over the second.",
        spec=ROD,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay_cantilever,
        probe=find_tip,
        scale=LENGTH,
        motion=Motion(1.0, 50),
        clamped=True,
    )


def make_free_flight() -> Case:
    """A straight hose thrown spinning and flexing."""

    def flex(s: Array) -> Array:
        """Symmetric, zero at both ends, without moment and shear there: f'' = s^2 (1 - s)^2."""
        return s**4 / 12.0 - s**5 / 10.0 + s**6 / 30.0 - s / 60.0

    def speed(s: Array) -> Array:
        u = s / LENGTH
        return np.stack([0.5 + 0.0 * u, 0.0 * u, 4.0 * (0.5 - u) + 300.0 * flex(u)], axis=1)

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]], speed)
        return []

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.0, 0.5, 1.0]) * LENGTH).ravel())

    return Case(
        id="free-flight",
        family="free-flight",
        title="Free flight: a straight hose thrown spinning and flexing, without gravity",
        about="A straight hose is thrown at .5 m/s with a spin of 4 rad/s and a smooth flexing "
        "motion on top. Compared: the places of both ends and the middle.",
        spec=ROD,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        scale=LENGTH,
        motion=Motion(1.0, 50),
    )


def make_taut_pull() -> Case:
    """A sagging hose drawn taut by its ends."""
    slack, taut, ramp = 0.8 * LENGTH, 0.995 * LENGTH, 0.6

    def lay(hose: HoseModel) -> list[Hold]:
        return lay_between(hose, slack)

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        along = 0.5 - 0.5 * math.cos(math.pi * min(time / ramp, 1.0))
        hose.move(holds[1], (slack + (taut - slack) * along, 0.0, 0.0))

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.25, 0.5, 0.75]) * LENGTH).ravel())

    return Case(
        id="taut-pull-hose",
        family="taut-pull",
        title="Taut pull: two ends moved apart until the hose is taut, then held",
        about="A sagging hose is let go between two attachments; one is drawn away from .8 to "
        ".995 L within a second and held for another. Compared: the places of the quarter points.",
        spec=replace(ROD, damping_time=0.01),
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        scale=LENGTH,
        motion=Motion(1.0, 50, drive),
    )


def make_suture_pull() -> Case:
    """A suture thread drawn taut sideways."""
    length = 0.1
    spec = HoseSpec.from_material(
        length=length,
        youngs_modulus=750e6,
        poisson_ratio=0.4,
        density=1100.0,
        outer_radius=0.2e-3,
        damping_time=2e-3,
    )
    slack, pull, ramp = 0.098, 0.0105, 0.3
    starts: WeakKeyDictionary[HoseModel, Array] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(
            lambda s: np.stack(
                [s / length * slack, 0.0 * s, -0.0125 * np.sin(math.pi * s / length)], axis=1
            )
        )
        ends = [hose.attach(0.0, (0.0, 0.0, 0.0)), hose.attach(length, (slack, 0.0, 0.0))]
        hose.solve_static()
        starts[hose] = hose.position(0.5 * length)[0].copy()
        return [*ends, hose.attach(0.5 * length)]

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        along = 0.5 - 0.5 * math.cos(math.pi * min(time / ramp, 1.0))
        aim = np.array([0.5 * slack, 0.0, pull])
        hose.move(holds[2], starts[hose] + (aim - starts[hose]) * along)

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.25, 0.75]) * length).ravel())

    return Case(
        id="taut-pull-suture",
        family="taut-pull",
        title="Taut pull: a suture thread drawn sideways at its middle",
        about="10 cm of thread, radius .2 mm, E = 750 MPa, both ends held 98 mm apart; its middle "
        "is drawn sideways until taut, then held. Compared: the places of the quarter points.",
        spec=spec,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        scale=length,
        motion=Motion(0.5, 25, drive),
        models=("geds",),
        steps=(0.002, 0.001, 0.0005, 0.00025),
    )
