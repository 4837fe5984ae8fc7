"""`GedsWorld`: a spline hose coupled strongly to the bodies of an mjModel (docs/world.md).

A step tries MuJoCo's own step under the forces of the hose, lets the hose find the forces with
which both meet at the attachments, and goes on until they do. Hose and bodies exchange the very
same impulses.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.health import Health
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.hoses.spec import check_number
from hose_mj.scenes.mjcf.scene import Scene
from hose_mj.world.centre_line import CentreLine
from hose_mj.world.geds_contact import GedsContact, add_probe
from hose_mj.world.initial_shape import count_control_points, relax_initial_shape
from hose_mj.world.planar_point_robots import PlanarPointRobots
from hose_mj.world.world import World, check_scene

GAP = 1e-6
"""Largest distance of hose and site at the end of a step (m), where `MOST_ITERATIONS` suffice."""
MOST_ITERATIONS = 10
_SLOW = 5.0
"""After an iteration that closes the gap by less than this factor the answer to it is corrected."""


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
        strict: whether what `health` warns of is a `StepError` instead, after the step.

    Attributes:
        hose: the spline.
        coupling_iterations: how often hose and bodies were solved for one another so far.

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
        strict: bool = False,
    ) -> None:
        check_scene(scene)
        timestep = scene.timestep if timestep is None else check_number("timestep", timestep)
        if isinstance(scheme, str) and scheme == "verlet":
            raise InputError("scheme", scheme, "an implicit scheme for a hose on bodies")
        spec = scene.make_spec()
        add_probe(spec)
        model = spec.compile()
        super().__init__(scene, model)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        model.opt.timestep = timestep
        n = count_control_points(self.n_robots) if control_points is None else control_points
        options: Any = {"control_points": n, "scheme": scheme, "tolerance": 1e-6}
        options |= {"timestep": model.opt.timestep, "gravity": model.opt.gravity, "strict": strict}
        self.hose = GedsHose(scene.spec, **options)
        self.coupling_iterations = 0
        self._start_bodies()
        self._contact = GedsContact(self.model, self.data, self.hose, self.sites, self.arc_lengths)
        self._contact.set_obstacles(scene.friction)
        self._bodies = Bodies(self.model, self.data, self.sites[:-1])
        self._start = relax_initial_shape(
            *(scene.spec, self.site_positions(), self.arc_lengths),
            *(self.hose.contacts.obstacles, self.hose.gravity, n),
        ).control_points
        self._point_robots = (
            PlanarPointRobots.find(self, self.hose, self._contact) if compiled_pucks else None
        )
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
        self._contact.reset()

    def step(self, n_steps: int = 1) -> None:
        """See `World.step`."""
        check_count("n_steps", n_steps, 0)
        while n_steps > 0:
            done = 0
            if self._point_robots is not None:
                done = self._point_robots.step(self._holds[:-1], n_steps)
            if done < n_steps:
                self._step_bodies()
                done += 1
            n_steps -= done

    @property
    def health(self) -> Health:
        """See `World.health`."""
        return self.hose.health

    def unwatched(self) -> AbstractContextManager[None]:
        """See `World.unwatched`."""
        return self.hose.unwatched()

    def hose_position(self, arc_length: ArrayLike) -> Array:
        """See `World.hose_position`."""
        return self.hose.position(arc_length)

    def hose_velocity(self, arc_length: ArrayLike) -> Array:
        """See `World.hose_velocity`."""
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
        return {"hose": self.hose.snapshot(), "contact": self._contact.snapshot()}

    def restore_hose(self, state: dict[str, Any]) -> None:
        """See `World.restore_hose`."""
        self.hose.restore(state["hose"])
        self._holds = self.hose.holds
        self._update_poses()
        self._contact.restore(state["contact"])

    # -- inside ------------------------------------------------------------------------------------

    def _step_bodies(self) -> None:
        """One step of hose and bodies, MuJoCo's step tried until they meet."""
        bodies, hose, held = self._bodies, self.hose, self._holds[:-1]
        self._write_inputs()
        self._contact.push(self.data.qfrc_applied)
        bodies.begin()
        self._contact.measure()
        try:
            self._couple(held)
        except StepError:
            bodies.take_back()
            raise
        if not (np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all()):
            bodies.take_back()
            raise StepError(
                f"the step at t = {self.time:.6g} s failed: MuJoCo met numbers that are not "
                f"finite; try a time step below {self.timestep:g} s or smaller controls"
            )
        try:
            hose.coupling.accept_step()
        finally:  # where a strict hose complains the step is done all the same
            bodies.end()
            self._contact.update()

    def _couple(self, held: Sequence[Hold]) -> None:
        """Finds the forces under which the steps of hose and bodies end with both together.

        Each iteration solves the hose for a linear answer of the bodies: first the symmetric one,
        then Newton's, and where contacts open or close so that this does not help, Newton's
        corrected by what the bodies did answer (Broyden 1965).
        """
        bodies, hose = self._bodies, self.hose
        forces = np.zeros((len(held), 3))
        best = _Iterate(np.inf, forces, bodies.try_step(forces), forces, np.zeros((0, 0)))
        compliance = bodies.compute_compliance(is_exact=False)
        is_symmetric = True
        for _ in range(MOST_ITERATIONS):
            aim = best.reached + (compliance @ best.forces.ravel()).reshape(-1, 3)
            try:
                found = hose.coupling.try_step(held, aim, compliance)
            except StepError:
                if is_symmetric:
                    raise
                compliance, is_symmetric = bodies.compute_compliance(is_exact=False), True
                continue
            self.coupling_iterations += 1
            moved = bodies.try_step(found)
            missed = moved - hose.coupling.compute_positions()
            gap = float(np.abs(missed).max())
            is_quick, change = gap < best.gap / _SLOW, (found - best.forces).ravel()
            if gap < best.gap:
                best = _Iterate(gap, found, moved, aim, compliance)
            if gap < GAP:
                return
            if is_quick:
                compliance = bodies.compute_compliance(is_exact=True)
            else:
                compliance = compliance - np.outer(missed.ravel(), change) / max(
                    float(change @ change), 1e-300
                )
            is_symmetric = False
        hose.coupling.try_step(held, best.aim, best.compliance)
        bodies.try_step(best.forces)


class _Iterate(NamedTuple):
    """An iterate of the coupling of hose and bodies."""

    gap: float  # how near hose and bodies have come (m)
    forces: Array  # with which (N)
    reached: Array  # where the bodies' sites are at the end of the step (m)
    aim: Array  # of the linear answer of the bodies that the hose was solved for
    compliance: Array  # likewise


_QUADRATIC = int(mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC)
_SKIPPED = int(mujoco.mjtStage.mjSTAGE_VEL)


class Bodies:
    """The bodies of one mjModel under MuJoCo's implicitfast; forces act at the sites (k,)."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, sites: np.ndarray) -> None:
        self._model, self._data, self._sites = model, data, [int(site) for site in sites]
        self._scratch = mujoco.MjData(model)
        nv = model.nv
        self._jacobian, self._last = np.zeros((2, 3 * len(sites), nv))
        self._rows, self._last_rows = (
            [matrix[3 * i : 3 * i + 3] for i in range(len(sites))]
            for matrix in (self._jacobian, self._last)
        )
        self._mass, self._identity = np.zeros((nv, nv)), np.eye(nv)
        self._user = np.zeros(nv)
        self._kept: list[tuple[Array, Array]] = []
        starts = np.asarray(model.D_rowadr), np.asarray(model.D_rownnz)
        self._deriv_rows = np.repeat(np.arange(nv), starts[1])
        places = [np.arange(a, a + n) for a, n in zip(*starts, strict=True)]
        self._deriv_places = np.concatenate([np.zeros(0, dtype=np.int64), *places])
        self._deriv_columns = np.asarray(model.D_colind)[self._deriv_places]

    def begin(self) -> None:
        """Begins a step from the present state, with controls and `qfrc_applied` as they are."""
        model, data = self._model, self._data
        mujoco.mj_step1(model, data)
        for row, site in zip(self._rows, self._sites, strict=True):
            mujoco.mj_jacSite(model, data, row, None, site)
        self._user[:] = data.qfrc_applied
        parts = (data.qpos, data.qvel, data.act, data.qacc_warmstart)
        self._kept = [(part, part.copy()) for part in parts]
        self._time = data.time

    def try_step(self, forces: Array) -> Array:
        """Takes the step under mean forces F (k, 3), N, of the sites on the hose.

        Returns:
            where the sites are at its end, (k, 3), m.
        """
        model, data = self._model, self._data
        self.take_back()
        data.qfrc_applied[:] = self._user - forces.ravel() @ self._jacobian
        mujoco.mj_forwardSkip(model, data, _SKIPPED, 1)
        mujoco.mj_implicit(model, data)
        self._scratch.qpos[:] = data.qpos
        self._scratch.mocap_pos[:], self._scratch.mocap_quat[:] = data.mocap_pos, data.mocap_quat
        mujoco.mj_kinematics(model, self._scratch)
        return np.array(self._scratch.site_xpos[self._sites])

    def take_back(self) -> None:
        """Returns to where the step began."""
        for part, kept in self._kept:
            part[:] = kept
        self._data.time = self._time

    def end(self) -> None:
        """Makes the last step tried count: poses follow."""
        self._data.qfrc_applied[:] = self._user
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def compute_compliance(self, is_exact: bool) -> Array:
        """Returns by how much F (N) moves the sites against it in the step, (3 k, 3 k), m/N.

        Contacts, limits and other constraints of the last step tried go on to act, and give way as
        MuJoCo lets them. Exact is the derivative at the last step tried: forces act on the pose at
        the beginning of the step and are seen on that at its end, so it is not symmetric where
        bodies turn. Otherwise it is the symmetric one without the turn, which every step can do.
        """
        model, data = self._model, self._data
        dt = model.opt.timestep
        mujoco.mj_fullM(model, data, self._mass)
        damped = self._mass.copy()
        damped[self._deriv_rows, self._deriv_columns] -= dt * data.qDeriv[self._deriv_places]
        moved = self._jacobian.T
        if data.nefc:
            active = np.asarray(data.efc_state) == _QUADRATIC
            if active.any():
                rows = np.asarray(data.efc_J).reshape(data.nefc, -1)[active]
                stiffness = rows.T @ (np.asarray(data.efc_D)[active, None] * rows)
                gone = np.linalg.solve(self._mass + stiffness, moved)
                moved = moved - stiffness @ gone
        answer = np.linalg.solve(damped, moved)
        if not is_exact:
            answer = self._jacobian @ answer
            return np.asarray(dt * dt * 0.5 * (answer + answer.T))
        mujoco.mj_comPos(model, self._scratch)
        for row, site in zip(self._last_rows, self._sites, strict=True):
            mujoco.mj_jacSite(model, self._scratch, row, None, site)
        return np.asarray(dt * dt * self._last @ answer)
