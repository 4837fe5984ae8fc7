"""Clamps, attachments and loads of a chain inside an mjModel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import mujoco
import numpy as np

from hose_mj.errors import InputError
from hose_mj.hoses.mujoco import chain_layout
from hose_mj.hoses.protocol import Array, Hold, Reaction


@dataclass(frozen=True)
class Held:
    """A hold and where it is to be: a point (3,), m, and a frame (4,) that attachments ignore.

    `last_position` and `last_frame` are those of the step before, `spun` is the sum of the spins
    since then (rad). Where it is `rigid` the first segment is part of the world, else an equality
    constraint holds it.
    """

    hold: Hold
    position: Array
    frame: Array
    last_position: Array
    last_frame: Array
    rigid: bool = False
    spun: float = 0.0

    WIDTH: ClassVar[int] = 19

    def to_numbers(self) -> Array:
        """All of it as one array (19,)."""
        hold = self.hold
        flags = [hold.number, hold.arc_length, hold.fixes_tangent, self.rigid, self.spun]
        last = [self.last_position, self.last_frame]
        return np.concatenate([flags, self.position, self.frame, *last])

    @classmethod
    def from_numbers(cls, row: Array) -> Held:
        """The inverse of `to_numbers`."""
        hold = Hold(int(row[0]), float(row[1]), bool(row[2]))
        position, frame, last_position, last_frame = np.split(row[5:].copy(), [3, 7, 10])
        rigid, spun = bool(row[3]), float(row[4])
        return cls(hold, position, frame, last_position, last_frame, rigid, spun)

    @property
    def moves(self) -> bool:
        """The target is not where it was in the step before."""
        return not (
            np.array_equal(self.position, self.last_position)
            and np.array_equal(self.frame, self.last_frame)
        )

    def arrived(self) -> Held:
        """The same hold after a step."""
        return replace(self, last_position=self.position, last_frame=self.frame, spun=0.0)

    def ahead(self, steps: float) -> tuple[Array, Array]:
        """Pose that a target moving on as in this step reaches so many steps later."""
        turn = chain_layout.rotation_vector(
            chain_layout.multiply(self.frame, chain_layout.conjugate(self.last_frame))
        )
        position = self.position + steps * (self.position - self.last_position)
        return position, chain_layout.multiply(chain_layout.exponential(steps * turn), self.frame)


@dataclass(frozen=True)
class Load:
    """A point force (3,) N and moment (3,) N m in the world frame at an arc length."""

    arc_length: float
    force: Array
    moment: Array

    WIDTH: ClassVar[int] = 7

    def to_numbers(self) -> Array:
        """All of it as one array (7,)."""
        return np.concatenate([[self.arc_length], self.force, self.moment])

    @classmethod
    def from_numbers(cls, row: Array) -> Load:
        """The inverse of `to_numbers`."""
        return cls(float(row[0]), row[1:4].copy(), row[4:7].copy())


def stack_rows(items: Sequence[Held | Load], width: int) -> Array:
    """Returns holds or loads as an array (k, width), for a snapshot."""
    return np.array([item.to_numbers() for item in items], dtype=np.float64).reshape(-1, width)


def add_equality(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, along: float, held: Held, options: dict[str, object]
) -> None:
    """Ties a point of a segment to a mocap body: a weld for a clamp, else a connect.

    A weld also holds the twist of the segment, which the tangent alone would leave free. The point
    is `along` from the segment's first node (m); `options` are solref and solimp of the constraint.
    """
    number = held.hold.number
    body.add_site(name=f"held{number}", pos=[along, 0, 0])
    target = spec.worldbody.add_body(
        name=f"target{number}", mocap=True, pos=held.position, quat=held.frame
    )
    target.add_site(name=f"target{number}")
    kind = mujoco.mjtEq.mjEQ_WELD if held.hold.fixes_tangent else mujoco.mjtEq.mjEQ_CONNECT
    spec.add_equality(
        name=f"hold{number}",
        type=kind,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=f"held{number}",
        name2=f"target{number}",
        **options,
    )


def compute_equality_reaction(
    model: mujoco.MjModel, data: mujoco.MjData, held: Held, body: int
) -> Reaction:
    """Returns what an equality constraint does to the hose at the held point.

    The force is the constraint's first three rows. The rows of a weld's rotation are in a frame of
    MuJoCo's own, so the moment is the one that gives the constraint's generalised force.
    """
    mine = find_rows(data, model.equality(f"hold{held.hold.number}").id)
    force = data.efc_force[mine][:3].copy()
    if not held.hold.fixes_tangent:
        return Reaction(force, np.zeros(3))
    generalized = np.zeros(model.nv)
    mujoco.mj_mulJacTVec(model, data, generalized, np.where(mine, data.efc_force, 0.0))
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    point = data.site(f"held{held.hold.number}").xpos
    mujoco.mj_jac(model, data, linear, angular, point, body)
    moment = np.linalg.lstsq(angular.T, generalized - linear.T @ force, rcond=1e-9)[0]
    return Reaction(force, moment)


def find_rows(data: mujoco.MjData, equality: int) -> np.ndarray:
    """Which of MuJoCo's constraint rows (nefc,) are those of an equality constraint."""
    return np.asarray(
        (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY) & (data.efc_id == equality)
    )


def check_segments(layout: chain_layout.ChainLayout, held: Sequence[Held]) -> None:
    """Raises `InputError` for two holds on one rigid segment."""
    arc_lengths = np.array([item.hold.arc_length for item in held])
    index, _ = layout.locate(arc_lengths)
    for k in range(len(held)):
        if np.count_nonzero(index == index[k]) > 1:
            h = layout.segment_length
            raise InputError("arc_length", arc_lengths[k], f"on a segment (of {h:g} m) of its own")
