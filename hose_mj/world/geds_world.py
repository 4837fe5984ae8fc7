"""`GedsWorld`: a spline hose coupled strongly to the bodies of an mjModel (docs/world.md).

A step tries MuJoCo's own step under the forces of the hose, lets the hose find the forces with
which both meet at the attachments, and goes on until they do. Hose and bodies exchange the very
same impulses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.coupling import Bodies
from hose_mj.world.hose_touch import HoseTouch
from hose_mj.world.initial_shape import count_control_points, relax_hose
from hose_mj.world.measured_geoms import add_probe
from hose_mj.world.planar_point_robots import Pucks
from hose_mj.world.world import World

GAP = 1e-6
"""Largest distance of hose and site at the end of a step (m), where `MOST_SWEEPS` suffice."""
MOST_SWEEPS = 10
_SLOW = 5.0
"""After a sweep that closes the gap by less than this factor the answer to it is corrected."""


class GedsWorld(World):
    """Robots on a spline hose.

    Args:
        scene: checked.
        timestep: of hose and bodies alike (s); None for the scene's.
        control_points: of the hose; None for five spans between neighbouring robots, at least 16.
        scheme: of the hose: bdf2 (default), backward-euler, sdirk2, midpoint. MuJoCo steps its
            bodies with implicitfast whatever the scene says.
        compiled_pucks: whether a scene of pucks, robots that are one body on slides each, steps in
            compiled code while no puck is near anything; the motion is the same.

    Attributes:
        hose: the spline.
        sweeps: how often hose and bodies were solved for one another so far.

    Raises:
        InputError: a value outside its valid set.
    """

    hose_model = "geds"

    def __init__(
        self,
        scene: Scene,
        *,
        timestep: float | None = None,
        control_points: int | None = None,
        scheme: str = "bdf2",
        compiled_pucks: bool = True,
    ) -> None:
        if scheme == "verlet":
            raise InputError("scheme", scheme, "an implicit scheme for a hose on bodies")
        spec = scene.make_spec()
        add_probe(spec)
        model = spec.compile()
        super().__init__(scene, model)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        model.opt.timestep = scene.timestep if timestep is None else timestep
        n = count_control_points(self.n_robots) if control_points is None else control_points
        self.hose = GedsHose(
            scene.spec,
            timestep=model.opt.timestep,
            gravity=model.opt.gravity,
            control_points=n,
            scheme=scheme,
            tolerance=1e-6,
        )
        self.sweeps = 0
        self._start_bodies()
        self._touch = HoseTouch(self.model, self.data, self.hose, self.sites, self.arc_lengths)
        self._touch.set_obstacles(scene.friction)
        self._bodies = Bodies(self.model, self.data, self.sites[:-1])
        self._start = relax_hose(
            *(scene.spec, self.site_positions(), self.arc_lengths),
            *(self.hose.contacts.obstacles, self.hose.gravity, n),
        ).control_points
        self._pucks = Pucks.find(self, self._touch) if compiled_pucks else None
        # The coefficients of the centre line are linear in the control points.
        unit = CentreLine.of_spline(*self.hose.weigh_spans())
        self._line = unit.arc_lengths, unit.coefficients.reshape(-1, n)
        self.reset()

    # -- the world's protocol ----------------------------------------------------------------------

    @property
    def timestep(self) -> float:
        """Length of one step (s)."""
        return self.hose.timestep

    @property
    def time(self) -> float:
        """Simulated time since the last reset (s)."""
        return self.hose.time

    def reset(self) -> None:
        """See `World.reset`."""
        self._start_bodies()
        self.hose.set_control_points(self._start)
        self._holds = [
            self.hose.attach(float(s), place)
            for s, place in zip(self.arc_lengths, self.site_positions(), strict=True)
        ]
        self._touch.reset()

    def step(self, n_steps: int = 1) -> None:
        """See `World.step`."""
        check_count("n_steps", n_steps, 0)
        while n_steps > 0:
            done = 0
            if self._pucks is not None:
                done = self._pucks.step(self._holds[:-1], n_steps)
            if done < n_steps:
                self._step_bodies()
                done += 1
            n_steps -= done

    def position(self, arc_length: ArrayLike) -> Array:
        """See `World.position`."""
        return self.hose.position(arc_length)

    def velocity(self, arc_length: ArrayLike) -> Array:
        """See `World.velocity`."""
        return self.hose.velocity(arc_length)

    def tension(self, arc_length: ArrayLike) -> Array:
        """See `World.tension`."""
        return self.hose.tension(arc_length)

    def centre_line(self) -> CentreLine:
        """See `World.centre_line`: the spline's own spans."""
        arc_lengths, weights = self._line
        coefficients = weights @ self.hose.control_points
        return CentreLine(arc_lengths, coefficients.reshape(-1, 4, 3))

    def attachment_forces(self) -> Array:
        """See `World.attachment_forces`: means over the last step; at the source its end's."""
        at_source = self.hose.reaction(self._holds[-1]).force
        return np.concatenate([self.hose.coupling.compute_mean_forces(), at_source[None]])

    def hose_snapshot(self) -> dict[str, Any]:
        """See `World.hose_snapshot`."""
        return {"hose": self.hose.snapshot(), "touch": self._touch.snapshot()}

    def restore_hose(self, state: dict[str, Any]) -> None:
        """See `World.restore_hose`."""
        self.hose.restore(state["hose"])
        self._holds = self.hose.holds
        self._update_poses()
        self._touch.restore(state["touch"])

    # -- inside ------------------------------------------------------------------------------------

    def _step_bodies(self) -> None:
        """One step of hose and bodies, MuJoCo's step tried until they meet."""
        bodies, hose, held = self._bodies, self.hose, self._holds[:-1]
        self._write_inputs()
        self._touch.push(self.data.qfrc_applied)
        bodies.begin()
        self._touch.measure()
        try:
            self._meet(held)
        except StepError:
            bodies.take_back()
            raise
        if not (np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()):
            bodies.take_back()
            raise StepError(
                f"the step at t = {self.time:.6g} s failed: MuJoCo met numbers that are not "
                f"finite; try a time step below {self.timestep:g} s or smaller controls"
            )
        hose.coupling.accept_step()
        bodies.end()
        self._touch.update()

    def _meet(self, held: Sequence[Hold]) -> None:
        """Finds the forces under which the steps of hose and bodies end with both together.

        Each sweep solves the hose for a linear answer of the bodies: first the symmetric one, then
        Newton's, and where contacts open or close so that this does not help, Newton's corrected
        by what the bodies did answer (Broyden 1965).
        """
        bodies, hose = self._bodies, self.hose
        forces = np.zeros((len(held), 3))
        best = _Meeting(np.inf, forces, bodies.try_step(forces), forces, np.zeros((0, 0)))
        give = bodies.find_compliance(is_exact=False)
        is_symmetric = True
        for _ in range(MOST_SWEEPS):
            aim = best.reached + (give @ best.forces.ravel()).reshape(-1, 3)
            try:
                found = hose.coupling.try_step(held, aim, give)
            except StepError:
                if is_symmetric:
                    raise
                give, is_symmetric = bodies.find_compliance(is_exact=False), True
                continue
            self.sweeps += 1
            moved = bodies.try_step(found)
            missed = moved - hose.coupling.compute_positions()
            gap = float(np.abs(missed).max())
            is_quick, change = gap < best.gap / _SLOW, (found - best.forces).ravel()
            if gap < best.gap:
                best = _Meeting(gap, found, moved, aim, give)
            if gap < GAP:
                return
            if is_quick:
                give = bodies.find_compliance(is_exact=True)
            else:
                give = give - np.outer(missed.ravel(), change) / max(float(change @ change), 1e-300)
            is_symmetric = False
        hose.coupling.try_step(held, best.aim, best.give)
        bodies.try_step(best.forces)


class _Meeting(NamedTuple):
    """How near hose and bodies have come (m), with which forces, for which answer of the bodies."""

    gap: float
    forces: Array
    reached: Array
    aim: Array
    give: Array
