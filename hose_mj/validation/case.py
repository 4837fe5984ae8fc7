"""What a case is, the hoses that cases use, how they are laid and read."""

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from scipy.special import j0

from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array, Hold, HoseModel
from hose_mj.hoses.spec import HoseSpec

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
STIFFENING = 1e3  # EA of the reference for inextensible models, over that of the case
GRAVITY = 9.81
DOWN = (0.0, 0.0, -GRAVITY)  # the gravity of most motions (m/s^2)
WEIGHT = LINEAR_DENSITY * GRAVITY * LENGTH
UNIT_FREQUENCY = math.sqrt(BENDING_STIFFNESS / (LINEAR_DENSITY * LENGTH**4))


@dataclass(frozen=True)
class Motion:
    """The motion of a dynamic case."""

    duration: float  # s
    n_samples: int  # instants, evenly spaced and the last at the end, at which models are compared
    # Moves the holds for the end of a step at time t; None where nothing is moved.
    drive: Callable[[HoseModel, list[Hold], float], None] | None = None

    @property
    def pause(self) -> float:
        """Time between two samples (s)."""
        return self.duration / self.n_samples


@dataclass(frozen=True)
class Reference:
    """The truth of a motion."""

    values: Array  # of the probe (k, q)
    uncertainty: float  # how far two resolutions of it still differ, as a fraction of L


@dataclass(frozen=True)
class Case:
    """One case."""

    id: str  # stable; a parameter stands behind the family's name and a dash
    title: str  # one line
    about: str  # what is done, what is compared, against what
    spec: HoseSpec  # the hose
    # Puts a fresh hose into its initial state and returns its holds.
    lay: Callable[[HoseModel], list[Hold]]
    # What is compared, (q,); for static cases it finds the equilibrium itself.
    probe: Callable[[HoseModel], Array]
    family: str = ""  # the id without its parameter; by default the id
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # (3,) m/s^2
    # Closed form of the probe, (q,); None where the reference is the converged limit.
    truth: Callable[[], Array] | None = None
    # What errors are a fraction of: None for the reference's own value, else a length (m).
    scale: float | None = None
    motion: Motion | None = None  # None for static cases
    clamped: bool = False  # True where one end is clamped, so that a chain's clamp can be corrected
    planar: bool = True  # True where the hose stays in a plane parallel to x and z
    # The models that the case is run with.
    models: tuple[str, ...] = ("geds", "cable", "flex", "hinge-chain")
    # Time steps of GEDS (s), coarse to fine; dynamic cases only.
    steps: tuple[float, ...] = tuple(0.02 / k for k in (2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32))
    # By model, in place of the grid's; static cases only.
    resolutions: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    # Largest error of GEDS by control points, which `compare` checks; by default that of the
    # finest.
    promised: Mapping[int, float] = field(default_factory=dict)
    obstacles: tuple[Obstacle, ...] = ()  # what the hose may touch
    contact_law: ContactLaw | None = None  # of GEDS; None for its defaults
    options: Mapping[str, Any] = field(default_factory=dict)  # of GEDS, beside those
    # Computes the motion's truth where that is not the converged limit of GEDS.
    reference: Callable[[], Reference] | None = None
    uncertainty: float = 1e-4  # how far two resolutions of the reference may differ, of L
    # Error that GEDS keeps with its finest setting; motions only, None for no promise.
    promise: float | None = None
    # False where models do not converge to the same motion, so that costs at equal error mean
    # nothing.
    has_ratios: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "family", self.family or self.id)


@cache
def read_texts() -> dict[str, dict[str, str]]:
    """Reads the words of our cases: `title`, `about`, perhaps `prefix`, by family or id."""
    return tomllib.loads(Path(__file__).with_name("cases.toml").read_text(encoding="utf-8"))


def make_case(family: str, parameter: str = "", **facts: Any) -> Case:
    """Makes one of the cases whose words stand in cases.toml, under its id or its family.

    Args:
        family: of the case.
        parameter: stands behind the family in its id, and in its title; "" where it is alone.
        facts: what else makes a `Case`.
    """
    texts = read_texts()
    text = texts.get(f"{family}-{parameter}") or texts[family]
    id = f"{family}-{text.get('prefix', '')}{parameter}" if parameter else family
    title = text["title"].format(parameter)
    return Case(id=id, title=title, about=text["about"], family=family, **facts)


def lay_straight(hose: HoseModel) -> None:
    """Lays a hose along x from the origin."""
    hose.reset([[0.0, 0.0, 0.0], [hose.spec.length, 0.0, 0.0]])


def lay_cantilever(hose: HoseModel) -> list[Hold]:
    """A straight hose clamped at the origin."""
    lay_straight(hose)
    return [hose.clamp(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))]


def lay_free(hose: HoseModel) -> list[Hold]:
    """A straight hose that nothing holds."""
    lay_straight(hose)
    return []


def lay_pinned(hose: HoseModel) -> list[Hold]:
    """A straight hose attached at the origin."""
    lay_straight(hose)
    return [hose.attach(0.0, (0.0, 0.0, 0.0))]


def read_tip(hose: HoseModel) -> Array:
    """Returns the place of the far end (3,), m."""
    return np.asarray(hose.position(hose.spec.length)[0])


def read_places(
    shares: Sequence[float] | Array, length: float = LENGTH
) -> Callable[[HoseModel], Array]:
    """Returns a probe of the places at these shares of the length (m), (3 k,)."""
    return lambda hose: np.asarray(hose.position(np.array(shares) * length).ravel())


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


def lay_between(hose: HoseModel, span: float) -> list[Hold]:
    """Lets a hose sag between two attachments of one height."""
    curve = _sag(span / LENGTH)
    hose.reset(lambda s: LENGTH * curve(s / LENGTH))
    return [hose.attach(0.0, (0.0, 0.0, 0.0)), hose.attach(hose.spec.length, (span, 0.0, 0.0))]
