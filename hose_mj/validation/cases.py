"""The cases of `hose-mj compare`, as data: a hose, what is done to it, what is read off, the truth.

A case is `static` (an equilibrium, frequencies or a critical load, compared with a closed form) or
`dynamic` (a motion, compared with its converged limit). Add one by adding a record to `CASES`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from weakref import WeakKeyDictionary

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.special import j0

from hose_mj.errors import InputError
from hose_mj.hoses.model import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.modes import compute_critical_load, compute_frequencies

LENGTH = 1.0
BENDING_STIFFNESS = 0.05
LINEAR_DENSITY = 0.1
STOUT = HoseSpec(
    length=LENGTH,
    axial_stiffness=4e7 * BENDING_STIFFNESS,
    bending_stiffness=BENDING_STIFFNESS,
    torsional_stiffness=BENDING_STIFFNESS / 1.3,
    linear_density=LINEAR_DENSITY,
)
"""The hose of the closed forms: EA L^2 / EI = 4e7, as good as inextensible."""
ROD = replace(STOUT, axial_stiffness=4e5 * BENDING_STIFFNESS)
"""The hose of the motions: EA L^2 / EI = 4e5."""
CHAIN = replace(STOUT, axial_stiffness=1e5, bending_stiffness=1e-7, torsional_stiffness=1e-2)
"""A chain: EI / (w L^3) = 1e-7."""
STIFFENING = 1e3
"""EA of the reference for inextensible models, over that of the case."""
GRAVITY = 9.81
_WEIGHT = LINEAR_DENSITY * GRAVITY * LENGTH
_UNIT_FREQUENCY = math.sqrt(BENDING_STIFFNESS / (LINEAR_DENSITY * LENGTH**4))


@dataclass(frozen=True)
class Motion:
    """How a dynamic case moves.

    Attributes:
        duration: s.
        n_samples: instants, evenly spaced and the last at the end, at which models are compared.
        drive: moves the holds for the end of a step at time t; None where nothing is moved.
    """

    duration: float
    n_samples: int
    drive: Callable[[HoseModel, list[Hold], float], None] | None = None


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes:
        id: stable; a parameter stands behind the family's name and a dash.
        family: the id without its parameter.
        title: one line.
        about: what is done, what is compared, against what.
        spec: the hose.
        gravity: (3,) m/s^2.
        lay: puts a fresh hose into its initial state and returns its holds.
        probe: what is compared, (q,); for static cases it finds the equilibrium itself.
        truth: closed form of the probe, (q,); None where the reference is the converged limit.
        scale: what errors are a fraction of: None for the reference's own value, else a length (m).
        motion: None for static cases.
        clamped: True where one end is clamped, so that a chain's clamp can be corrected.
        models: the models that the case is run with.
        steps: time steps of GEDS (s), coarse to fine; dynamic cases only.
    """

    id: str
    family: str
    title: str
    about: str
    spec: HoseSpec
    gravity: tuple[float, float, float]
    lay: Callable[[HoseModel], list[Hold]]
    probe: Callable[[HoseModel], Array]
    truth: Callable[[], Array] | None = None
    scale: float | None = None
    motion: Motion | None = None
    clamped: bool = False
    models: tuple[str, ...] = ("geds", "cable", "hinge-chain")
    steps: tuple[float, ...] = tuple(0.02 / k for k in (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32))


def _straight(hose: HoseModel) -> None:
    hose.reset([[0.0, 0.0, 0.0], [hose.spec.length, 0.0, 0.0]])


def _lay_cantilever(hose: HoseModel) -> list[Hold]:
    _straight(hose)
    return [hose.clamp(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))]


def _lay_free(hose: HoseModel) -> list[Hold]:
    _straight(hose)
    return []


def _lay_pinned(hose: HoseModel) -> list[Hold]:
    _straight(hose)
    return [hose.attach(0.0, (0.0, 0.0, 0.0))]


def _tip(hose: HoseModel) -> Array:
    return np.asarray(hose.position(hose.spec.length)[0])


def _heavy_cantilever(gamma: float) -> Case:
    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        x, _, z = _tip(hose)
        return np.array([-z / x])

    return Case(
        id=f"heavy-cantilever-gamma-{gamma:g}",
        family="heavy-cantilever",
        title=f"Heavy cantilever, Gamma = {gamma:g}",
        about="A horizontal cantilever sags under its own weight, Gamma = rho A g L^3 / EI. "
        "Compared: drop of the tip over its distance from the wall, with the elastica.",
        spec=STOUT,
        gravity=(0.0, 0.0, -gamma * BENDING_STIFFNESS / (LINEAR_DENSITY * LENGTH**3)),
        lay=_lay_cantilever,
        probe=probe,
        truth=lambda: np.array([reference.heavy_cantilever(gamma)]),
        clamped=True,
    )


def _tip_load(alpha: float) -> Case:
    def probe(hose: HoseModel) -> Array:
        hose.apply_force(LENGTH, (0.0, 0.0, -alpha * BENDING_STIFFNESS / LENGTH**2))
        hose.solve_static()
        x, _, z = _tip(hose)
        return np.array([LENGTH - x, -z])

    return Case(
        id=f"tip-load-{alpha:g}",
        family="tip-load",
        title=f"Cantilever with a tip load, P L^2 / EI = {alpha:g}",
        about="A weightless cantilever carries a transverse load at its tip. Compared: axial and "
        "transverse displacement of the tip, with the elastica.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=_lay_cantilever,
        probe=probe,
        truth=lambda: np.array(reference.tip_load(alpha)) * LENGTH,
        clamped=True,
    )


def _end_moment(turn: float, name: str) -> Case:
    def probe(hose: HoseModel) -> Array:
        hose.apply_moment(LENGTH, (0.0, turn * BENDING_STIFFNESS / LENGTH, 0.0))
        hose.solve_static()
        x, _, z = _tip(hose)
        return np.array([x, -z])

    return Case(
        id=f"end-moment-{name}",
        family="end-moment",
        title=f"Cantilever rolled up by an end moment, M L / EI = {name}",
        about="A moment at the tip bends a weightless cantilever into an arc of a circle, closed "
        "at 2 pi. Compared: the place of the tip, as a fraction of the length.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=_lay_cantilever,
        probe=probe,
        truth=lambda: np.array(reference.end_moment(turn)) * LENGTH,
        scale=LENGTH,
        clamped=True,
    )


def _frequencies(ends: str) -> Case:
    def lay(hose: HoseModel) -> list[Hold]:
        if ends == "free-free":
            return _lay_free(hose)
        holds = _lay_cantilever(hose)
        if ends == "clamped-pinned":
            holds.append(hose.attach(LENGTH, (LENGTH, 0.0, 0.0)))
        return holds

    def probe(hose: HoseModel) -> Array:
        found = compute_frequencies(hose.linearize(), 3, above=0.1 * _UNIT_FREQUENCY)
        return np.asarray(found / _UNIT_FREQUENCY)

    return Case(
        id=f"frequencies-{ends}",
        family="frequencies",
        title=f"First three bending frequencies, {ends}",
        about="Small vibrations of a straight weightless hose. Compared: omega in units of "
        "sqrt(EI / (rho A L^4)), with Euler and Bernoulli's beam.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        truth=lambda: reference.beam_frequencies(ends),
        clamped=ends != "free-free",
    )


def _hanging_chain() -> Case:
    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, 0.0], [0.0, 0.0, -LENGTH]])
        return [hose.attach(0.0, (0.0, 0.0, 0.0))]

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        unit = math.sqrt(GRAVITY / LENGTH)
        return np.asarray(compute_frequencies(hose.linearize(), 3, above=0.1 * unit) / unit)

    return Case(
        id="hanging-chain",
        family="hanging-chain",
        title="First three frequencies of a hanging chain",
        about="Small swings of a chain hung at one end. Compared: omega sqrt(L / g), with half the "
        "zeros of the Bessel function J0.",
        spec=CHAIN,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        truth=reference.chain_frequencies,
    )


@cache
def _sag(chord: float) -> CubicSpline:
    """A planar curve of length 1 between two points `chord` apart, by arc length.

    Its angle is -a cos(pi s): no curvature at the ends, where a hinge has no moment, and the chord
    is the Bessel function J0(a).
    """
    a = brentq(lambda a: j0(a) - chord, 1e-6, 2.4)
    s = np.linspace(0.0, 1.0, 401)
    angle = -a * np.cos(np.pi * s)
    slope = CubicSpline(s, np.stack([np.cos(angle), 0.0 * s, np.sin(angle)], axis=1))
    return slope.antiderivative()


def _lay_between(hose: HoseModel, span: float) -> list[Hold]:
    """Lets a hose sag between two attachments of one height."""
    curve = _sag(span / LENGTH)
    hose.reset(lambda s: LENGTH * curve(s / LENGTH))
    return [
        hose.attach(0.0, (0.0, 0.0, 0.0)),
        hose.attach(hose.spec.length, (span, 0.0, 0.0)),
    ]


def _catenary() -> Case:
    ratio = 1.5
    supports: WeakKeyDictionary[HoseModel, Hold] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        holds = _lay_between(hose, LENGTH / ratio)
        supports[hose] = holds[0]
        return holds

    def probe(hose: HoseModel) -> Array:
        hose.solve_static()
        sag = -hose.position(0.5 * LENGTH)[0, 2]
        pull = np.linalg.norm(hose.reaction(supports[hose]).force)
        return np.array([sag / LENGTH, pull / _WEIGHT])

    return Case(
        id="catenary",
        family="catenary",
        title="Catenary, length 1.5 times the span",
        about="A chain hangs between two points of one height. Compared: sag over length and pull "
        "on a support over weight, with the catenary.",
        spec=CHAIN,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        truth=lambda: np.array(reference.catenary(ratio)),
    )


def _euler_buckling(ends: str) -> Case:
    unit = BENDING_STIFFNESS / LENGTH**2

    def probe(hose: HoseModel) -> Array:
        unloaded = hose.linearize()
        hose.apply_force(LENGTH, (unit, 0.0, 0.0))
        hose.solve_static()
        above = 0.1 * _UNIT_FREQUENCY
        return np.array([compute_critical_load(unloaded, hose.linearize(), unit, above) / unit])

    return Case(
        id=f"euler-buckling-{ends}",
        family="euler-buckling",
        title=f"Euler's critical thrust, {ends}",
        about="The thrust under which the straight state loses its stability, from the eigenvalues "
        "of the tangent stiffness, unloaded and under a pull. Compared: P L^2 / EI. Pinned: one "
        "end attached, the thrust on the other keeps its direction; load and shape are the pinned "
        "column's.",
        spec=STOUT,
        gravity=(0.0, 0.0, 0.0),
        lay=_lay_cantilever if ends == "clamped-free" else _lay_pinned,
        probe=probe,
        truth=lambda: np.array([reference.euler_load(ends)]),
        clamped=ends == "clamped-free",
    )


def _released_rod() -> Case:
    return Case(
        id="released-rod",
        family="released-rod",
        title="Released rod: a horizontal cantilever let go",
        about="A straight horizontal cantilever is let go and swings for a second under gravity. "
        "Compared: the place of the tip, largest distance over the second.",
        spec=ROD,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=_lay_cantilever,
        probe=_tip,
        scale=LENGTH,
        motion=Motion(1.0, 50),
        clamped=True,
    )


def _free_flight() -> Case:
    def flex(s: Array) -> Array:
        """Symmetric, zero at both ends, without moment and shear there: f'' = s^2 (1 - s)^2."""
        return s**4 / 12.0 - s**5 / 10.0 + s**6 / 30.0 - s / 60.0

    def speed(s: Array) -> Array:
        u = s / LENGTH
        return np.stack([0.5 + 0.0 * u, 0.0 * u, 4.0 * (0.5 - u) + 300.0 * flex(u)], axis=1)

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset([[0.0, 0.0, 0.0], [LENGTH, 0.0, 0.0]], speed)
        return []

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.0, 0.5, 1.0]) * LENGTH).ravel())

    return Case(
        id="free-flight",
        family="free-flight",
        title="Free flight: a straight hose thrown spinning and flexing, without gravity",
        about="A straight hose is thrown at .5 m/s with a spin of 4 rad/s and a smooth flexing "
        "motion on top. Compared: the places of both ends and the middle.",
        spec=ROD,
        gravity=(0.0, 0.0, 0.0),
        lay=lay,
        probe=probe,
        scale=LENGTH,
        motion=Motion(1.0, 50),
    )


def _taut_pull() -> Case:
    slack, taut, ramp = 0.8 * LENGTH, 0.995 * LENGTH, 0.6

    def lay(hose: HoseModel) -> list[Hold]:
        return _lay_between(hose, slack)

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        along = 0.5 - 0.5 * math.cos(math.pi * min(time / ramp, 1.0))
        hose.move(holds[1], (slack + (taut - slack) * along, 0.0, 0.0))

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.25, 0.5, 0.75]) * LENGTH).ravel())

    return Case(
        id="taut-pull-hose",
        family="taut-pull",
        title="Taut pull: two ends moved apart until the hose is taut, then held",
        about="A sagging hose is let go between two attachments; one is drawn away from .8 to "
        ".995 L within a second and held for another. Compared: the places of the quarter points.",
        spec=replace(ROD, damping_time=0.01),
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        scale=LENGTH,
        motion=Motion(1.0, 50, drive),
    )


def _suture_pull() -> Case:
    length = 0.1
    spec = HoseSpec.from_material(
        length=length,
        youngs_modulus=750e6,
        poisson_ratio=0.4,
        density=1100.0,
        outer_radius=0.2e-3,
        damping_time=2e-3,
    )
    slack, pull, ramp = 0.098, 0.0105, 0.3
    starts: WeakKeyDictionary[HoseModel, Array] = WeakKeyDictionary()

    def lay(hose: HoseModel) -> list[Hold]:
        hose.reset(
            lambda s: np.stack(
                [s / length * slack, 0.0 * s, -0.0125 * np.sin(math.pi * s / length)], axis=1
            )
        )
        ends = [hose.attach(0.0, (0.0, 0.0, 0.0)), hose.attach(length, (slack, 0.0, 0.0))]
        hose.solve_static()
        starts[hose] = hose.position(0.5 * length)[0].copy()
        return [*ends, hose.attach(0.5 * length)]

    def drive(hose: HoseModel, holds: list[Hold], time: float) -> None:
        along = 0.5 - 0.5 * math.cos(math.pi * min(time / ramp, 1.0))
        aim = np.array([0.5 * slack, 0.0, pull])
        hose.move(holds[2], starts[hose] + (aim - starts[hose]) * along)

    def probe(hose: HoseModel) -> Array:
        return np.asarray(hose.position(np.array([0.25, 0.75]) * length).ravel())

    return Case(
        id="taut-pull-suture",
        family="taut-pull",
        title="Taut pull: a suture thread drawn sideways at its middle",
        about="10 cm of thread, radius .2 mm, E = 750 MPa, both ends held 98 mm apart; its middle "
        "is drawn sideways until taut, then held. Compared: the places of the quarter points.",
        spec=spec,
        gravity=(0.0, 0.0, -GRAVITY),
        lay=lay,
        probe=probe,
        scale=length,
        motion=Motion(0.5, 25, drive),
        models=("geds",),
        steps=(0.002, 0.001, 0.0005, 0.00025),
    )


CASES: tuple[Case, ...] = (
    *(_heavy_cantilever(gamma) for gamma in (0.1, 1.0, 3.0, 10.0, 30.0, 100.0)),
    *(_tip_load(alpha) for alpha in (1.0, 2.0, 5.0, 10.0)),
    _end_moment(math.pi, "pi"),
    _end_moment(2.0 * math.pi, "2pi"),
    *(_frequencies(ends) for ends in ("clamped-free", "free-free", "clamped-pinned")),
    _hanging_chain(),
    _catenary(),
    *(_euler_buckling(ends) for ends in ("clamped-free", "pinned")),
    _free_flight(),
    _released_rod(),
    _taut_pull(),
    _suture_pull(),
)


def find_cases(ids: tuple[str, ...]) -> tuple[Case, ...]:
    """Returns the cases of these ids, in the order of `CASES`; a family's name selects all of it.

    Raises:
        InputError: an id that is neither a case nor a family.
    """
    for name in ids:
        if not any(name in (case.id, case.family) for case in CASES):
            families = list(dict.fromkeys(case.family for case in CASES))
            raise InputError("case", name, f"{', '.join(families)}, or one with its parameter")
    return tuple(case for case in CASES if not ids or {case.id, case.family} & set(ids))
