"""A hose laid along any curve of its length is free of strain, or says how much it has."""

import re
import warnings

import numpy as np
import pytest

from hose_mj.errors import HoseWarning, InputError
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

EA = 1e6
SPEC = HoseSpec(length=1.0, axial_stiffness=EA, bending_stiffness=0.05, linear_density=0.1)


def arch(s):
    angle = np.pi / 2 * s
    return np.stack([np.sin(angle), 0 * s, np.cos(angle)], axis=1) / (np.pi / 2)


PACES = {
    "square": lambda s: s**2,
    "slow in the middle": lambda s: s + 0.15 * np.sin(2 * np.pi * s),
    "slow at the ends": lambda s: 0.5 - 0.5 * np.cos(np.pi * s),
}


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("n", [12, 40])
def test_no_strain_whatever_the_pace(pace, n):
    hose = GedsHose(SPEC, control_points=n)
    even = GedsHose(SPEC, control_points=n)
    even.reset(arch)
    for curve in (lambda s: arch(PACES[pace](s)), arch(PACES[pace](np.linspace(0, 1, 400)))):
        hose.reset(curve)
        s = np.linspace(0.0, 1.0, 41)
        # What remains is what the spline of an even arch has, below 1e-3 of EA at 12 points.
        least = 1e-5 * EA + np.abs(even.tension(s)).max()
        assert np.abs(hose.tension(s)).max() < 2.0 * least
        np.testing.assert_allclose(hose.position(s), arch(s), atol=2e-4)


def test_an_even_curve_is_taken_as_it_is():
    calls = []

    def curve(s):
        calls.append(np.array(s))
        return arch(s)

    hose = GedsHose(SPEC, control_points=12)
    hose.reset(curve)
    # At the Greville abscissae in the end, as ever.
    knots = np.concatenate([[0.0] * 3, np.linspace(0, 1, 10), [1.0] * 3])
    np.testing.assert_allclose(calls[-1], (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3, atol=1e-15)


def test_strain_as_laid_is_said():
    hose = GedsHose(SPEC, control_points=12)
    with pytest.warns(
        HoseWarning, match=r"laid with a strain of -2\.00%, 2e\+04 N of force"
    ) as said:
        hose.reset([[0, 0, 0], [0.98, 0, 0]])
    assert said[0].filename == __file__
    with pytest.warns(HoseWarning, match=r"strain of 3\.00%"):
        hose.reset(lambda s: np.outer(1.03 * s, [1, 0, 0]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hose.reset([[0, 0, 0], [0.995, 0, 0]])


def test_a_function_far_from_the_length_is_refused():
    hose = GedsHose(SPEC, control_points=12)
    before = hose.control_points
    with pytest.raises(InputError, match=r"length of the curve \(m\) is 3\.0.*0\.5 to 2") as caught:
        hose.reset(lambda s: np.outer(3.0 * s, [1, 0, 0]))
    assert re.search("valid", str(caught.value))
    np.testing.assert_array_equal(hose.control_points, before)
