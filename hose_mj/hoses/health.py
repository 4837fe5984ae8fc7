"""How well a simulation of a hose goes: `hose.health`, and the warnings that it gives."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from hose_mj.errors import HoseWarning, StepError

MOST_RETRIES = 0.5  # a step; impacts on thin walls take 0.3, free motions none
DEEPEST = 0.3  # radii; the default law sinks 0.2 at the tension that breaks a hose
LARGEST_STRAIN = 0.01  # as laid
LARGEST_JUMP = 0.1  # of the length; what moves farther in a step throws the hose
EVERY = 64  # steps between two looks at the retries


@dataclass(frozen=True)
class Health:
    """What went on since the last reset; see docs/physics.md for what each says."""

    steps: int  # done
    retry_share: float  # how often a step had to be tried another way, of all steps
    deepest_contact: float  # in radii of the hose; above 0 inside the surface
    least_stretch: float  # |r'| now: 1 as long as at rest, near 0 folded
    laid_strain: float  # the largest as `reset` laid it
    largest_jump: float  # of a hold within a step (m)
    crossings: int  # contact points that passed through another part of the hose
    warnings: tuple[str, ...]  # all that was said


class HealthWatch:
    """Gathers a hose's health and says what leaves its healthy range, each kind once.

    Args:
        length: of the hose (m).
        strict: whether a warning is a `StepError` instead.
    """

    def __init__(self, length: float, strict: bool) -> None:
        self._length, self._strict = length, strict
        self.reset(0)

    def reset(self, retries: int) -> None:
        """Begins anew; `retries` is how many there were before."""
        self._said: dict[str, str] = {}
        self._retries_before, self._looked = retries, (0, retries)
        self.largest_jump = self.laid_strain = 0.0

    def resume(self, steps: int, retries: int) -> None:
        """Goes on from counts that a snapshot has brought back."""
        self._retries_before, self._looked = 0, (steps, retries)

    @contextmanager
    def pause(self) -> Iterator[None]:
        """Says and refuses nothing within, and forgets what goes on there."""
        kept = {**vars(self), "_said": dict(self._said)}
        self._strict = False
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", HoseWarning)
                yield
        finally:
            vars(self).update(kept)

    def check_laid(self, strain: float, axial_stiffness: float) -> None:
        """Looks at the largest strain as laid; its force is that of the stiffness (N)."""
        self.laid_strain = strain
        if abs(strain) > LARGEST_STRAIN:
            self._tell(
                "strain",
                f"the hose is laid with a strain of {strain:.2%}, "
                f"{abs(strain) * axial_stiffness:.3g} N of force; lay it along a curve of its "
                f"length, {self._length:g} m, without corners",
            )

    def check_jump(self, jump: float) -> None:
        """Looks at how far a hold goes within the step to come (m)."""
        self.largest_jump = max(self.largest_jump, jump)
        if jump > LARGEST_JUMP * self._length:
            self._tell(
                "jump",
                f"a hold moves by {jump:.3g} m within one step, {jump / self._length:.0%} of the "
                f"hose: move it by at most {LARGEST_JUMP * self._length:.3g} m a step",
            )

    def check_steps(self, steps: int, retries: int, deepest: float, crossings: int) -> None:
        """Looks at what was counted so far; `deepest` is in radii."""
        if deepest > DEEPEST:
            self._tell(
                "contact",
                f"a surface is {deepest:.2g} radii inside the hose: take shorter steps, or give "
                "the contact law more stiffness",
            )
        if crossings > 0:
            self._tell(
                "crossings",
                "the hose has passed through itself: take shorter steps; a knot drawn tight wants "
                "a tenth of them",
            )
        before, known = self._looked
        if steps - before >= EVERY:
            self._looked = steps, retries
            share = (retries - known) / (steps - before)
            if share > MOST_RETRIES:
                self._tell(
                    "retries",
                    f"steps were tried another way {share:.2g} times each: the motion is not "
                    "resolved; take shorter steps, or more control points",
                )

    def report(
        self,
        steps: int,
        retries: int,
        deepest: float,
        crossings: int,
        measure_stretch: Callable[[], float],
    ) -> Health:
        """All of it."""
        share = (retries - self._retries_before) / max(steps, 1)
        said = tuple(self._said.values())
        numbers = (measure_stretch(), self.laid_strain, self.largest_jump, crossings)
        return Health(steps, share, deepest, *numbers, said)

    def _tell(self, kind: str, text: str) -> None:
        if kind in self._said:
            return
        if self._strict:
            raise StepError(text)  # every time: who goes on all the same is told again
        self._said[kind] = text
        warnings.warn(text, HoseWarning, stacklevel=4)
