"""The cases of mooring: lines on a sea bed, a line in a current, a line that sinks."""

import math
from dataclasses import replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from hose_mj.hoses.fluid import Fluid
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.case import DOWN, GRAVITY, STOUT, Case, lay_free, lay_pinned, make_case

_HOLDS: WeakKeyDictionary[HoseModel, list[Hold]] = WeakKeyDictionary()
_MOORING = partial(make_case, "mooring", models=("geds",), gravity=DOWN, planar=False)
_LIMP = 1e-7
"""EI / (w L^3): the layer sqrt(EI / H) in which a line bends is then below 1e-3 L."""
_SLIM = 1e-3
"""Radius over length: contact points stand so far apart, and half the friction of the one at the
anchor is lost, since it cannot slide."""
_SLACK = 0.5
"""Of the pull at the fairlead: what a line starts with, before it is drawn out."""
_PULL_STEPS, _REST_STEPS = 60, 20
_SWAY = 0.5
"""A step of a line that is drawn out, in sqrt(L / g): the drag damps its motion within half one."""
_WATER = Fluid(density=1025.0)
_SUNK = replace(STOUT, linear_density=0.5, outer_radius=0.01, torsional_stiffness=0.0)
"""A line that is heavier than water by 1.75 N/m."""
SUNK_WEIGHT = GRAVITY * (_SUNK.linear_density - _WATER.density * math.pi * _SUNK.outer_radius**2)


def make_mooring(name: str) -> Case:
    """A line from an anchor on the sea bed to a fairlead: one of `reference.MOORINGS`."""
    line = reference.MOORINGS[name]
    swing = math.sqrt(line.length / GRAVITY)
    spec = HoseSpec(
        length=line.length,
        axial_stiffness=line.axial_stiffness,
        bending_stiffness=_LIMP * line.weight * line.length**3,
        torsional_stiffness=0.0,
        linear_density=line.weight / GRAVITY,
        outer_radius=_SLIM * line.length,
        drag=4.0 * line.weight / GRAVITY / swing,
    )
    along = np.array([math.cos(line.slope), 0.0, math.sin(line.slope)])
    up = np.array([-along[2], 0.0, along[0]])
    # The anchor lies as deep in the bed as the line sinks into it.
    depth = spec.outer_radius + ContactLaw().complete(spec).find_gap(line.weight * up[2])
    axes = np.stack([along, [0.0, 1.0, 0.0], up], axis=1)
    bed = Obstacle(kind="plane", position=-depth * up, rotation=axes, friction=line.friction)
    truth = np.array([line.horizontal, line.vertical, line.anchor, line.rests])
    unit = np.where(truth > 0.0, truth, [1.0, 1.0, line.horizontal, line.length])

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(partial(reference.lay_slack_line, line, _SLACK * line.horizontal))
        _HOLDS[hose] = [hose.attach(0.0, (0.0, 0.0, 0.0)), hose.attach(line.length)]
        return _HOLDS[hose]

    def probe(hose: HoseModel) -> Array:
        assert isinstance(hose, GedsHose)
        anchor, fairlead = _HOLDS[hose]
        start, end = hose.position(line.length)[0], np.array([line.span, 0.0, line.height])
        if line.friction > 0.0:
            # Drawn out slowly, the line slides all over the bed, which holds it back.
            for k in range(1, _PULL_STEPS + 1):
                ease = math.sin(0.5 * math.pi * k / _PULL_STEPS)
                hose.move(fairlead, start + (end - start) * ease)
                hose.step()
            hose.step(_REST_STEPS)
        else:
            hose.move(fairlead, end)
            hose.solve_static()
        pull, held = hose.reaction(fairlead).force, hose.reaction(anchor).force
        rests = float((hose.contacts.compute_forces() @ up).sum()) / (line.weight * up[2])
        return np.array([pull[0], pull[2], np.linalg.norm(held), rests]) / unit

    return _MOORING(
        name,
        spec=spec,
        lay=lay,
        probe=probe,
        truth=lambda: truth / unit,
        scale=1.0,
        obstacles=() if line.rests == 0.0 else (bed,),
        resolutions={"geds": (40, 80)},
        promised={80: 1e-3},
        options={"scheme": "backward-euler", "timestep": _SWAY * swing, "tolerance": 1e-6},
    )


def make_current() -> Case:
    """A line that hangs from a point in a current of 1 m/s."""
    fluid = replace(_WATER, velocity=(1.0, 0.0, 0.0))
    drag = fluid.density * fluid.normal_drag * _SUNK.outer_radius

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        return hose.tangent(np.array([0.1, 0.5, 0.9]) * hose.spec.length)[:, 0]

    return _MOORING(
        "current",
        spec=_SUNK,
        lay=lay_pinned,
        probe=probe,
        truth=lambda: np.full(3, reference.stream_slope(SUNK_WEIGHT, drag)),
        resolutions={"geds": (8, 16)},
        options={"fluid": fluid},
    )


def make_sinking() -> Case:
    """A line that sinks broadside, from rest."""
    inertia = _SUNK.linear_density + _WATER.density * math.pi * _SUNK.outer_radius**2
    fastest = math.sqrt(SUNK_WEIGHT / (_WATER.density * _WATER.normal_drag * _SUNK.outer_radius))
    rate = SUNK_WEIGHT / inertia

    def probe(hose: HoseModel) -> Array:
        speeds = []
        for _ in range(3):
            hose.step(math.ceil(0.5 * fastest / rate / hose.timestep))
            aim = fastest * math.tanh(hose.time * rate / fastest)
            speeds.append(-hose.velocity(0.5 * hose.spec.length)[0, 2] / aim)
        return np.array(speeds)

    return _MOORING(
        "sinking",
        spec=_SUNK,
        lay=lay_free,
        probe=probe,
        truth=lambda: np.ones(3),
        resolutions={"geds": (8,)},
        options={"fluid": _WATER},
    )
