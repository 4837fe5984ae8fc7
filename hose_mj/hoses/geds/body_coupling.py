"""`Carried`: holds on bodies that feel the hose; the part of `GedsHose` that couples it to others.

A body answers a mean force F on the hose over a step by where it is at the end: after - compliance
F. With that the holds' rows of Newton's matrix get a diagonal block of their own, and the step
finds F such that hose and body meet, however light the body and stiff the hose (docs/world.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError, StepError
from hose_mj.hoses.geds import integrators as schemes
from hose_mj.hoses.geds import newton as solver
from hose_mj.hoses.geds.constraints import HoldSet
from hose_mj.hoses.geds.loads import LoadSet
from hose_mj.hoses.geds.point_masses import NEAR, PointMasses, advance_with_masses
from hose_mj.hoses.geds.spline import Spline
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.jit import run_kernel


class Carried:
    """The part of a hose that knows bodies which give way to it.

    Attributes:
        scheme: the hose's integrator.
        fallbacks, iterations: see `GedsHose`.
    """

    scheme: str
    fallbacks: int
    iterations: int
    _axes: tuple[float, ...]
    _hose: solver.Hose
    _holds: HoldSet
    _limits: solver.Limits
    _loads: LoadSet
    _spline: Spline
    _state: schemes.State
    _steps: int
    _timestep: float

    def try_step(self, holds: Sequence[Hold], positions: ArrayLike, compliance: ArrayLike) -> Array:
        """Takes a step that counts only once `keep_step` is called; it may be tried again.

        Args:
            holds: k attachments on bodies that give way; all others do not.
            positions: where each would be at the end of the step if the hose did not pull at it,
                (k, 3), m.
            compliance: by how much a mean force on the hose over the step moves them against it,
                (3 k, 3 k), m/N.

        Returns:
            the mean force of each hold on the hose over the step, (k, 3), N. Its sum over all holds
            times the time step is the momentum that they give to the hose, in any scheme.

        Raises:
            InputError: an explicit scheme, holds that are clamps or not here, wrong shapes, numbers
                that are not finite.
            StepError: no fallback finished the step; nothing has changed.
        """
        if self.scheme == "verlet":
            raise InputError("scheme", self.scheme, "an implicit scheme for a hose on bodies")
        self._holds.give_way(holds, positions, compliance)
        if len(self._trial.x) != len(self._state.x):
            self._trial = schemes.make_state(len(self._state.x))
        counts = np.zeros(3, dtype=np.int64)
        verdict = run_kernel(
            *(schemes.try_step, self._axes, self._hose, self._holds.rows, self._loads.loads),
            *(self._limits, schemes.SCHEMES[self.scheme], self._timestep),
            *(self._state, self._trial, counts),
        )
        self.iterations += int(counts[schemes.ITERATIONS])
        self.fallbacks += int(counts[schemes.FALLBACKS])
        self._check(verdict)
        return self._holds.find_mean_forces()

    def keep_step(self) -> None:
        """Makes the step of the last `try_step` count."""
        run_kernel(
            *(schemes.keep_step, self._axes, self._hose, self._holds.rows),
            *(self._trial, self._state),
        )
        self._steps += 1

    def find_held_positions(self) -> Array:
        """Where the holds of the last `try_step` would have the hose, (k, 3), m."""
        return self._holds.find_positions(self._trial.x)

    def mean_forces(self) -> Array:
        """Mean forces over the last step of the holds that give way, (k, 3), N; zero without."""
        return self._holds.find_mean_forces()

    def step_with_masses(self, holds: Sequence[Hold], masses: PointMasses, n_steps: int = 1) -> int:
        """Advances the hose and point masses at its attachments, all in compiled code.

        Args:
            holds: of the masses, in their order.
            masses: see `PointMasses`; its arrays are changed.
            n_steps: at most; it ends before a step in which a mass may meet another or a wall.

        Returns:
            the number of steps taken.

        Raises:
            InputError: as `try_step`.
            StepError: as `step`; the steps before count.
        """
        if self.scheme == "verlet":
            raise InputError("scheme", self.scheme, "an implicit scheme for a hose on bodies")
        check_count("n_steps", n_steps, 0)
        first = self._holds.give_way(holds)
        counts = np.zeros(3, dtype=np.int64)
        verdict = run_kernel(
            *(advance_with_masses, self._axes, self._hose, self._holds.rows, self._loads.loads),
            *(self._limits, (schemes.SCHEMES[self.scheme], self._timestep, int(n_steps))),
            *(self._state, counts, masses, first),
        )
        self._steps += int(counts[schemes.STEPS])
        self.iterations += int(counts[schemes.ITERATIONS])
        self.fallbacks += int(counts[schemes.FALLBACKS])
        if verdict != NEAR:
            self._check(verdict)
        return int(counts[schemes.STEPS])

    _trial = schemes.make_state(0)

    def _check(self, verdict: int) -> None:
        if verdict != solver.DONE:
            time = self._steps * self._timestep
            raise StepError(
                f"the step at t = {time:.6g} s failed: {solver.VERDICTS[verdict]}; "
                f"try a time step below {self._timestep:g} s or check holds and loads"
            )
