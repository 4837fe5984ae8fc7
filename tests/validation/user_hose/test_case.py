"""A user's hose as a case: its rest shape against closed forms, its plane, what models refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hose_mj.assets import find_asset
from hose_mj.errors import InputError
from hose_mj.hoses.registry import make_hose
from hose_mj.scenes.hose_file.grasps import Grasp, Movement, Spin
from hose_mj.scenes.hose_file.hose_file import Floor, PointLoad, read_hose_file
from hose_mj.validation import reference
from hose_mj.validation.case import BENDING_STIFFNESS, LENGTH, LINEAR_DENSITY, STOUT
from hose_mj.validation.user_hose.case import compute_rest_shape, describe, is_planar, make_case
from hose_mj.validation.user_hose.study import check_supported

GARDEN = read_hose_file(find_asset("hoses/garden_hose.toml"))
CLAMP = Grasp(0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
CANTILEVER = replace(GARDEN, spec=STOUT, holds=(CLAMP,), duration=None, start="as-laid")


def load(gamma):
    """Gravity under which a cantilever has rho A g L^3 / EI = gamma."""
    return (0.0, 0.0, -gamma * BENDING_STIFFNESS / (LINEAR_DENSITY * LENGTH**3))


@pytest.mark.parametrize("gamma", [1.0, 10.0, 100.0])
def test_a_cantilever_rests_as_the_elastica(gamma):
    x, y, z = compute_rest_shape(replace(CANTILEVER, gravity=load(gamma)))(np.array([LENGTH]))[0]
    assert -z / x == pytest.approx(reference.heavy_cantilever(gamma), rel=1e-4)
    assert y == pytest.approx(0.0, abs=1e-6)


def test_loads_act_on_the_rest_shape():
    pull = PointLoad(LENGTH, (0.0, -5.0 * BENDING_STIFFNESS / LENGTH**2, 0.0), (0.0, 0.0, 0.0))
    user = replace(CANTILEVER, gravity=(0.0, 0.0, 0.0), loads=(pull,))
    x, y, _ = compute_rest_shape(user)(np.array([LENGTH]))[0]
    along, aside = reference.tip_load(5.0)
    assert LENGTH - x == pytest.approx(along, rel=1e-3)
    assert -y == pytest.approx(aside, rel=1e-3)


def test_a_hose_does_not_stay_balanced_on_an_edge():
    """Upright and three times longer than it can stand: it is laid upright, and falls over."""
    upright = replace(CLAMP, tangent=(0.0, 0.0, 1.0))
    tip = compute_rest_shape(replace(CANTILEVER, holds=(upright,), gravity=load(3.0 * 7.837)))
    assert tip(np.array([LENGTH]))[0, 2] < 0.5 * LENGTH
    short = compute_rest_shape(replace(CANTILEVER, holds=(upright,), gravity=load(0.5 * 7.837)))
    assert short(np.array([LENGTH]))[0, 2] == pytest.approx(LENGTH, rel=1e-6)


@pytest.mark.filterwarnings("ignore:a hold moves:hose_mj.HoseWarning")  # there in one step
def test_the_case_of_the_garden_hose():
    case = make_case(GARDEN)
    assert (case.id, case.scale, case.clamped, case.planar) == ("own-hose", 3.0, True, True)
    assert case.motion.duration == 2.0
    hose = make_hose("geds", case.spec, gravity=case.gravity, control_points=24)
    holds = case.lay(hose)
    np.testing.assert_allclose(case.probe(hose)[:3], [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(case.probe(hose)[-3:], [2.6, 0, 0.8], atol=1e-9)
    before = case.probe(hose)
    hose.step(20)
    np.testing.assert_allclose(case.probe(hose), before, atol=1e-6)  # it starts at rest
    case.motion.drive(hose, holds, 1.5)
    hose.step()
    np.testing.assert_allclose(hose.position(3.0)[0], [1.4, 0.0, 1.2], atol=1e-9)


def test_without_equilibrium_it_starts_as_laid():
    case = make_case(replace(CANTILEVER, duration=1.0))
    hose = make_hose("geds", STOUT)
    case.lay(hose)
    np.testing.assert_allclose(hose.position(LENGTH)[0], [LENGTH, 0.0, 0.0], atol=1e-12)
    assert case.motion.drive is None


FLAT = replace(CANTILEVER, gravity=load(1.0))
ASIDE = (0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("changes", "planar"),
    [
        ({}, True),
        ({"holds": (replace(CLAMP, position=(0.0, 3.0, 0.0)),)}, True),
        ({"holds": (replace(CLAMP, tangent=ASIDE),)}, False),
        ({"holds": (CLAMP, Grasp(1.0, (0.5, 0.1, 0.0), None))}, False),
        ({"holds": (replace(CLAMP, moves=(Movement(0, 1, "linear", ASIDE, None),)),)}, False),
        ({"holds": (replace(CLAMP, spins=(Spin(0, 1, "linear", 1.0),)),)}, False),
        ({"gravity": ASIDE}, False),
        ({"loads": (PointLoad(1.0, ASIDE, (0.0, 0.0, 0.0)),)}, False),
        ({"loads": (PointLoad(1.0, (0.0, 0.0, 0.0), ASIDE),)}, True),
        ({"loads": (PointLoad(1.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),)}, False),
        ({"spec": replace(STOUT, rest_torsion=1.0)}, False),
    ],
)
def test_what_stays_in_a_plane(changes, planar):
    assert is_planar(replace(FLAT, **changes)) == planar


def refuse(user, model, words):
    with pytest.raises(InputError) as caught:
        check_supported(user, model)
    assert words in str(caught.value)


def test_a_thread_too_light_for_mujoco_is_refused():
    light = replace(CANTILEVER, spec=replace(STOUT, linear_density=1e-14))
    refuse(light, "cable", "linear_density is 1e-14; valid: for cable heavier")
    check_supported(light, "geds")


def test_a_model_that_cannot_says_so():
    on_floor = replace(CANTILEVER, floor=Floor(-2.0, 0.3), duration=1.0)
    turned = replace(CANTILEVER, holds=(replace(CLAMP, spins=(Spin(0, 1, "linear", 1.0),)),))
    for user in (on_floor, turned):
        check_supported(user, "geds")
        check_supported(user, "cable")
    refuse(on_floor, "flex", "floor is -2.0; valid: left out: flex touches nothing")
    refuse(turned, "flex", "spin is 'given'; valid: left out: flex")
    at_rest = replace(on_floor, start="equilibrium")
    refuse(at_rest, "cable", "only geds finds a rest shape")
    check_supported(at_rest, "geds")


def test_a_chain_refuses_what_it_cannot_be():
    check_supported(CANTILEVER, "cable")
    coiled = replace(CANTILEVER, spec=replace(STOUT, rest_curvature=2.0))
    refuse(coiled, "cable", "hose.rest_curvature is 2.0; valid: for cable ")


def test_a_sentence_about_it():
    text = describe(GARDEN)
    assert "3 m of hose, 25 mm thick, 1.6 kg" in text
    assert "clamped at 0 m and attached and moved at 3 m" in text
    assert "Nothing holds it" in describe(replace(CANTILEVER, holds=(), duration=1.0))
