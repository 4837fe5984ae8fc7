"""`Break`: a limit that was crossed: which, by whom, when, where and how fast."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

STRETCH, RUN_OVER, COLLISION = "stretch", "run-over", "collision"
BOUNDS, OBSTACLE = "bounds", "obstacle"
KINDS = (STRETCH, RUN_OVER, COLLISION, BOUNDS, OBSTACLE)
UNITS = {STRETCH: "N", RUN_OVER: "m", COLLISION: "m", BOUNDS: "m", OBSTACLE: "m"}


@dataclass(frozen=True)
class Break:
    """A margin that fell below zero.

    Attributes:
        kind: one of `KINDS`.
        robot: the robot's number; None for a stretched segment.
        other: the segment (stretch, run-over), the other robot (collision), the obstacle's geom
            (obstacle); None for bounds.
        time: when the margin was zero (s).
        place: where (3,), m, world frame.
        margin: at the end of the step in which it was crossed, m, or N for stretch.
        speed: how fast the margin fell in that step, m/s, or N/s for stretch; 0 for a margin that
            was below zero from the start.
    """

    kind: str
    robot: int | None
    other: int | str | None
    time: float
    place: tuple[float, float, float]
    margin: float
    speed: float

    def describe(self) -> str:
        """One line of English."""
        where = ", ".join(f"{x:.3f}" for x in self.place)
        unit = UNITS[self.kind]
        how = f"at {self.speed:.3g} {unit}/s" if self.speed > 0.0 else "from the start"
        return f"{self.time:.3f} s: {self._what()} at ({where}) m, {how} ({self.margin:.3g} {unit})"

    def to_record(self) -> dict[str, Any]:
        """Plain JSON values, by the attributes' names."""
        return {**asdict(self), "place": list(self.place)}

    def _what(self) -> str:
        if self.kind == STRETCH:
            return f"segment {self.other} of the hose was stretched too far"
        if self.kind == RUN_OVER:
            return f"robot {self.robot} ran over segment {self.other} of the hose"
        if self.kind == COLLISION:
            return f"robots {self.robot} and {self.other} collided"
        if self.kind == BOUNDS:
            return f"robot {self.robot} left the bounds"
        return f"robot {self.robot} hit {self.other}"
