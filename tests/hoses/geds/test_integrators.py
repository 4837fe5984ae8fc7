import numpy as np
import pytest

EI, DENSITY = 0.05, 0.1
FIRST_ROOT = 1.87510407
IMPLICIT = ("bdf2", "backward-euler", "sdirk2", "midpoint")
ALL = (*IMPLICIT, "verlet")
ORDER = {"backward-euler": 1, "bdf2": 2, "sdirk2": 2, "midpoint": 2, "verlet": 2}
planes = pytest.mark.parametrize("plane", [None, "xz"])


def tumble(s):
    """A smooth velocity that turns, bends and stretches a hose along x."""
    return np.stack([0.2 * np.cos(3 * s), 0.0 * s, 2.0 * (s - 0.5) + np.sin(3 * s)], axis=1)


def fly(make_hose, scheme, timestep, duration, **options):
    """A soft hose in free flight: its fastest axial wave is slow enough to be resolved."""
    settings = {"plane": "xz", "ea": 200.0, "control_points": 8, "gravity": (0, 0, 0)} | options
    settings = {"tolerance": 1e-11} | settings
    hose = make_hose(scheme=scheme, timestep=timestep, **settings)
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=tumble)
    hose.step(round(duration / timestep))
    return hose


@pytest.mark.parametrize("scheme", ALL)
def test_order_in_the_time_step(make_hose, scheme):
    reference = fly(make_hose, "verlet", 1e-5, 0.1).control_points
    steps = np.array([5e-4, 2.5e-4, 1.25e-4])
    errors = [
        np.abs(fly(make_hose, scheme, dt, 0.1).control_points - reference).max() for dt in steps
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, ORDER[scheme], atol=0.25)
    assert errors[-1] < 5e-3


@planes
@pytest.mark.parametrize("scheme", ALL)
@pytest.mark.parametrize("crude", [False, True])
def test_linear_momentum_is_conserved(make_hose, plane, scheme, crude):
    rough = {"tolerance": 1e3, "max_iterations": 1} if crude else {}
    dt = 1e-4 if scheme == "verlet" else 5e-3
    hose = make_hose(plane=plane, scheme=scheme, timestep=dt, gravity=(0, 0, 0), ea=1e3, **rough)
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=tumble)
    before = hose.momentum().linear
    hose.step(100)
    assert np.linalg.norm(before) > 0.03
    if crude and scheme != "verlet":
        assert hose.iterations == 100 * (2 if scheme == "sdirk2" else 1)
    scale = np.linalg.norm(before)
    np.testing.assert_allclose(hose.momentum().linear, before, atol=1e-9 * scale)


@planes
@pytest.mark.parametrize("scheme", ALL)
def test_falling_momentum_is_weight_times_time(make_hose, plane, scheme):
    hose = fly(make_hose, scheme, 1e-3, 0.1, plane=plane, gravity=(0.0, 0.0, -9.81))
    start = fly(make_hose, scheme, 1e-3, 0.0, plane=plane).momentum().linear
    gained = hose.momentum().linear - start
    np.testing.assert_allclose(gained, [0, 0, -9.81 * DENSITY * 0.1], atol=1e-11)


@planes
@pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
def test_angular_momentum_is_conserved(make_hose, plane, scheme):
    before = fly(make_hose, scheme, 5e-4, 0.0, plane=plane).momentum().angular
    after = fly(make_hose, scheme, 5e-4, 0.5, plane=plane).momentum().angular
    assert np.linalg.norm(before) > 0.01
    np.testing.assert_allclose(after, before, atol=1e-9 * np.linalg.norm(before))


@pytest.mark.parametrize("scheme", ["bdf2", "sdirk2", "backward-euler"])
def test_angular_momentum_error_has_the_order_of_the_scheme(make_hose, scheme):
    before = fly(make_hose, scheme, 1e-3, 0.0).momentum().angular[1]
    errors = [
        abs(fly(make_hose, scheme, dt, 0.2).momentum().angular[1] - before)
        for dt in (1e-3, 5e-4, 2.5e-4)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > ORDER[scheme] - 0.25), (errors, orders)


def test_damping_inside_a_plane_keeps_momentum(make_hose):
    start = fly(make_hose, "midpoint", 5e-4, 0.0, damping=0.05).momentum()
    hose = fly(make_hose, "midpoint", 5e-4, 0.3, damping=0.05)
    undamped = fly(make_hose, "midpoint", 5e-4, 0.3)
    np.testing.assert_allclose(hose.momentum().linear, start.linear, atol=1e-12)
    np.testing.assert_allclose(hose.momentum().angular, start.angular, atol=1e-11)
    assert hose.energies().total < 0.9 * undamped.energies().total


@pytest.mark.parametrize("options", [{}, {"tolerance": 1e-4}, {"tolerance": 1e-6}])
def test_energy_of_a_released_rod_never_rises_above_its_start(make_hose, options):
    hose = make_hose(plane="xz", timestep=0.005, **options)
    hose.clamp(0.0)
    totals, heights = [], []
    for _ in range(2000):
        hose.step()
        totals.append(hose.energies().total)
        heights.append(hose.position(1.0)[0, 2])
    assert max(totals) <= 1e-3 * DENSITY * 9.81
    # It still swings at the end: a method that kills the motion would pass the line above.
    assert np.ptp(heights[-400:]) > 0.2


@pytest.mark.parametrize("scheme", ALL)
def test_plane_and_space_agree(make_hose, scheme):
    flat = fly(make_hose, scheme, 5e-4, 0.1)
    spatial = fly(make_hose, scheme, 5e-4, 0.1, plane=None)
    np.testing.assert_allclose(spatial.control_points, flat.control_points, atol=1e-9)
    assert spatial.energies().total == pytest.approx(flat.energies().total, rel=1e-8)


def test_schemes_agree_on_a_swing(make_hose):
    tips = []
    for scheme, dt in (("bdf2", 1e-3), ("sdirk2", 2e-3), ("midpoint", 2e-3)):
        hose = make_hose(plane="xz", scheme=scheme, timestep=dt, tolerance=1e-9)
        hose.clamp(0.0)
        hose.step(round(0.3 / dt))
        tips.append(hose.position(1.0)[0])
    np.testing.assert_allclose(tips[1:], tips[:1] * 2, atol=5e-4)


def first_mode(s):
    """First clamped-free mode, tip deflection 2 (Euler-Bernoulli)."""
    b = FIRST_ROOT
    ratio = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    return np.cosh(b * s) - np.cos(b * s) - ratio * (np.sinh(b * s) - np.sin(b * s))


@planes
def test_damping_time_decays_the_first_mode(make_hose, plane):
    tau = 0.03
    omega = FIRST_ROOT**2 * np.sqrt(EI / DENSITY)
    hose = make_hose(plane=plane, damping=tau, scheme="midpoint", timestep=0.005, gravity=(0, 0, 0))
    hose.reset(lambda s: np.stack([s, 0 * s, 5e-5 * first_mode(s)], axis=1))
    hose.clamp(0.0)
    start = hose.energies().total
    n_steps = round(4 * 2 * np.pi / omega / 0.005)
    hose.step(n_steps)
    # Amplitude exp(-tau omega^2 t / 2), energy its square.
    wanted = np.exp(-tau * omega**2 * n_steps * 0.005)
    assert wanted < 0.2
    assert hose.energies().total / start == pytest.approx(wanted, rel=0.02)


@planes
@pytest.mark.parametrize("scheme", IMPLICIT)
def test_drag_slows_a_rigid_translation(make_hose, plane, scheme):
    drag, dt, n_steps = 0.2, 1e-3, 500
    hose = make_hose(plane=plane, drag=drag, scheme=scheme, timestep=dt, gravity=(0, 0, 0))
    hose.reset([[0, 0, 0], [1, 0, 0]], velocity=[0.3, 0.0, 1.0])
    hose.step(n_steps)
    wanted = np.exp(-drag * n_steps * dt / DENSITY)
    speed = hose.velocity([0.0, 0.5, 1.0])
    rel = 2e-3 if scheme == "backward-euler" else 1e-5
    np.testing.assert_allclose(speed, np.outer([wanted] * 3, [0.3, 0.0, 1.0]), rtol=rel, atol=1e-10)
    if scheme == "backward-euler":
        exact = (1.0 + drag * dt / DENSITY) ** -n_steps
        np.testing.assert_allclose(speed[:, 2], exact, rtol=1e-9)
