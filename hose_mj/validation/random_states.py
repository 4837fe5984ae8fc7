"""Random states and loads, wilder than any use: what the solver does with them."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hose_mj.errors import HoseWarning, StepError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.obstacles import ContactLaw, Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.hoses.spec import HoseSpec

N_STEPS = 3  # steps taken from each state


@dataclass
class Tally:
    """Counts of the ways in which random states ended."""

    not_finite: int = 0  # a position or velocity that is not finite
    verdicts: int = 0  # a StepError
    touched: int = 0  # a StepError after which the state was not the one before the failing step


def make_random_hose(rng: np.random.Generator) -> GedsHose:
    """Returns a hose of random stiffness, shape, holds and loads.

    Shapes: control points displaced by up to 2 L, four of them coincident, the polygon folded back
    onto itself by 180 degrees, or a small disturbance. EA L^2 / EI from 1e2 to 1e8, time steps from
    1e-4 to 2e-2 s, two forces of up to 100 weights; half of the hoses among obstacles. In space
    half of the hoses that are clamped are clamped at both ends and spun by up to a turn, and a
    third are ribbons that are curved at rest.
    """
    stiffness = 0.05
    n = int(rng.choice([6, 8, 12, 16, 24]))
    plane = None if rng.random() < 0.5 else "xz"
    is_ribbon = plane is None and rng.random() < 0.3
    spec = HoseSpec(
        length=1.0,
        axial_stiffness=float(10.0 ** rng.uniform(2.0, 8.0)) * stiffness,
        bending_stiffness=stiffness,
        second_bending_stiffness=20.0 * stiffness if is_ribbon else None,
        torsional_stiffness=0.8 * stiffness,
        rest_curvature=float(rng.uniform(-5.0, 5.0)) if is_ribbon else 0.0,
        linear_density=0.1,
        damping_time=float(rng.choice([0.0, 0.0, 0.01])),
    )
    hose = GedsHose(
        spec,
        timestep=float(10.0 ** rng.uniform(-4.0, np.log10(0.02))),
        control_points=n,
        plane=plane,
        scheme=str(rng.choice(["bdf2", "backward-euler"])),
    )
    hose.set_control_points(_draw_polygon(hose.control_points, plane, rng))
    if rng.random() < 0.5:
        hose.clamp(0.0, tangent=_turn_ahead(hose, 0.0, np.array([1.0, 0.0, 0.0])))
        if plane is None and rng.random() < 0.5:
            aim = _turn_ahead(hose, spec.length, rng.normal(size=3))
            far = hose.clamp(spec.length, tangent=aim)
            hose.move(far, spin=float(rng.uniform(-2.0, 2.0) * np.pi))
    if rng.random() < 0.5:
        hose.attach(float(rng.uniform(0.2, 1.0)))
    for _ in range(2):
        force = rng.normal(size=3)
        force[1] *= plane is None
        force *= rng.uniform(0.0, 100.0) * spec.mass * 9.81 / np.linalg.norm(force)
        hose.apply_force(float(rng.uniform(0.0, 1.0)), force)
    if rng.random() < 0.5:
        set_random_obstacles(hose, rng)
    return hose


def set_random_obstacles(hose: GedsHose, rng: np.random.Generator) -> None:
    """Puts a floor and one shape of each kind where a hose is: often it starts deep inside them."""
    height = float(rng.uniform(-0.5, 0.2))
    obstacles = [Obstacle(kind="plane", position=(0.0, 0.0, height))]
    for kind in ("sphere", "capsule", "cylinder", "box"):
        place, size = rng.uniform(-1.0, 1.0, 3), rng.uniform(0.05, 0.3, 3)
        friction = float(rng.uniform(0.0, 2.0))
        obstacles.append(Obstacle(kind=kind, position=place, size=size, friction=friction))
    stiffness = float(10.0 ** rng.uniform(3.0, 6.0))
    stick = float(10.0 ** rng.uniform(2.0, 6.0))
    self_contact = bool(rng.random() < 0.5)
    law = ContactLaw(stiffness=stiffness, stick_stiffness=stick, self_contact=self_contact)
    hose.set_obstacles(obstacles, law)


def _turn_ahead(hose: GedsHose, arc_length: float, aim: Array) -> Array:
    """The vector (3,) or its opposite, whichever is within 90 degrees of the hose's tangent."""
    return -aim if aim @ hose.tangent(arc_length)[0] < 0.0 else aim


def _draw_polygon(polygon: Array, plane: str | None, rng: np.random.Generator) -> Array:
    """A wild control polygon made of a straight one, (n, 3)."""
    n = len(polygon)
    kind = rng.integers(4)
    noise = rng.uniform(-1.0, 1.0, size=polygon.shape)
    noise[:, 1] *= plane is None
    if kind == 0:
        return polygon + rng.uniform(0.0, 2.0) * noise
    if kind == 1:
        first = int(rng.integers(0, n - 3))
        polygon[first : first + 4] = polygon[first]
    elif kind == 2:
        fold = int(rng.integers(1, n - 1))
        polygon[fold:] = 2.0 * polygon[fold] - polygon[fold:]
    else:
        polygon += 0.02 * noise
    return polygon


def run_random_states(
    n_states: int, rng: np.random.Generator, advance: Callable[[int], None]
) -> Tally:
    """Takes N_STEPS steps from each of n_states random states and counts how they end.

    What is odd about them is not said: they are odd on purpose.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HoseWarning)
        return _run_random_states(n_states, rng, advance)


def _run_random_states(
    n_states: int, rng: np.random.Generator, advance: Callable[[int], None]
) -> Tally:
    tally = Tally()
    for k in range(n_states):
        hose = make_random_hose(rng)
        before = hose.control_points
        try:
            for _ in range(N_STEPS):
                before = hose.control_points
                hose.step()
        except StepError:
            tally.verdicts += 1
            tally.touched += not np.array_equal(before, hose.control_points)
        everything = np.concatenate([hose.control_points.ravel(), hose.control_velocities.ravel()])
        tally.not_finite += not np.all(np.isfinite(everything))
        if k % 200 == 199:
            advance(200)
    return tally
