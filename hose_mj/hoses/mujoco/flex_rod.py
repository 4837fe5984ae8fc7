"""How a flex rod is made: its settings, its vertices and edges, what holds them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from hose_mj.hoses.mujoco.chain_holds import Held
from hose_mj.hoses.mujoco.chain_settings import ChainSettings, check_numbers, check_solref
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec

BALLAST = 10.0
"""Inertia of a held vertex beside its own, over the mass of the hose. It has no weight, and its
forces are taken off reactions: a soft constraint that holds much inertia gives less."""


@dataclass(frozen=True, kw_only=True)
class FlexSettings(ChainSettings):
    """Settings of a flex rod.

    Attributes:
        edge_solref: MuJoCo's solref of the edges; None for that of holds.
        edge_solimp: their solimp.
    """

    edge_solref: Sequence[float] | None
    edge_solimp: Sequence[float]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_solref("edge_solref", self.edge_solref)
        check_numbers("edge_solimp", self.edge_solimp, 5)

    def edge_options(self) -> dict[str, object]:
        """solref and solimp of the edges."""
        options = self.hold_options()
        if self.edge_solref is not None:
            options["solref"] = list(self.edge_solref)
        return options | {"solimp": list(self.edge_solimp)}


def make_rod(
    spec: HoseSpec, rest: Array, masses: Array, edge_options: Mapping[str, object]
) -> mujoco.MjSpec:
    """Vertices on slides, MuJoCo's bending between them, edges that keep their lengths.

    MuJoCo multiplies `young` by the section of a solid cylinder of the flex's radius; `damping` is
    the Kelvin-Voigt time. Nothing collides. `rest` is the straight shape (N + 1, 3), m; masses are
    (N + 1,), kg; `edge_options` are solref and solimp of the edges.
    """
    maker = mujoco.MjSpec()
    for k, (place, mass) in enumerate(zip(rest, masses, strict=True)):
        body = maker.worldbody.add_body(name=f"v{k}", pos=place)
        body.explicitinertial = True
        body.mass, body.inertia = mass, [mass * spec.outer_radius**2] * 3
        for axis in np.eye(3):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    rod = add_edges(maker, "hose", range(len(rest)), spec.outer_radius)
    rod.young = spec.bending_stiffness / (math.pi * spec.outer_radius**4 / 4)
    rod.poisson, rod.damping = 0.0, spec.damping_time
    maker.add_equality(
        name="edges",
        type=mujoco.mjtEq.mjEQ_FLEX,
        objtype=mujoco.mjtObj.mjOBJ_FLEX,
        name1="hose",
        **edge_options,
    )
    return maker


def add_edges(
    maker: mujoco.MjSpec, name: str, vertices: Sequence[int], radius: float
) -> mujoco.MjsFlex:
    """Adds a flex of edges between consecutive vertices; nothing in it acts or collides yet."""
    flex = maker.add_flex(name=name, dim=1, radius=radius)
    flex.contype, flex.conaffinity, flex.selfcollide = 0, 0, mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.vertbody = [f"v{k}" for k in vertices]
    flex.vert = [0.0] * (3 * len(vertices))
    flex.elem = [vertex for k in range(len(vertices) - 1) for vertex in (k, k + 1)]
    return flex


def name_hold(held: Held, vertex: int) -> str:
    """Name of what ties a vertex of a hold."""
    return f"hold{held.hold.number}-{vertex}"


def add_connect(
    maker: mujoco.MjSpec, held: Held, vertex: int, ballast: float, options: dict[str, object]
) -> None:
    """Ties a vertex to a mocap body and gives it more inertia (kg)."""
    name, body = name_hold(held, vertex), maker.body(f"v{vertex}")
    for joint in body.joints:
        joint.armature = ballast
    body.add_site(name=name)
    target = maker.worldbody.add_body(name=f"target-{name}", mocap=True)
    target.add_site(name=f"target-{name}")
    maker.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=name,
        name2=f"target-{name}",
        **options,
    )
