"""`Bodies`: how the robots of an mjModel move under forces at their sites, one step at a time.

A step is tried under some mean forces F that the robots do to the hose, and taken back as often as
wanted: with the same F it is the very step that MuJoCo takes. What a step answers to a change of F
is linear as long as no contact opens or closes, and `find_compliance` says how.
"""

from __future__ import annotations

import mujoco
import numpy as np

from hose_mj.hoses.protocol import Array

_QUADRATIC = int(mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC)
_SKIPPED = int(mujoco.mjtStage.mjSTAGE_VEL)


class Bodies:
    """The bodies of one mjModel under MuJoCo's integrator implicitfast.

    Args:
        model, data: MuJoCo's.
        sites: ids of the sites where forces act, (k,).
    """

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

    def find_compliance(self, is_exact: bool) -> Array:
        """By how much F (N) moves the sites against it within the step, (3 k, 3 k), m/N.

        Contacts, limits and other constraints of the last step tried go on to act, and give way as
        MuJoCo lets them.

        Args:
            is_exact: True for the derivative at the last step tried: forces act on the pose at the
                beginning of the step and are seen on that at its end, so it is not symmetric where
                bodies turn. False for the symmetric one without the turn, which every step can do.
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
