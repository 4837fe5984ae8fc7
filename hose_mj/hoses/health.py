"""How well a simulation of a hose goes: `hose.health`, and the warnings that it gives."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, NamedTuple

from hose_mj.errors import HoseWarning, StepError
from hose_mj.hoses.entanglement import compute_least_distance, compute_writhe
from hose_mj.hoses.protocol import Array

MOST_RETRIES = 0.5  # a step; impacts on thin walls take 0.3, free motions none
DEEPEST = 0.3  # radii; the default law sinks 0.2 at the tension that breaks a hose
SHARPEST = 0.75  # rad a span: the ratio of the pulls round a post is then off by 2 % (physics.md)
LARGEST_STRAIN = 0.01  # as laid
LARGEST_JUMP = 0.1  # of the length; what moves farther in a step throws the hose
EVERY = 64  # steps between two looks at retries and mesh


class Line(NamedTuple):
    """A centre line at one time."""

    points: Array  # evenly along it, (k, 3), m
    length: float  # m
    radius: float  # of the hose (m)
    is_closed: bool
    turns: float  # its twist less what clamps were spun by, in turns


@dataclass(frozen=True)
class Health:
    """What went on since the last reset; see docs/physics.md for what each says."""

    steps: int  # done
    retry_share: float  # how often a step had to be tried another way, of all steps
    deepest_contact: float  # in radii of the hose; above 0 inside the surface
    sharpest_contact: float  # turn of the tangent in a span round what it touches (rad)
    least_stretch: float  # |r'| now: 1 as long as at rest, near 0 folded
    laid_strain: float  # the largest as `reset` laid it
    largest_jump: float  # of a hold within a step (m)
    crossings: int  # contact points that passed through another part of the hose
    warnings: tuple[str, ...]  # all that was said
    # Energy beyond what loads and holds have put in (J), below 0 where it was lost; nan where their
    # work is not known: moments, spins, moving surfaces, bodies that feel the hose.
    energy_gained: float
    line: Line = field(repr=False, compare=False)  # the centre line now
    begun: Line | None = field(repr=False, compare=False)  # when its ends were last taken hold of

    def summarize(self) -> dict[str, Any]:
        """Its numbers and warnings, for documents; None for what is not known."""
        shown = {part.name: getattr(self, part.name) for part in fields(self) if part.repr}
        if math.isnan(self.energy_gained):
            shown["energy_gained"] = None
        return shown

    @cached_property
    def least_distance(self) -> float:
        """Least distance between centre lines of parts more than 6 radii apart, in radii."""
        line, radius = self.line, self.line.radius
        apart = 6.0 * radius
        return compute_least_distance(line.points, line.length, apart, line.is_closed) / radius

    @cached_property
    def lost_links(self) -> int | None:
        """By how much twist plus writhe has changed without a spin: 2 for each passage.

        None where that may change: unless the hose is closed, or clamped at both ends with tangents
        that stay as they are.
        """
        if self.begun is None:
            return None
        links = [line.turns + compute_writhe(line.points) for line in (self.begun, self.line)]
        return 2 * round((links[1] - links[0]) / 2.0)


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
        self.largest_jump = self.laid_strain = self.sharpest = 0.0

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

    def check_steps(
        self,
        steps: int,
        retries: int,
        deepest: float,
        crossings: int,
        measure_turn: Callable[[], float],
    ) -> None:
        """Looks at what was counted so far; `deepest` is in radii.

        The sharpest turn of a span in contact (rad) is measured now and then.
        """
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
            self.sharpest = max(self.sharpest, measure_turn())
            if self.sharpest > SHARPEST:
                self._tell(
                    "mesh",
                    f"a surface bends the hose by {self.sharpest:.2g} rad within one span, which a "
                    "span cannot follow: take more control points, so that it is "
                    f"{0.67 * SHARPEST:.1g} at most",
                )
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
        turn: float,
        measure_stretch: Callable[[], float],
        *rest: Any,
    ) -> Health:
        """All of it; `turn` is that of a span in contact now (rad), `rest` what is not watched."""
        share = (retries - self._retries_before) / max(steps, 1)
        said = tuple(self._said.values())
        self.sharpest = max(self.sharpest, turn)
        numbers = (self.sharpest, measure_stretch(), self.laid_strain, self.largest_jump, crossings)
        return Health(steps, share, deepest, *numbers, said, *rest)

    def _tell(self, kind: str, text: str) -> None:
        if kind in self._said:
            return
        if self._strict:
            raise StepError(text)  # every time: who goes on all the same is told again
        self._said[kind] = text
        warnings.warn(text, HoseWarning, stacklevel=4)
