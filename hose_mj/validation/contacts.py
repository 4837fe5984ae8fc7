"""The cases with contact: capstan, floor tow, a hose released onto an obstacle."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from hose_mj.hoses.obstacles import SINK, ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.case import (
    GRAVITY,
    LENGTH,
    ROD,
    Case,
    Motion,
    Reference,
    lay_cantilever,
)
from hose_mj.validation.quasistatic import tow_chain

ACROSS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
"""Turns a cylinder's axis to y, across the plane in which hoses are laid."""


def make_capstan() -> Case:
    """A hose drawn over half a drum."""
    length, friction, drum, pull = 0.6, 0.3, 0.1, 1.0
    speed, pause, n_steps = 0.05, 0.005, 300
    spec = HoseSpec(
        length=length,
        axial_stiffness=2e3,
        bending_stiffness=1e-5,
        torsional_stiffness=0.0,
        linear_density=0.1,
        outer_radius=0.005,
        damping_time=0.01,
    )
    bend = drum + spec.outer_radius
    leg = 0.5 * (length - math.pi * bend)

    def curve(s: Array) -> Array:
        angle = np.clip((s - leg) / bend, 0.0, math.pi)
        down = np.maximum(leg - s, 0.0) + np.maximum(s - length + leg, 0.0)
        return np.stack([-bend * np.cos(angle), 0.0 * s, bend * np.sin(angle) - down], axis=1)

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(curve)
        return []

    def probe(hose: HoseModel) -> Array:
        hose.apply_force(0.0, (0.0, 0.0, -pull))
        hold, place, pulls = hose.attach(length), hose.position(length)[0], []
        for _ in range(n_steps):
            place = place - [0.0, 0.0, speed * pause]
            hose.move(hold, place)
            hose.step(max(1, round(pause / hose.timestep)))
            pulls.append(-hose.reaction(hold).force[2])
        return np.array([np.mean(pulls[n_steps // 2 :]) / pull])

    return Case(
        id="capstan",
        family="capstan",
        title="Capstan: a hose drawn over half a drum",
        about="A weightless hose lies over half a drum; one end is pulled with 1 N, the other "
        "drawn away at 5 cm/s. Compared: the ratio of the two pulls, mean of the second half of "
        "1.5 s, with Euler's and Eytelwein's exp(mu theta), mu = .3, theta = pi.",
        spec=spec,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        truth=lambda: np.array([reference.capstan(friction, math.pi)]),
        models=("geds",),
        obstacles=(
            Obstacle(kind="cylinder", rotation=ACROSS, size=(drum, 0.2), friction=friction),
        ),
        contact_law=ContactLaw(stiffness=1e5),
        promised={20: 0.01},
    )


TOW_TIME = 72.0
TOW_SAMPLES = 24
TOW_FRICTION = 0.5
_TOW_WIDTH = 0.35
_TOWED = HoseSpec(
    length=LENGTH,
    axial_stiffness=2e3,
    bending_stiffness=5e-3,
    torsional_stiffness=5e-3 / 1.3,
    linear_density=0.1,
    damping_time=0.01,
)


@cache
def _make_eight() -> CubicSpline:
    """The figure of eight over the fraction of its length, starting at the far end of the hose."""
    turn = np.linspace(0.0, 2.0 * math.pi, 4001)
    eight = np.stack([np.sin(turn), 0.5 * np.sin(2.0 * turn)], axis=1) * _TOW_WIDTH
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(eight, axis=0), axis=1))])
    return CubicSpline(along / along[-1], eight + np.array([LENGTH, 0.0]))


def find_tow(fraction: Array) -> Array:
    """Places (k, 2) of the towed end after fractions (k,) of a figure of eight, even in speed."""
    return np.asarray(_make_eight()(fraction))


def _tow_chain(n_links: int, n_increments: int) -> Array:
    """What `make_floor_tow` compares, from the minimiser: (TOW_SAMPLES + 1, 33)."""
    start = np.stack([np.linspace(0.0, LENGTH, n_links + 1), np.zeros(n_links + 1)], axis=1)
    path = find_tow(np.arange(1, n_increments + 1) / n_increments)
    slip = 2e-3 * float(np.linalg.norm(path[1] - path[0]))
    shapes = tow_chain(_TOWED, TOW_FRICTION, start, path, slip)
    every = n_increments // TOW_SAMPLES
    seen = np.concatenate([start[None], shapes[every - 1 :: every]])[:, :: n_links // 10]
    heights = np.full((*seen.shape[:2], 1), _TOWED.outer_radius)
    return np.concatenate([seen, heights], axis=2).reshape(len(seen), -1)


@cache
def compute_tow() -> Reference:
    """The minimiser's answer, and how far it is from that of half as many links and increments."""
    coarse, fine = (_tow_chain(200 * k, 80 * k * TOW_SAMPLES) for k in (1, 2))
    gap = (fine - coarse).reshape(len(fine), -1, 3)
    return Reference(fine, float(np.max(np.linalg.norm(gap, axis=2))) / LENGTH)


def make_floor_tow() -> Case:
    """A hose towed slowly along a figure of eight on a rough floor."""
    height = _TOWED.outer_radius * (1.0 - SINK)

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, height], [LENGTH, 0.0, height]])
        return [hose.attach(LENGTH, (LENGTH, 0.0, height))]

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        hose.move(holds[0], (*find_tow(np.array(time / TOW_TIME)), height))

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.linspace(0.0, LENGTH, 11)).ravel())

    return Case(
        id="floor-tow",
        family="floor-tow",
        title="Floor tow: a hose towed slowly along a figure of eight",
        about="A hose on a rough floor, mu = .5, is towed by one end along a figure of eight, 3 "
        "cm/s. Compared: the places of eleven points, with a chain that minimises its energy and "
        "the work of friction increment by increment. The segments of MuJoCo's cable are round "
        "and roll sideways over the floor; that gap stays whatever their number.",
        spec=_TOWED,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        scale=LENGTH,
        motion=Motion(TOW_TIME, TOW_SAMPLES, drive),
        models=("geds", "cable"),
        steps=(0.1, 0.05),
        obstacles=(Obstacle(kind="plane", friction=TOW_FRICTION),),
        contact_law=ContactLaw(slip_speed=3e-5),
        planar=False,
        reference=compute_tow,
        uncertainty=2e-3,
        promise=5e-3,
        has_ratios=False,
    )


def make_obstacle_drop() -> Case:
    """A cantilever let go above a bar."""

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.5, 0.75, 1.0]) * LENGTH).ravel())

    bar = Obstacle(
        kind="cylinder", position=(0.5, 0.0, -0.3), rotation=ACROSS, size=(0.1, 0.2), friction=0.3
    )
    return Case(
        id="obstacle-drop",
        family="obstacle-drop",
        title="Obstacle drop: a horizontal cantilever let go above a bar",
        about="A straight horizontal cantilever is let go, falls onto a round bar, mu = .3, and "
        "whips around it. Compared: the places of the middle, three quarters and the tip. GEDS "
        "converges to its own contact law; MuJoCo's soft contacts are another.",
        spec=replace(
            ROD, bending_stiffness=0.02, torsional_stiffness=0.02 / 1.3, damping_time=0.02
        ),
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay_cantilever,
        probe=probe,
        scale=LENGTH,
        motion=Motion(1.0, 50),
        clamped=True,
        models=("geds", "cable"),
        obstacles=(bar,),
        contact_law=ContactLaw(stiffness=3e3, width=1e-3),
        uncertainty=5e-4,
        promise=5e-3,
        has_ratios=False,
    )
