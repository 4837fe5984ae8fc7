"""What GEDS promises of its own numerics, measured: orders, conserved quantities, twist, cost.

Each function returns checks; together they are the part of `hose-mj compare` that needs no peer.
One more measures the softness that is left in the edges of MuJoCo's flex rod.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hose_mj.checks import Check
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.mujoco.flex import FlexHose
from hose_mj.hoses.protocol import Array, Hold
from hose_mj.validation import motions, random_states, reference, statics
from hose_mj.validation.case import LENGTH, ROD, STOUT, Case, lay_straight
from hose_mj.validation.modes import compute_frequencies
from hose_mj.validation.run import simulate
from hose_mj.validation.settings import Setting

Curves = dict[str, tuple[list[float], list[float]]]  # label -> (x, error) of a convergence plot
Kind = tuple[str | None, int]
"""A plane or a form of twist, and control points: what steps are timed by."""
FORMS = ("scalar", "theta")  # the two ways in which GEDS carries twist
FLEX_CASE = "released-rod"
FLEX_SEGMENTS = 20
FLEX_STEPS = (0.004, 0.002, 0.001)
"""Time steps (s) of the flex rod; its default edges have a time constant of two steps."""
_SETTLING = 20  # turns after which a precessing rod has settled


def measure_order(sizes: list[float], errors: list[float]) -> float:
    """Slope of log(error) over log(size), least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def check_frequency_order() -> tuple[list[Check], Curves]:
    """Order of the first three frequencies in the span length, worst of three kinds of ends.

    Bending of a straight hose knows nothing of EA; the smaller one leaves less rounding error.
    """
    unit = np.sqrt(ROD.bending_stiffness / (ROD.linear_density * ROD.length**4))
    points = (8, 10, 12, 16, 20)
    spans = [ROD.length / (n - 3) for n in points]
    orders: list[float] = []
    curves: Curves = {}
    for ends in ("clamped-free", "free-free", "clamped-pinned"):
        case = replace(statics.make_frequencies(ends), spec=ROD)
        truth = reference.beam_frequencies(ends)
        errors = []
        for n in points:
            hose = Setting("geds", "statics, planar", n).make(case)
            case.lay(hose)
            found = compute_frequencies(hose.linearize(), 3, above=0.1 * float(unit)) / unit
            errors.append(np.abs(found / truth - 1.0))
        for mode in range(3):
            column = [float(row[mode]) for row in errors]
            orders.append(measure_order(spans, column))
            curves[f"{ends}, mode {mode + 1}"] = (spans, column)
    return [Check("order of convergence in the frequencies", min(orders), 4.0, ">=")], curves


def check_swing_order() -> tuple[list[Check], Curves]:
    """Order of the released rod's tip in the span length, at one fine time step."""
    case = motions.make_released_rod()
    step = 0.02 / 128

    def swing(n: int) -> Array:
        setting = Setting("geds", "bdf2, planar", n, None, step)
        return simulate(case, setting.make(case, tolerance=1e-6))[1]

    limit = swing(72)
    points = (8, 10, 12, 16, 20, 24)
    spans = [case.spec.length / (n - 3) for n in points]
    errors = [float(np.max(np.linalg.norm(swing(n) - limit, axis=1))) for n in points]
    order = measure_order(spans, errors)
    name = "order of convergence in the swing"
    return [Check(name, order, 3.0, ">=")], {"released rod, tip": (spans, errors)}


def check_time_order() -> tuple[list[Check], Curves]:
    """Order in the time step of every implicit scheme, on a released rod that starts smoothly."""
    case = motions.make_taut_pull()
    assert case.motion is not None
    case = replace(case, motion=replace(case.motion, duration=0.4, n_samples=10, drive=None))
    steps = [0.004 / 2**k for k in range(4)]

    def move(scheme: str, step: float) -> Array:
        setting = Setting("geds", f"{scheme}, planar", 12, None, step)
        return simulate(case, setting.make(case, tolerance=1e-9))[1]

    limit = (4.0 * move("sdirk2", steps[-1] / 16) - move("sdirk2", steps[-1] / 8)) / 3.0
    checks, curves = [], {}
    for scheme in ("bdf2", "sdirk2", "midpoint", "backward-euler"):
        errors = [float(np.max(np.abs(move(scheme, step) - limit))) for step in steps]
        order = measure_order(steps, errors)
        least = 0.9 if scheme == "backward-euler" else 1.9
        checks.append(Check(f"order of convergence in the time step, {scheme}", order, least, ">="))
        curves[scheme] = (steps, errors)
    return checks, curves


def check_momenta() -> list[Check]:
    """Linear and angular momentum of the free flight in every scheme."""
    case = motions.make_free_flight()
    assert case.motion is not None
    checks = []
    for scheme in ("bdf2", "backward-euler", "sdirk2", "midpoint", "verlet"):
        steps = [2e-5] if scheme == "verlet" else [0.0025, 0.00125, 0.000625]
        angular = []
        for step in steps:
            options: dict[str, Any] = {"scheme": scheme, "tolerance": 1e-12, "max_iterations": 50}
            options |= {"timestep": step, "gravity": case.gravity, "control_points": 12}
            hose = GedsHose(case.spec, **options)
            case.lay(hose)
            before = hose.momentum()
            hose.step(round(0.5 / step))
            after = hose.momentum()
            linear = np.linalg.norm(after.linear - before.linear) / np.linalg.norm(before.linear)
            turn = np.linalg.norm(after.angular - before.angular) / np.linalg.norm(before.angular)
            angular.append(float(turn))
        checks.append(Check(f"drift of linear momentum, {scheme}", float(linear), 1e-9))
        name = f"drift of angular momentum, {scheme}"
        if scheme in ("midpoint", "verlet"):
            checks.append(Check(name, angular[-1], 1e-9))
        else:
            least = 0.9 if scheme == "backward-euler" else 1.9
            checks.append(Check(f"order of the {name}", measure_order(steps, angular), least, ">="))
    return checks


def check_energy() -> tuple[list[Check], tuple[list[float], list[float]]]:
    """Energy of the released rod over ten seconds at 5 ms with BDF2, against its start."""
    case = motions.make_released_rod()
    hose = GedsHose(case.spec, timestep=0.005, gravity=case.gravity, control_points=12)
    case.lay(hose)
    # The start, measured from the lowest state there is: hanging straight down.
    lowest = -0.5 * hose.spec.mass * 9.81 * hose.spec.length
    scale = hose.energies().total - lowest
    times, energies = [0.0], [1.0]
    for _ in range(500):
        hose.step(4)
        times.append(hose.time)
        energies.append((hose.energies().total - lowest) / scale)
    gain = max(energies) - 1.0
    name = "largest gain of energy over its start, released rod, BDF2, 10 s at 5 ms"
    return [Check(name, gain, 1e-3)], (times, energies)


def check_cost() -> tuple[list[Check], Curves]:
    """Cost of a step over the number of control points, in a plane and in space."""
    points = (16, 32, 64, 128, 256)
    sizes = [float(n) for n in points]
    hoses: dict[Kind, GedsHose] = {}
    for plane in (None, "xz"):
        for n in points:  # released rods, warmed up; one Newton iteration a step at this time step
            hose = hoses[plane, n] = GedsHose(ROD, timestep=2e-4, control_points=n, plane=plane)
            hose.clamp(0.0)
            hose.step(50)
    least = _time_steps(hoses, rounds=7)
    checks: list[Check] = []
    curves: Curves = {}
    for plane, name in ((None, "in space"), ("xz", "in a plane")):
        walls = [least[plane, n] for n in points]
        exponent = measure_order(sizes, walls)
        checks.append(Check(f"exponent of the cost in control points, {name}", exponent, 1.1))
        curves[f"geds {name}"] = (sizes, walls)
    ratio = least["xz", 16] / least[None, 16]
    checks.append(Check("cost of a planar step over a spatial one, 16 control points", ratio, 0.75))
    return checks, curves


def _time_steps(hoses: Mapping[Kind, GedsHose], rounds: int) -> dict[Kind, float]:
    """The least thread time of a step of each hose (s), over rounds of 100 steps, all in turn."""
    least = dict.fromkeys(hoses, math.inf)
    for _ in range(rounds):
        for key, hose in hoses.items():
            start = time.thread_time()
            hose.step(100)
            least[key] = min(least[key], (time.thread_time() - start) / 100)
    return least


def check_suture() -> list[Check]:
    """The suture thread pulled taut at 1 ms: that it works, and how hard the solver has it."""
    case = motions.make_suture_pull()
    assert case.motion is not None
    setting = Setting("geds", "bdf2", 24, None, 0.001)
    hose = setting.make(case)
    assert isinstance(hose, GedsHose)
    simulate(case, hose)
    tension = float(np.max(hose.tension(np.linspace(0.0, hose.spec.length, 50))))
    steps = case.motion.duration / 0.001
    return [
        Check("suture thread at 1 ms: Newton iterations a step", hose.iterations / steps, 20.0),
        Check("suture thread at 1 ms: solver fallbacks a step", hose.fallbacks / steps, 0.01),
        Check("suture thread pulled taut: tension (N)", tension, 0.1, ">="),
    ]


def check_random_states(
    n_states: int, rng: np.random.Generator, advance: Callable[[int], None]
) -> list[Check]:
    """Random states and loads: never a NaN, and verdicts (StepError) in under 1 % of them.

    Args:
        n_states: how many.
        rng: draws them.
        advance: called with the number done, now and then.
    """
    tally = random_states.run_random_states(n_states, rng, advance)
    return [
        Check(f"random states with a NaN, of {n_states}", float(tally.not_finite), 0.0),
        Check("random states that end in a verdict", tally.verdicts / n_states, 0.01, "<"),
        Check("random states whose verdict changed the state", float(tally.touched), 0.0),
    ]


def check_turns() -> list[Check]:
    """27 turns, 40 degrees a step, on a straight rod under tension."""
    checks = []
    for form in FORMS:
        hose = GedsHose(STOUT, timestep=0.005, gravity=(0, 0, 0), control_points=16, twist=form)
        lay_straight(hose)
        hose.clamp(0.0)
        # Tight enough to stay straight: T above M^2 / (4 EI).
        moment = 54.0 * math.pi * STOUT.torsional_stiffness / LENGTH
        strain = moment**2 / STOUT.bending_stiffness / STOUT.axial_stiffness
        far = hose.clamp(LENGTH, (LENGTH * (1.0 + strain), 0.0, 0.0), (1.0, 0.0, 0.0))
        hose.solve_static()
        for _ in range(27 * 9):
            hose.move(far, spin=2.0 * math.pi / 9)
            hose.step()
        hose.step(400)
        error = abs(float(hose.torque(0.5 * LENGTH)[0]) / moment - 1.0)
        name = f"27 turns, 40 degrees a step, {form}: error of the torque"
        checks.append(Check(name, error, 1e-9))
    return checks


def _turn_about_x(vector: Array, angle: float) -> Array:
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y, z = vector
    return np.array([x, cosine * y - sine * z, sine * y + cosine * z])


def _compute_spin(tangent: Array, director: Array, angle: float) -> tuple[Array, Array, float]:
    """Tangent and director turned about x, and their spin beyond the smallest rotation."""
    ahead, wanted = _turn_about_x(tangent, angle), _turn_about_x(director, angle)
    factor = (director @ ahead) / (1.0 + tangent @ ahead)
    carried = director - factor * (tangent + ahead)
    spin = math.atan2(float(np.cross(carried, wanted) @ ahead), float(carried @ wanted))
    return ahead, wanted, spin


def precess(form: str, n_turns: int) -> Iterator[GedsHose]:
    """Turns a bent, twisted rod about the axis of its first clamp as if it were rigid.

    Yields the hose at equilibrium before it begins, then after every turn.
    """
    options: dict[str, Any] = {"gravity": (0, 0, 0), "twist": form, "tolerance": 1e-9}
    spec = replace(ROD, damping_time=0.1)
    hose = GedsHose(spec, timestep=0.02, control_points=16, **options)
    bend = 1.2
    hose.reset(
        lambda s: np.stack([np.sin(bend * s) / bend, (1 - np.cos(bend * s)) / bend, 0 * s], axis=1)
    )
    holds: list[Hold] = [hose.clamp(0.0), hose.clamp(LENGTH)]
    hose.move(holds[1], spin=1.0)
    hose.solve_static()
    yield hose
    place, tangent = hose.position(LENGTH)[0], hose.tangent(LENGTH)[0]
    director = np.cross(tangent, [0.0, 0.0, 1.0])
    angle = 2.0 * math.pi / 36
    for _ in range(n_turns):
        for _ in range(36):
            place = _turn_about_x(place, angle)
            tangent, director, spin = _compute_spin(tangent, director, angle)
            hose.move(holds[0], spin=angle)
            hose.move(holds[1], position=place, tangent=tangent, spin=spin)
            hose.step()
        yield hose


def check_precession() -> list[Check]:
    """A bent rod with twist precesses 100 turns: its twist must be what it was."""
    places = np.linspace(0.1, 0.9, 9) * LENGTH
    checks = []
    for form in FORMS:
        states = precess(form, _SETTLING + 100)
        scale = float(np.mean(np.abs(next(states).twist(places))))
        # The first turns set it moving; what is then must stay.
        twists = [hose.twist(places) for hose in states]
        settled, end = twists[_SETTLING - 1], twists[-1]
        name = f"precessing bent rod, {form}: drift of the twist over 100 turns"
        checks.append(Check(name, float(np.max(np.abs(end - settled))) / scale, 1e-6))
    return checks


def check_agreement() -> list[Check]:
    """Both forms on the localized helix with 100 control points, and on the largest ring."""
    checks = []
    for case, n in ((statics.make_helix(), 100), (statics.make_ring(1.0), 24)):
        found = []
        for form in FORMS:
            hose = Setting("geds", "statics", n).make(case, twist=form)
            case.lay(hose)
            found.append(case.probe(hose))
        gap = float(np.max(np.abs(found[1] / found[0] - 1.0)))
        text = f"{case.id} with {n} control points: theta differs from scalar twist by"
        checks.append(Check(text, gap, 3e-3))
    return checks


def check_twist_cost() -> tuple[list[Check], Curves]:
    """A step with twist over the plain one, between two clamps, one Newton iteration each."""
    points = (16, 32, 64, 128)
    sizes = [float(n) for n in points]
    names = {"plain": "without twist", "scalar": "scalar twist", "theta": "theta"}
    kinds: list[Kind] = [(form, n) for form in names for n in points]
    least = _time_steps({kind: _make_twisted(*kind) for kind in kinds}, rounds=15)
    curves: Curves = {k: (sizes, [least[form, n] for n in points]) for form, k in names.items()}
    checks: list[Check] = []
    for form, limit in (("scalar", 1.4), ("theta", 2.0)):
        ratio = max(least[form, n] / least["plain", n] for n in points)
        name = f"cost of a step with {form} twist over one without, 16 to 128 control points"
        checks.append(Check(name, ratio, limit))
        exponent = measure_order(*curves[names[form]])
        checks.append(Check(f"exponent of the cost in control points, {form} twist", exponent, 1.1))
    return checks, curves


def _make_twisted(form: str | None, n: int) -> GedsHose:
    """A straight rod under tension between two clamps, with some twist."""
    spec = replace(ROD, torsional_stiffness=0.0) if form == "plain" else ROD
    twist = None if form == "plain" else form
    hose = GedsHose(spec, timestep=2e-4, control_points=n, twist=twist)
    hose.clamp(0.0)
    far = hose.clamp(LENGTH)
    if form != "plain":
        hose.move(far, spin=1.0)
    hose.step(100)
    return hose


def measure_stretch(case: Case, timestep: float) -> float:
    """Largest strain of any edge at the sampled instants of a motion, either sign."""
    corrected = True if case.clamped else None
    hose = Setting("flex", "discrete", FLEX_SEGMENTS, corrected, timestep).make(case)
    assert isinstance(hose, FlexHose)
    strains: list[float] = []

    def probe(moving: object) -> np.ndarray:
        strains.append(float(np.abs(hose.stretch()).max()))
        return np.zeros(3)

    simulate(replace(case, probe=probe), hose)
    return max(strains)


def check_flex_stretch() -> list[Check]:
    """Stretch of the released rod's edges, and how it falls with the time step."""
    case = motions.make_released_rod()
    stretches = [measure_stretch(case, step) for step in FLEX_STEPS]
    order = measure_order(list(FLEX_STEPS), stretches)
    name = f"flex, {FLEX_SEGMENTS} segments: residual stretch of the released rod"
    return [
        Check(f"{name} at {1e3 * FLEX_STEPS[-1]:g} ms", stretches[-1], 1e-3),
        Check(f"{name}, order in the time step", order, 1.8, ">="),
    ]


CURVES: dict[str, Callable[[], tuple[list[Check], Curves]]] = {
    "Error of the frequencies over the span length": check_frequency_order,
    "Error of the swing over the span length": check_swing_order,
    "Error over the time step": check_time_order,
    "Wall time of a step over the control points": check_cost,
    "Wall time of a step with twist": check_twist_cost,
}
"""Measurements that make a convergence plot, by its title."""
CHECKS: dict[str, tuple[Callable[[], list[Check]], ...]] = {
    "twist": (check_turns, check_precession, check_agreement),
    "suture thread": (check_suture,),
}
"""Other measurements, by what they are about."""
