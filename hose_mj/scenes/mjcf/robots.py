"""The sites that a scene's conventions name, and the robots in their order along the hose."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hose_mj.errors import InputError
from hose_mj.scenes.mjcf.files import shorten

SITE = "site"
SOURCE = "hose_source"
ATTACH = "hose_attach"
ORDER = "hose_robots"
"""Name of the tuple of sites that gives the robots' order, where names do not."""
_SEPARATORS = "/_.-"
_NUMBER = re.compile(r"\d{1,6}(?=\D*\Z)", re.ASCII)


@dataclass(frozen=True)
class Place:
    """A site.

    Attributes:
        site: its name.
        body: the name of its body.
        position: where it is at the start (m).
        moves: whether its body can move.
    """

    site: str
    body: str
    position: tuple[float, float, float]
    moves: bool


@dataclass(frozen=True)
class Robot(Place):
    """A robot, by the site where it holds the hose.

    Attributes:
        name: the prefix of its site ("robot0"), or its body's name where there is none.
        arc_length: where it holds the hose, from the source (m).
    """

    name: str
    arc_length: float


def find_one(places: Sequence[Place], name: str, file: str) -> Place:
    """Returns the one site of a name, with any prefix.

    Raises:
        InputError: none or several.
    """
    found = [place for place in places if _split(place.site, name) is not None]
    if len(found) != 1:
        valid = f"one <site name='{name}'/>, a prefix such as 'arena/' allowed"
        raise InputError(f"{file}: sites {name}", [shorten(p.site) for p in found[:8]], valid)
    return found[0]


def find_robots(
    places: Sequence[Place],
    tuples: Mapping[str, Sequence[str]],
    attachments: Sequence[float] | None,
    length: float,
    file: str,
) -> tuple[Robot, ...]:
    """Returns the robots, the tip's first.

    The order is that of the sites in the tuple `hose_robots` where the scene has it. Otherwise each
    robot's number is the last number in the prefix of its site or, without one, in its body's name,
    and the numbers are 0 to N - 1; a single robot needs none. Robot i holds the hose at
    L (N - i) / N from the source, so that the segments are equal, or at the i-th of `attachments`.

    Raises:
        InputError: no robots, a robot that cannot move or has two sites, numbers that are not
            0 to N - 1, attachments that do not fall from the tip to the source.
    """
    found = {p.site: p for p in places if _split(p.site, ATTACH) is not None}
    if not found:
        valid = f"one in each robot's body, <site name='{ATTACH}'/>, prefixes allowed"
        raise InputError(f"{file}: sites {ATTACH}", None, valid)
    bodies: dict[str, str] = {}
    for place in found.values():
        thing = f"{file}: site {shorten(place.site)}"
        if not place.moves:
            raise InputError(thing, shorten(place.body), "in a body that joints let move")
        if place.body and place.body in bodies:
            valid = f"one in a body; {shorten(bodies[place.body])} is in this one too"
            raise InputError(thing, shorten(place.body), valid)
        bodies[place.body] = place.site
    order = tuples.get(ORDER)
    ordered = _order_by_number(found, file) if order is None else _order_by(order, found, file)
    arcs = _check_attachments(attachments, len(ordered), length, file)
    return tuple(
        Robot(p.site, p.body, p.position, p.moves, _split(p.site, ATTACH) or p.body, arc)
        for p, arc in zip(ordered, arcs, strict=True)
    )


def _split(site: str, name: str) -> str | None:
    """The prefix of a site without its separator; None for a site of another name."""
    prefix = site.removesuffix(name)
    if prefix == site or (prefix and prefix[-1] not in _SEPARATORS):
        return None
    return prefix[:-1]


def _order_by(order: Sequence[str], found: Mapping[str, Place], file: str) -> list[Place]:
    if sorted(order) != sorted(found):
        valid = "each of the sites " + ", ".join(map(shorten, found)) + " once"
        raise InputError(f"{file}: tuple {ORDER}", [shorten(s) for s in order[:8]], valid[:500])
    return [found[site] for site in order]


def _order_by_number(found: Mapping[str, Place], file: str) -> list[Place]:
    if len(found) == 1:
        return list(found.values())
    numbered: dict[int, Place] = {}
    for place in found.values():
        match = _NUMBER.search(_split(place.site, ATTACH) or place.body)
        number = int(match.group()) if match else None
        if number is None or number >= len(found) or number in numbered:
            thing = f"{file}: number of the robot with site {shorten(place.site)}"
            valid = f"each of 0 (tip) to {len(found) - 1} (next to the source) once, or a tuple"
            raise InputError(thing, number, f"{valid} {ORDER}")
        numbered[number] = place
    return [numbered[i] for i in range(len(found))]


def _check_attachments(
    given: Sequence[float] | None, n: int, length: float, file: str
) -> tuple[float, ...]:
    if given is None:
        return tuple(length * ((n - i) / n) for i in range(n))
    ends = (*given, 0.0)
    falls = all(a > b for a, b in pairwise(ends))
    if len(given) != n or not falls or given[0] > length:
        valid = f"{n} numbers, the tip's first, falling, above 0 and at most {length:g} (m)"
        raise InputError(f"{file}: numeric hose_attachments", tuple(given[:8]), valid)
    return tuple(given)
