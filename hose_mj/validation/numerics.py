"""What GEDS promises of its own numerics, measured: orders, conserved quantities, cost.

Each function returns checks; together they are the part of `hose-mj compare` that needs no peer.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hose_mj.checks import Check
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.protocol import Array
from hose_mj.validation import reference
from hose_mj.validation.case import ROD, Case
from hose_mj.validation.cases import find_cases
from hose_mj.validation.modes import compute_frequencies
from hose_mj.validation.run import simulate
from hose_mj.validation.settings import Setting

Curves = dict[str, tuple[list[float], list[float]]]
"""Label -> (x, error) of a convergence plot."""


def measure_order(sizes: list[float], errors: list[float]) -> float:
    """Slope of log(error) over log(size), least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def _find(case_id: str) -> Case:
    return find_cases((case_id,))[0]


def check_frequency_order() -> tuple[list[Check], Curves]:
    """Order of the first three frequencies in the span length, worst of three kinds of ends.

    Bending of a straight hose knows nothing of EA; the smaller one leaves less rounding error.
    """
    spec = ROD
    unit = np.sqrt(spec.bending_stiffness / (spec.linear_density * spec.length**4))
    points = (8, 10, 12, 16, 20)
    spans = [spec.length / (n - 3) for n in points]
    orders: list[float] = []
    curves: Curves = {}
    for ends in ("clamped-free", "free-free", "clamped-pinned"):
        case = replace(_find(f"frequencies-{ends}"), spec=spec)
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
    case = _find("released-rod")
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
    case = _find("taut-pull-hose")
    assert case.motion is not None
    case = replace(case, motion=replace(case.motion, duration=0.4, n_samples=10, drive=None))
    steps = [0.004 / 2**k for k in range(4)]

    def move(scheme: str, step: float) -> Array:
        setting = Setting("geds", f"{scheme}, planar", 12, None, step)
        return simulate(case, setting.make(case, tolerance=1e-9))[1]

    limit = (4.0 * move("sdirk2", steps[-1] / 16) - move("sdirk2", steps[-1] / 8)) / 3.0
    checks, curves = [], {}
    for scheme, least in (
        ("bdf2", 1.9),
        ("sdirk2", 1.9),
        ("midpoint", 1.9),
        ("backward-euler", 0.9),
    ):
        errors = [float(np.max(np.abs(move(scheme, step) - limit))) for step in steps]
        order = measure_order(steps, errors)
        checks.append(Check(f"order of convergence in the time step, {scheme}", order, least, ">="))
        curves[scheme] = (steps, errors)
    return checks, curves


def check_momenta() -> list[Check]:
    """Linear and angular momentum of the free flight in every scheme."""
    case = _find("free-flight")
    assert case.motion is not None
    checks = []
    for scheme in ("bdf2", "backward-euler", "sdirk2", "midpoint", "verlet"):
        steps = [2e-5] if scheme == "verlet" else [0.0025, 0.00125, 0.000625]
        angular = []
        for step in steps:
            hose = GedsHose(
                case.spec,
                timestep=step,
                gravity=case.gravity,
                control_points=12,
                scheme=scheme,
                tolerance=1e-12,
                max_iterations=50,
            )
            case.lay(hose)
            before = hose.momentum()
            hose.step(round(0.5 / step))
            after = hose.momentum()
            linear = np.linalg.norm(after.linear - before.linear) / np.linalg.norm(before.linear)
            turn = np.linalg.norm(after.angular - before.angular) / np.linalg.norm(before.angular)
            angular.append(float(turn))
        checks.append(Check(f"drift of linear momentum, {scheme}", float(linear), 1e-9))
        if scheme in ("midpoint", "verlet"):
            checks.append(Check(f"drift of angular momentum, {scheme}", angular[-1], 1e-9))
        else:
            least = 0.9 if scheme == "backward-euler" else 1.9
            order = measure_order(steps, angular)
            checks.append(
                Check(f"order of the drift of angular momentum, {scheme}", order, least, ">=")
            )
    return checks


def check_energy() -> tuple[list[Check], tuple[list[float], list[float]]]:
    """Energy of the released rod over ten seconds at 5 ms with BDF2, against its start."""
    case = _find("released-rod")
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
    hoses = {(plane, n): _make_swinging(plane, n) for plane in (None, "xz") for n in points}
    least = {key: np.inf for key in hoses}
    for _ in range(7):
        for key, hose in hoses.items():
            start = time.thread_time()
            hose.step(100)
            least[key] = min(least[key], (time.thread_time() - start) / 100)
    checks: list[Check] = []
    curves: Curves = {}
    for plane, name in ((None, "in space"), ("xz", "in a plane")):
        walls = [float(least[plane, n]) for n in points]
        exponent = measure_order([float(n) for n in points], walls)
        checks.append(Check(f"exponent of the cost in control points, {name}", exponent, 1.1))
        curves[f"geds {name}"] = ([float(n) for n in points], walls)
    ratio = float(least["xz", 16] / least[None, 16])
    checks.append(Check("cost of a planar step over a spatial one, 16 control points", ratio, 0.75))
    return checks, curves


def _make_swinging(plane: str | None, n: int) -> GedsHose:
    """A released rod, warmed up; one Newton iteration a step at this time step."""
    hose = GedsHose(ROD, timestep=2e-4, control_points=n, plane=plane)
    hose.clamp(0.0)
    hose.step(50)
    return hose


def check_suture() -> list[Check]:
    """The suture thread pulled taut at 1 ms: that it works, and how hard the solver has it."""
    case = _find("taut-pull-suture")
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
    from hose_mj.validation.random_states import run_random_states

    tally = run_random_states(n_states, rng, advance)
    return [
        Check(f"random states with a NaN, of {n_states}", float(tally.not_finite), 0.0),
        Check("random states that end in a verdict", tally.verdicts / n_states, 0.01, "<"),
        Check("random states whose verdict changed the state", float(tally.touched), 0.0),
    ]
