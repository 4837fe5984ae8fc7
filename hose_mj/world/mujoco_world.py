"""`MujocoWorld`: a hose that is part of the scene's own mjModel, tied to robots and source.

cable_world.py and flex_world.py say what the hose is made of. MuJoCo solves bodies, hose, the ties
between them and all contacts in one step.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import StepError
from hose_mj.hoses.inputs import check_arc_lengths, check_count
from hose_mj.hoses.mujoco.chain import check_plain
from hose_mj.hoses.mujoco.chain_holds import find_rows
from hose_mj.hoses.mujoco.chain_layout import ChainMotion
from hose_mj.hoses.mujoco.flex_layout import FlexMotion, interpolate
from hose_mj.hoses.mujoco.model import mute_warnings, went_bad
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world import mujoco_scene
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.initial_shape import N_POINTS, relax_initial_shape
from hose_mj.world.world import World

_ROUNDS = 50  # Newton steps of `fit_chain` at most; a chain that can reach takes a few
_TOLERANCE = 1e-13  # error of a fitted chain over its length: rounding


class MujocoWorld(World):
    """A scene with a hose of straight pieces between nodes among its bodies.

    The scene's own option for integrator, solver, Jacobian, friction cone and impratio are
    replaced; the rest of it is as the scene says. Site-to-site `connect` constraints tie the hose
    to the robots and the source. It touches the geoms that a geom of contype and conaffinity 1
    would touch, with the scene's friction for the hose; not itself, and not the geoms of a robot
    within three of its radii of arc from its attachment (mujoco_scene.py).

    Args:
        scene: checked.
        nodes: arc lengths of the hose's nodes (K + 1,), m, from 0 to L.
        numerics: how it is stepped.

    Attributes:
        nodes: as given.
        substeps: MuJoCo's steps in one of the world's.
        hose_bodies: ids of the hose's bodies, from the source to the tip.
        start_gap: largest distance between a robot's site (or the source) and the hose after a
            reset (m); above rounding only where a chain of straight pieces cannot reach.

    Raises:
        InputError: a value outside its valid set, a hose or a scene that MuJoCo cannot model.
    """

    _advice: str  # what to try where the hose is unstable
    _tension_places: Array  # arc lengths where tensions are known (m)

    def __init__(self, scene: Scene, nodes: Array, numerics: mujoco_scene.Numerics) -> None:
        check_plain(type(self).__name__, scene.spec)
        self.nodes, self.substeps = nodes, numerics.substeps
        self._timestep = numerics.timestep
        maker = scene.make_spec()
        numerics.apply(maker.option)
        contact, obstacles = mujoco_scene.open_scene(scene, maker, nodes, numerics.timestep)
        hose = self._make_hose(scene.spec, contact, numerics.tie_options())
        model, self.hose_bodies = mujoco_scene.join_hose(scene, maker, hose, numerics.tie_options())
        self._finish_model(scene.spec, model)
        super().__init__(scene, model)
        first = int(model.body_dofadr[self.hose_bodies[0]])
        self._joints = slice(first, first + int(model.body_dofnum[self.hose_bodies].sum()))
        self._holds = [
            model.equality(f"{mujoco_scene.PREFIX}hold{k}").id for k in range(len(self.arc_lengths))
        ]
        self._motion: ChainMotion | FlexMotion | None = None
        self._forces = np.zeros((len(self.arc_lengths), 3))
        self._tensions = np.zeros(0)
        self._start_bodies()
        places = self.site_positions()
        relaxed = relax_initial_shape(
            scene.spec, places, self.arc_lengths, obstacles, np.array(self.model.opt.gravity)
        )
        curve = relaxed.position(np.linspace(0.0, scene.spec.length, N_POINTS))
        self._start = fit_curve(curve, nodes, self.arc_lengths, places)
        self.reset()
        met = self.hose_position(self.arc_lengths) - self.site_positions()
        self.start_gap = float(np.linalg.norm(met, axis=1).max())

    # -- what each kind of hose says for itself ----------------------------------------------------

    @abstractmethod
    def _make_hose(
        self, spec: HoseSpec, contact: mujoco_scene.HoseContact, ties: dict[str, list[float]]
    ) -> mujoco.MjSpec:
        """A model of the hose alone, with sites hold0, hold1, ... for robots and source.

        `contact` says how it touches the scene; `ties` are solref and solimp of equality
        constraints.
        """

    def _finish_model(self, spec: HoseSpec, model: mujoco.MjModel) -> None:
        """Sets what can be set in a compiled model only."""

    @abstractmethod
    def _set_nodes(self, nodes: Array) -> None:
        """Writes the qpos of the hose with its nodes at (K + 1, 3), m."""

    @abstractmethod
    def _read_motion(self) -> ChainMotion | FlexMotion:
        """Reads how the hose lies and moves now."""

    @abstractmethod
    def _read_tensions(self) -> Array:
        """Tensions in MuJoCo's last step, where `_tension_places` says."""

    # -- the world's protocol ----------------------------------------------------------------------

    @property
    def timestep(self) -> float:
        """Length of one step (s); MuJoCo takes `substeps` steps in it."""
        return self._timestep

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return float(self.data.time)

    def reset(self) -> None:
        """See `World.reset`; forces and tensions are those of the first instant."""
        self._start_bodies()
        self._set_nodes(self._start)
        self.data.qvel[self._joints] = 0.0
        with mute_warnings():
            mujoco.mj_forward(self.model, self.data)
        self._forces, self._tensions = self._find_hold_forces(), self._read_tensions()
        self._finish()

    def step(self, n_steps: int = 1) -> None:
        """See `World.step`."""
        check_count("n_steps", n_steps, 0)
        for _ in range(n_steps):
            self._advance()

    def hose_position(self, arc_length: ArrayLike) -> Array:
        """See `World.hose_position`; straight between the nodes."""
        return self._move().position(self._check(arc_length))

    def hose_velocity(self, arc_length: ArrayLike) -> Array:
        """See `World.hose_velocity`."""
        return self._move().velocity(self._check(arc_length))

    def tension(self, arc_length: ArrayLike) -> Array:
        """See `World.tension`; straight lines between robots, each of whom makes it jump."""
        s = self._check(arc_length)
        ends = np.unique([0.0, *self.arc_lengths, self.scene.spec.length])
        stretch = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(ends) - 2)
        places, found = self._tension_places, np.zeros(len(s))
        for k in np.unique(stretch):
            inside = (places > ends[k]) & (places < ends[k + 1])
            if not inside.any():
                inside[np.argmin(np.abs(places - (ends[k] + ends[k + 1]) / 2))] = True
            mine = stretch == k
            found[mine] = interpolate(s[mine], places[inside], self._tensions[inside])
        return found

    def centre_line(self) -> CentreLine:
        """See `World.centre_line`: straight pieces between the nodes."""
        return CentreLine.of_chain(self.nodes, self._move().position(self.nodes))

    def attachment_forces(self) -> Array:
        """See `World.attachment_forces`: means over the substeps of the last step."""
        return self._forces.copy()

    def hose_snapshot(self) -> dict[str, Any]:
        """See `World.hose_snapshot`: forces and tensions of the last step."""
        return {"forces": self._forces.copy(), "tensions": self._tensions.copy()}

    def restore_hose(self, state: dict[str, Any]) -> None:
        """See `World.restore_hose`."""
        self._forces, self._tensions = state["forces"].copy(), state["tensions"].copy()
        self._motion = None

    # -- inside ------------------------------------------------------------------------------------

    def _advance(self) -> None:
        """One step of the world; on a `StepError` the state is the one before."""
        before = self.snapshot()
        self._write_inputs()
        total = np.zeros_like(self._forces)
        with mute_warnings():
            for _ in range(self.substeps):
                mujoco.mj_step(self.model, self.data)
                total += self._find_hold_forces()
        if went_bad(self.data):
            self._restore(before)
            raise StepError(
                f"MuJoCo met a NaN or a huge number in the step from time {self.time:g} s at "
                f"timestep {self.timestep:g} s in {self.substeps} substeps: {self._advice}"
            )
        self._forces, self._tensions = total / self.substeps, self._read_tensions()
        self._finish()

    def _finish(self) -> None:
        """Makes all that can be asked follow qpos and qvel."""
        self._motion = None
        self._update_poses()

    def _move(self) -> ChainMotion | FlexMotion:
        if self._motion is None:
            self._motion = self._read_motion()
        return self._motion

    def _check(self, arc_length: ArrayLike) -> Array:
        return check_arc_lengths(arc_length, self.scene.spec.length)

    def _find_hold_forces(self) -> Array:
        """Forces of the ties on the hose in MuJoCo's last step (N + 1, 3), N."""
        force = self.data.efc_force
        return np.stack([force[find_rows(self.data, k)] for k in self._holds])


@dataclass(frozen=True)
class Pin:
    """A point of a chain, at a part of one of its straight pieces, that is to be at (3,), m."""

    piece: int
    part: float
    target: Array


def fit_curve(curve: Array, nodes: Array, arc_lengths: Array, places: Array) -> Array:
    """Returns a chain, nodes (K + 1, 3), m, along a curve; see `fit_chain`.

    The curve's points (n, 3), m, are even in arc length from 0 to L, the chain's nodes at arc
    lengths (K + 1,), m. It is held at `arc_lengths` (k,), m, in `places` (k, 3), m.
    """
    even, lengths = np.linspace(0.0, nodes[-1], len(curve)), np.diff(nodes)
    points = np.stack([np.interp(nodes, even, curve[:, c]) for c in range(3)], axis=1)
    piece = np.clip(np.searchsorted(nodes, arc_lengths, "right") - 1, 0, len(lengths) - 1)
    parts = (arc_lengths - nodes[piece]) / lengths[piece]
    pins = [Pin(int(k), float(part), p) for k, part, p in zip(piece, parts, places, strict=True)]
    return fit_chain(points, lengths, pins)


def fit_chain(points: Array, lengths: Array, pins: list[Pin]) -> Array:
    """Returns nodes (N + 1, 3), m, near `points` at distances `lengths` (N,) that meet the pins.

    Newton's method on these equations, each step the smallest that solves their linear form. What
    cannot be met (pins further apart than the chain is long) is left as it is after so many rounds.
    """
    nodes = points.copy()
    count = len(lengths)
    rows = np.zeros((count + 3 * len(pins), count + 1, 3))
    for k, pin in enumerate(pins):
        block = rows[count + 3 * k : count + 3 * k + 3]
        block[:, pin.piece] = (1.0 - pin.part) * np.eye(3)
        block[:, pin.piece + 1] = pin.part * np.eye(3)
    piece = np.arange(count)
    for _ in range(_ROUNDS):
        chords = np.diff(nodes, axis=0)
        found = np.linalg.norm(chords, axis=1)
        errors = [found - lengths]
        for pin in pins:
            errors.append(nodes[pin.piece] + pin.part * chords[pin.piece] - pin.target)
        error = np.concatenate(errors)
        if np.abs(error).max() < _TOLERANCE * lengths.sum():
            break
        tangents = chords / found[:, None]
        rows[piece, piece], rows[piece, piece + 1] = -tangents, tangents
        change = np.linalg.lstsq(rows.reshape(len(rows), -1), error, rcond=1e-10)[0]
        nodes -= change.reshape(-1, 3)
    return nodes
