"""`BodyCoupling`: steps of a hose with bodies that feel it, `hose.coupling`.

A body answers a mean force F on the hose over a step by where it is at the end: after - compliance
F. With that the constraints' rows of Newton's matrix get a diagonal block of their own, and the
step finds F such that hose and body meet, however light the body and stiff the hose
(docs/world.md).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.errors import InputError
from hose_mj.hoses.geds import stepping
from hose_mj.hoses.geds.dynamics import Dynamics
from hose_mj.hoses.geds.integrators import STEPS
from hose_mj.hoses.geds.point_masses import NEAR, PointMasses
from hose_mj.hoses.inputs import check_count
from hose_mj.hoses.protocol import Array, Hold


class BodyCoupling:
    """Steps of a hose with bodies that feel it, `hose.coupling`.

    Args:
        dynamics: the hose's.
    """

    def __init__(self, dynamics: Dynamics) -> None:
        self._dynamics = dynamics

    def try_step(self, holds: Sequence[Hold], positions: ArrayLike, compliance: ArrayLike) -> Array:
        """Takes a step that counts only once `accept_step` is called; it may be tried again.

        Args:
            holds: k attachments on bodies that feel the hose; all others do not move for it.
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
        d = self._dynamics
        self._check_implicit()
        d.first_energy = np.inf
        d.constraints.set_compliance(holds, positions, compliance)
        steps = int(d.counts[STEPS])
        verdict = d.run(stepping.TRY, 1)
        d.counts[STEPS] = steps
        d.check(verdict)
        return d.constraints.compute_mean_forces()

    def accept_step(self) -> None:
        """Makes the step of the last `try_step` count."""
        d = self._dynamics
        d.run(stepping.ACCEPT, 1)
        d.counts[STEPS] += 1
        d.check_health()

    def compute_positions(self) -> Array:
        """Where the holds of the last `try_step` would have the hose, (k, 3), m."""
        return self._dynamics.constraints.compute_positions(self._dynamics.trial.x)

    def compute_mean_forces(self) -> Array:
        """Mean forces over the last step of the holds on bodies, (k, 3), N; zero without."""
        return self._dynamics.constraints.compute_mean_forces()

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
            StepError: as `GedsHose.step`; the steps before count.
        """
        d = self._dynamics
        self._check_implicit()
        check_count("n_steps", n_steps, 0)
        first = d.constraints.set_compliance(holds)
        before = int(d.counts[STEPS])
        verdict = d.run(stepping.ADVANCE, int(n_steps), masses, first)
        if verdict != NEAR:
            d.check(verdict)
        d.check_health()
        return int(d.counts[STEPS]) - before

    def _check_implicit(self) -> None:
        """Raises `InputError` for the explicit scheme."""
        scheme = self._dynamics.scheme
        if scheme == "verlet":
            raise InputError("scheme", scheme, "an implicit scheme for a hose on bodies")
