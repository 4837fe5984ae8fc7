"""The kinds of constraints, one row each: all that is known of a kind but how it is measured.

A new kind is a row of `KINDS` here, with a number for it, and a kernel that writes its margins in
margin_kernels.py. Monitors, breaks, recordings and policies read the rest from the row.
"""

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

from hose_mj.constraints.limits import Limits

STRETCH, RUN_OVER, COLLISION, BOUNDS, OBSTACLE = range(5)
"""Places in `KINDS`, in which order margins are numbered; kernels know kinds by these."""

Members = tuple[int | None, int | None]
"""The robot and the other party of a margin, as far as they are always the same."""


class Watched(NamedTuple):
    """What of a world decides which margins there are."""

    n_robots: int
    has_bounds: bool
    has_obstacles: bool


def _list_robots(watched: Watched) -> list[Members]:
    return [(robot, None) for robot in range(watched.n_robots)]


class Kind(NamedTuple):
    """One kind of constraint."""

    name: str  # as in the names of margins, breaks and policies
    unit: str  # of its margins, "N" or "m"
    color: tuple[int, int, int]  # red, green and blue of its margins in recordings, 0 to 255
    sentence: str  # what happened when it breaks, with {robot} and {other}
    # What its margins are measured against, with {limit}: the clearance, or for stretch the largest
    # tension.
    limit: str
    # How near (m) things may come, from the limits and the hose's radius (m).
    clearance: Callable[[Limits, float], float]
    # Lists robot and other of each margin; its length is how many there are.
    members: Callable[[Watched], list[Members]]
    needs: str  # what a scene needs for this kind to be broken
    script: str  # name of the function of rollout/scripts.py that lists ways to break it
    other: str  # what the other party of a break is: "segment", "robot", "geom"; "" for none


KINDS = (
    Kind(
        name="stretch",
        unit="N",
        color=(244, 130, 30),
        sentence="segment {other} of the hose was stretched too far",
        limit="tension at most {limit:.4g} N",
        clearance=lambda limits, radius: 0.0,
        members=lambda watched: [(None, segment) for segment in range(watched.n_robots)],
        needs="a scene with a hose",
        script="list_stretches",
        other="segment",
    ),
    Kind(
        name="run-over",
        unit="m",
        color=(180, 120, 255),
        sentence="robot {robot} ran over segment {other} of the hose",
        limit="hose's surface at least {limit:.3g} m away",
        clearance=Limits.compute_run_over_distance,
        members=_list_robots,
        needs="a scene with a hose and a robot that has a solid geom",
        script="list_run_overs",
        other="segment",
    ),
    Kind(
        name="collision",
        unit="m",
        color=(230, 90, 160),
        sentence="robots {robot} and {other} collided",
        limit="robots at least {limit:.3g} m apart",
        clearance=lambda limits, radius: limits.collision_distance,
        members=lambda watched: list(combinations(range(watched.n_robots), 2)),
        needs="a scene with two robots or more (floor_2 to floor_6, corridor, deck, lift)",
        script="list_collisions",
        other="robot",
    ),
    Kind(
        name="bounds",
        unit="m",
        color=(120, 170, 255),
        sentence="robot {robot} left the bounds",
        limit="at least {limit:.3g} m inside the bounds",
        clearance=lambda limits, radius: limits.bounds_distance,
        members=lambda watched: _list_robots(watched) if watched.has_bounds else [],
        needs="a scene with a numeric bounds (floor_1 to floor_6, corridor, deck, lift)",
        script="list_exits",
        other="",
    ),
    Kind(
        name="obstacle",
        unit="m",
        color=(90, 200, 140),
        sentence="robot {robot} hit {other}",
        limit="obstacles at least {limit:.3g} m away",
        clearance=lambda limits, radius: limits.obstacle_distance,
        members=lambda watched: _list_robots(watched) if watched.has_obstacles else [],
        needs="a scene with solid geoms to run into (corridor, deck, lift)",
        script="list_obstacle_hits",
        other="geom",
    ),
)
KIND_OF = {kind.name: kind for kind in KINDS}  # kinds by name
