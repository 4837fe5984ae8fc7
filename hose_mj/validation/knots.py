"""Trials of ropes that touch themselves: an overhand knot, and a plectoneme."""

import math

import numpy as np
from scipy.spatial.distance import cdist

from hose_mj.checks import Check
from hose_mj.hoses.entanglement import compute_writhe
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import ContactLaw
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec
from hose_mj.validation import reference
from hose_mj.validation.trial import Findings, LinePlot, ShapePlot

RADIUS = 0.002  # of the ropes (m)
BENDING = 1e-3  # EI (N m^2)
_DENSITY = 0.02  # kg/m
_HOLDS_FROM = 0.081
"""Friction with which a knot of 604 radii holds by itself (Audoly, Clauvelin, Neukirch 2007)."""
_TURNS, _SLACK = 14.0, 0.15
"""Turns of the twisted rope's end, and by how much of its length the end comes nearer."""


def make_rope(length: float, torsional_stiffness: float = 0.0) -> HoseSpec:
    """Returns a rope as stiff along it as a solid section."""
    return HoseSpec(
        length=length,
        axial_stiffness=4.0 * BENDING / RADIUS**2,
        bending_stiffness=BENDING,
        torsional_stiffness=torsional_stiffness,
        linear_density=_DENSITY,
        outer_radius=RADIUS,
        damping_time=0.005,
        drag=10.0 * _DENSITY,
    )


def draw_overhand(loop: float, tail: float) -> Array:
    """An open overhand knot along x: places (k, 3), m; radius of its loop and tails in radii.

    The two strands of its braid wind round each other by one turn and a half.
    """
    a, apart = 2.7 * math.sqrt(2.0 * loop), 1.15  # of the braid's half length and half width
    x = np.linspace(-a, a, 400)
    q = (x + a) / (2.0 * a)
    phi = -0.5 * math.pi + 3.0 * math.pi * q**2 * (3.0 - 2.0 * q)
    t = np.linspace(0.0, 2.0 * math.pi, 400)
    first = np.stack([x, apart * np.sin(phi), apart * np.cos(phi)], axis=1)
    along = loop * np.sin(t) + a * (1.0 - t / math.pi)
    turn = np.stack([along, loop * (1.0 - np.cos(t)) + apart, 0.0 * t], axis=1)
    last = first * [1.0, -1.0, -1.0]
    out = np.linspace(0.0, tail, 300)[1:, None] * [1.0, 0.0, 0.0]
    whole = [first[0] - out[::-1], first, turn[1:], last[1:], last[-1] + out]
    return RADIUS * np.concatenate(whole)


class Knot:
    """An overhand knot with its ends held on the x axis, in equilibrium.

    Args:
        loop: radius of its loop at first (radii).
        tail: length of the two tails (radii).
        control_points: of the rope.
        friction: of the rope on itself; equilibria know none.
        timestep: s.

    Attributes:
        hose: the rope.
        end: the hold of its far end.
    """

    def __init__(
        self,
        loop: float,
        tail: float,
        control_points: int,
        friction: float = 0.0,
        timestep: float = 0.002,
    ) -> None:
        shape = draw_overhand(loop, tail)
        spec = make_rope(float(np.linalg.norm(np.diff(shape, axis=0), axis=1).sum()))
        law = ContactLaw(self_contact=True, self_friction=friction)
        self.hose = GedsHose(
            spec,
            timestep=timestep,
            gravity=(0.0, 0.0, 0.0),
            control_points=control_points,
            contact_law=law,
        )
        with self.hose.unwatched():  # the braid is finer than the spline at first
            self.hose.reset(shape)
        self.hose.attach(0.0)
        self.end = self.hose.attach(spec.length)
        with self.hose.unwatched():
            self.hose.solve_static()

    @property
    def shortening(self) -> float:
        """By how much the ends are nearer to each other than the rope is long, e (m)."""
        ends = self.hose.position([0.0, self.hose.spec.length])
        return self.hose.spec.length - float(np.linalg.norm(ends[1] - ends[0]))

    @property
    def height(self) -> float:
        """Of the loop above its crossing (m), however it has turned about the line of its ends."""
        places = self.hose.position(np.linspace(0.0, self.hose.spec.length, 2000))
        across = (places - places[0]) * [0.0, 1.0, 1.0]
        top = across[np.argmax(np.linalg.norm(across, axis=1))]
        return float(np.ptp(across @ top) / np.linalg.norm(top))

    @property
    def least_distance(self) -> float:
        """Of centre lines more than 8 radii of arc apart, in diameters."""
        s = np.linspace(0.0, self.hose.spec.length, 2000)
        places = self.hose.position(s)[400:1600]
        far = np.abs(s[400:1600, None] - s[None, 400:1600]) > 8.0 * RADIUS
        return float(cdist(places, places)[far].min()) / (2.0 * RADIUS)

    def draw(self, shortening: float, n_moves: int) -> Array:
        """Draws the knot tighter by statics.

        Args:
            shortening: to come to (m).
            n_moves: equilibria on the way, their shortenings in geometric progression.

        Returns:
            shortening (m), pull (N) and energy (J) of each, (3, n_moves).
        """
        found = []
        for wanted in np.geomspace(self.shortening, shortening, n_moves + 1)[1:]:
            ends = self.hose.position([0.0, self.hose.spec.length])
            way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            self.hose.move(self.end, ends[1] + (self.shortening - wanted) * way)
            with self.hose.unwatched():  # it slides along the rope: neither stable nor unstable
                self.hose.solve_static()
            pull = float(np.linalg.norm(self.hose.reaction(self.end).force))
            found.append((self.shortening, pull, self.hose.energies().total))
        return np.array(found).T


def measure_opening(friction: float) -> float:
    """By how much a knot of 604 radii opens in 0.4 s, 0.4 s after an end was let go, in radii."""
    knot = Knot(85.0, 340.0, 160, friction, timestep=0.004)
    knot.hose.step(50)
    knot.hose.release(knot.end)
    knot.hose.step(100)  # the tail straightens
    before = knot.shortening
    knot.hose.step(100)
    return (knot.shortening - before) / RADIUS


def measure_knot(is_quick: bool, rng: np.random.Generator) -> Findings:
    """A knot drawn tight against its published curve; with friction it holds by itself, or not."""
    sizes = (700, 500, 300, 150) if is_quick else (700, 600, 500, 400, 300, 250, 200, 150)
    knot = Knot(100.0, 500.0, 192) if is_quick else Knot(100.0, 600.0, 256)
    curve, heights, gaps, apart = [], [], [], []
    for size in sizes:
        e, pull, energy = knot.draw(size * RADIUS, 8)
        scale = 2.0 * math.pi**2 * BENDING
        curve.append((e[-1] / RADIUS, pull[-1] * e[-1] ** 2 / scale))
        middle = 0.5 * (e[-1] + e[-2])
        work = -(energy[-1] - energy[-2]) / (e[-1] - e[-2]) * middle**2 / scale
        gaps.append(work / reference.find_knot_pull(middle / RADIUS) - 1.0)
        apart.append(knot.least_distance)
        heights.append(knot.height / math.sqrt(2.0 * BENDING / pull[-1]) - 1.0)
    size, ratio = np.array(curve).T
    true = np.array([reference.find_knot_pull(e) for e in size])
    tight, loose = measure_opening(1.6 * _HOLDS_FROM), measure_opening(0.6 * _HOLDS_FROM)
    checks = [
        Check("pull of the knot, off the published one", np.abs(ratio / true - 1.0).max(), 0.05),
        Check("what drawing it takes, -dE/de, off that", np.abs(gaps).max(), 0.05),
        Check("height of its loop, off sqrt(2 EI / T)", np.abs(heights).max(), 0.05),
        Check("strands apart (diameters)", min(apart), 0.95, ">="),
        Check("opens with 1.6 of the friction that holds it (radii)", tight, 0.5),
        Check("opens with 0.6 of that (radii)", loose, 3.0, ">="),
    ]
    fine = np.linspace(size.min(), size.max(), 100)
    published = [reference.find_knot_pull(e) for e in fine]
    lines = {"GEDS": (size, ratio), "Audoly, Clauvelin, Neukirch": (fine, published)}
    title = "An overhand knot is drawn tight: pull, T e² / (2 π² EI)"
    plot = LinePlot(title, "pull", lines, {}, "end shortening e (radii of the rope)")
    return Findings(checks, {"knot": plot})


def twist_rope(timestep: float, seconds: float) -> tuple[float, float, float, GedsHose]:
    """Turns a rope's end and brings it nearer, then lets it come to rest.

    Args:
        timestep: s.
        seconds: of turning; rest takes one second more.

    Returns:
        twist and writhe (turns), tension times radius squared over EI, and the rope.
    """
    spec = make_rope(1.0, BENDING / 1.3)
    law = ContactLaw(self_contact=True)
    hose = GedsHose(
        spec, timestep=timestep, gravity=(0.0, 0.0, 0.0), control_points=128, contact_law=law
    )
    small = 1e-3  # a rope that is straight stays straight
    hose.reset(
        lambda s: np.stack(
            [s, small * np.sin(np.pi * s) ** 2, small * np.sin(2.0 * np.pi * s)], axis=1
        )
    )
    hose.clamp(0.0)
    end, n = hose.clamp(1.0), round(seconds / timestep)
    place = hose.position(1.0)[0]
    for k in range(n):
        nearer = np.array([_SLACK * (k + 1) / n, 0.0, 0.0])
        hose.move(end, place - nearer, spin=2.0 * math.pi * _TURNS / n)
        hose.step()
    hose.step(round(1.0 / timestep))
    held = hose.reaction(end)
    twist = held.moment[0] / (2.0 * math.pi * spec.torsional_stiffness)
    writhe = compute_writhe(hose.position(np.linspace(0.0, 1.0, 750)))
    return float(twist), writhe, float(held.force[0]) * RADIUS**2 / BENDING, hose


def measure_plectoneme(is_quick: bool, rng: np.random.Generator) -> Findings:
    """A twisted rope with slack winds round itself; nothing of its turns is lost."""
    lost, moments, crossings, shapes = [], [], 0, {}
    for timestep in (0.002, 0.001):
        twist, writhe, tension, hose = twist_rope(timestep, 1.5 if is_quick else 3.0)
        lost.append((twist + writhe) / _TURNS - 1.0)
        found = twist * 2.0 * math.pi * hose.spec.torsional_stiffness * RADIUS / BENDING
        moments.append(found / reference.find_plectoneme_moment(tension) - 1.0)
        crossings += hose.health.crossings
        shapes[f"steps of {1e3 * timestep:g} ms"] = hose.position(np.linspace(0.0, 1.0, 800))
    checks = [
        Check("twist and writhe, off the turns of the end", np.abs(lost).max(), 1e-3),
        Check("moment at this tension, off the published one", np.abs(moments).max(), 0.05),
        Check("times that a strand was beyond the middle of another", crossings, 0),
    ]
    title = f"A rope of 1 m after {_TURNS:g} turns of its end, 15 % slack"
    return Findings(checks, {"plectoneme": ShapePlot(title, shapes, ())})
