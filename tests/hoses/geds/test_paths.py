"""Holds that follow paths within one call: bit by bit `move` and `step` in turn."""

import numpy as np
import pytest

from hose_mj import HoseSpec, HoseWarning, InputError, Spring, StepError, make_hose

SPEC = HoseSpec(
    length=1.0,
    axial_stiffness=2e4,
    bending_stiffness=0.05,
    torsional_stiffness=0.04,
    linear_density=0.1,
)
N_STEPS = 40


def lay(plane=None, spring=None, **options):
    """A hose clamped at both ends and attached in its middle, with its two last holds."""
    hose = make_hose("geds", SPEC, plane=plane, **options)
    hose.reset([[0, 0, 0], [1, 0, 0]])
    hose.clamp(0.0)
    own = {} if spring is None else {"spring": spring}
    return hose, hose.attach(0.5, **own), hose.clamp(1.0, **own)


def make_paths():
    t = np.linspace(0.0, 1.0, N_STEPS + 1)[1:]
    middle = np.stack([0.5 - 0.02 * t, 0 * t, 0.03 * np.sin(3 * t)], axis=1)
    last = np.stack([1.0 - 0.1 * t, 0 * t, 0.05 * t**2], axis=1)
    return middle, last, np.stack([np.cos(t), 0 * t, -np.sin(t)], axis=1)


@pytest.mark.parametrize(
    "options",
    [
        *({}, {"plane": "xz"}, {"twist": "theta"}, {"spring": Spring(1e3, 1.0, 9.0, 2.0)}),
        *({"scheme": "sdirk2"}, {"scheme": "verlet", "timestep": 1e-5}),
    ],
)
def test_a_path_is_bitwise_its_steps(options):
    middle, last, aims = make_paths()
    if "timestep" in options:
        middle, last, aims = (part[:1] + 1e-4 * (part - part[:1]) for part in (middle, last, aims))
        middle[:], last[:] = middle - middle[0] + [0.5, 0, 0], last - last[0] + [1, 0, 0]
    found = []
    for in_one in (True, False):
        hose, one, other = lay(**options)
        if in_one:
            hose.follow({one: middle, other: last}, {other: aims})
        else:
            for k in range(N_STEPS):
                hose.move(one, middle[k])
                hose.move(other, last[k], aims[k])
                hose.step()
        hose.step(3)
        found.append((hose, hose.snapshot(), hose.reaction(other)))
    (hose, state, reaction), (_, other_state, other_reaction) = found
    for name, part in state["state"].items():
        np.testing.assert_array_equal(part, other_state["state"][name], err_msg=name)
    for one, two in zip(state["holds"]["held"], other_state["holds"]["held"], strict=True):
        np.testing.assert_array_equal(one["position"], two["position"])
    for name in ("before", "after", "multipliers"):
        np.testing.assert_array_equal(state["holds"][name], other_state["holds"][name])
    np.testing.assert_array_equal(reaction.moment, other_reaction.moment)
    assert hose.time == pytest.approx((N_STEPS + 3) * hose.timestep)


def test_each_step_of_a_path_is_looked_at_for_jumps():
    hose, one, _ = lay()
    path = np.tile([0.5, 0.0, 0.0], (20, 1))
    path[12:, 2] = -0.15
    with pytest.warns(HoseWarning, match=r"moves by 0\.15 m within one step"):
        hose.follow({one: path})
    assert hose.health.largest_jump == pytest.approx(0.15)
    strict, one, _ = lay(strict=True)
    before = strict.control_points
    with pytest.raises(StepError, match=r"moves by 0\.15 m"):
        strict.follow({one: path})
    np.testing.assert_array_equal(strict.control_points, before)
    strict.follow({one: path[:12]})


def test_a_path_that_cannot_be_followed_keeps_the_steps_before():
    hose, one, other = lay()
    path = np.tile([0.5, 0.0, 0.0], (6, 1))
    path[3:] = [1e9, 0.0, 0.0]
    with pytest.warns(HoseWarning, match="moves by"), pytest.raises(StepError):
        hose.follow({one: path})
    assert hose.time == pytest.approx(3 * hose.timestep)
    assert hose.snapshot()["holds"]["held"][1]["position"][0] == 1e9
    hose.move(one, (0.5, 0.0, 0.0))
    hose.step()
    assert other in hose.holds


def test_odd_paths_are_refused_and_change_nothing():
    hose, one, other = lay(plane="xz")
    middle, last, aims = make_paths()
    off, back = middle + 0.0, aims + 0.0
    off[30, 1], back[30] = 0.1, [-1.0, 0.0, 0.0]
    before = hose.control_points
    for positions, tangents, match in (
        ({one: middle, other: last[:5]}, None, r"shape of a path is \(5, 3\); valid: \(40, 3\)"),
        ({one: middle[0]}, None, "shape of a path"),
        ({one: np.full((4, 3), np.nan)}, None, "shape of a path"),
        ({one: off}, None, "position is .*in the hose's plane"),
        ({one: middle}, {one: aims}, "tangents is Hold"),
        ({one: middle}, {other: back}, "tangent is .*within 90 degrees"),
        ([middle], None, "positions is 'list'.*a mapping from holds"),
        ({3: middle}, None, "positions is 'dict'.*a mapping from holds"),
        ({one: "x"}, None, "positions is 'x'"),
    ):
        with pytest.raises(InputError, match=match):
            hose.follow(positions, tangents)
    hose.release(one)
    with pytest.raises(InputError, match="a hold of this hose"):
        hose.follow({one: middle})
    hose.follow({})
    hose.follow({other: np.zeros((0, 3))})
    assert hose.time == 0.0
    np.testing.assert_array_equal(hose.control_points, before)
