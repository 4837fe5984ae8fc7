"""The study of a user's hose: its answers, its budget, and what it reaches on known shapes."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from hose_mj.assets import find_asset
from hose_mj.errors import InputError
from hose_mj.scenes.hose_file.hose_file import Floor, read_hose_file
from hose_mj.validation.run import Skipped
from hose_mj.validation.settings import Setting
from hose_mj.validation.user_hose import study as user_study
from hose_mj.validation.user_hose.answers import list_answers, list_disagreements
from hose_mj.validation.user_hose.case import compute_fineness, make_case
from hose_mj.validation.user_hose.study import (
    GRID,
    list_halving_steps,
    list_models,
    run_user_hose_study,
)

GARDEN = read_hose_file(find_asset("hoses/garden_hose.toml"))
USB = read_hose_file(find_asset("hoses/usb_cable.toml"))


def silent(text):
    assert text


def test_each_answer_is_the_cheapest_run_that_is_close_enough(make_outcome):
    outcomes = [
        make_outcome(error=0.004, wall=2.0, n=16),
        make_outcome(error=0.009, wall=1.0, n=8),
        make_outcome("cable", error=0.008, wall=0.1, clamp=False),
        make_outcome("cable", error=0.008, wall=5.0, clamp=True, n=40),
    ]
    answers = list_answers(outcomes, ("geds", "cable"), (0.01, 0.005))
    found = [(a.at_error, a.model, a.resolution, a.wall_s_per_sim_s) for a in answers]
    assert found == [
        (0.01, "geds", 8, 1.0),
        (0.01, "cable", 40, 5.0),
        (0.005, "geds", 16, 2.0),
        (0.005, "cable", None, None),
    ]
    planar = [*outcomes, make_outcome(scheme="bdf2, planar", wall=0.5)]
    kinds = [(a.model, a.planar) for a in list_answers(planar, ("geds", "cable"), (0.01,))]
    assert kinds == [("geds", False), ("geds", True), ("cable", False)]


def test_of_rest_shapes_the_coarsest_counts(make_outcome):
    outcomes = [make_outcome(error=0.001, wall=1.0, n=32), make_outcome(wall=2.0, n=8)]
    for outcome in outcomes:
        outcome.sim_s = None
    (answer,) = list_answers(outcomes, ("geds",), (0.01,))
    assert (answer.resolution, answer.wall_s_per_sim_s) == (8, None)


def test_the_disagreement_of_each_model_and_clamp(make_outcome):
    outcomes = [
        make_outcome(error=0.004),
        make_outcome(error=0.002),
        make_outcome("cable", error=0.03, clamp=False),
        make_outcome("cable", error=0.01, clamp=True),
    ]
    gaps = list_disagreements(outcomes, 3.0)
    assert [(g.model, g.clamp_corrected, g.error) for g in gaps] == [
        *(("geds", None, 0.002), ("cable", False, 0.03), ("cable", True, 0.01)),
    ]
    assert gaps[0].distance == pytest.approx(0.006)


def test_steps_halve_and_divide_the_pauses(case):
    for model, scheme in (("geds", "bdf2"), ("cable", "euler")):
        steps = list_halving_steps(model, scheme, 10, case, GRID)
        assert steps[0] == {"geds": 0.01, "cable": 0.005}[model]
        assert all(one == 2 * other for one, other in pairwise(steps))
        assert all((case.motion.pause / step).is_integer() for step in steps)
    assert list_halving_steps("geds", "bdf2", 10, case, GRID)[-1] >= GRID.smallest_geds_step
    # An undamped chain is not tried far above its limit, h^2 sqrt(rho / EI / 12), 4 ms above.
    limit = 0.01**2 * (0.1 / 0.05 / 12) ** 0.5
    assert list_halving_steps("cable", "euler", 100, case, GRID)[0] < 2.2 * limit


def test_geds_and_the_cable_find_one_rest_shape():
    study = run_user_hose_study(USB, list_models(), silent)
    assert study.refused == {}
    assert study.result.stretchable.uncertainty < 1e-6
    assert study.stretch < 1e-5
    best = {(g.model, g.clamp_corrected): g.error for g in study.disagreements}
    assert best["geds", None] < 1e-4
    assert best["cable", True] < 1e-3
    assert best["cable", True] < best["cable", False]
    geds = [a.resolution for a in study.answers if a.model == "geds"]
    assert geds == sorted(geds)
    assert {o.reference for o in study.result.outcomes} == {"converged"}
    (check,) = study.checks
    assert check.ok


def test_without_chains_there_is_no_second_reference():
    study = run_user_hose_study(USB, ("geds",), silent)
    assert study.result.inextensible is study.stretch is None
    assert {o.setting.model for o in study.result.outcomes} == {"geds"}


def refuse(*models):
    """A `check_supported` that refuses these models."""

    def check(user, model):
        if model in models:
            raise InputError("floor", 0.0, "left out")

    return check


def test_what_geds_cannot_do_is_an_error(monkeypatch):
    monkeypatch.setattr(user_study, "check_supported", refuse("geds"))
    with pytest.raises(InputError, match="floor is 0"):
        run_user_hose_study(USB, ("cable",), silent)


def test_what_another_model_cannot_do_is_told(monkeypatch):
    monkeypatch.setattr(user_study, "check_supported", refuse("cable"))
    study = run_user_hose_study(USB, ("geds", "cable"), silent)
    assert study.refused == {"cable": "floor is 0.0; valid: left out"}
    assert {a.model for a in study.answers} == {"geds"}


def test_a_spent_budget_leaves_runs_out_and_says_so():
    short = replace(GARDEN, duration=0.2, budget=1e-3)
    study = run_user_hose_study(short, ("geds", "cable"), silent)
    assert study.result.stretchable is not None
    assert study.result.outcomes == []
    assert study.result.skipped
    assert {item.why for item in study.result.skipped} == {"the budget was spent"}
    assert all(isinstance(item, Skipped) for item in study.result.skipped)
    assert study.cut_short == {"geds", "cable"}
    assert all(answer.setting is None for answer in study.answers)


@pytest.mark.slow
def test_the_garden_hose():
    study = run_user_hose_study(
        replace(GARDEN, duration=0.5, budget=20.0), ("geds", "cable"), silent
    )
    (check,) = study.checks
    assert check.ok
    reached = {a.model for a in study.answers if a.error is not None and a.at_error == 0.01}
    assert reached == {"geds", "cable"}
    for answer in study.answers:
        assert answer.error is None or answer.error <= answer.at_error
    # The cable does not stretch: its distance is that of a hose that does not, not less.
    cable = min(g.error for g in study.disagreements if g.model == "cable")
    assert cable > 0.5 * study.stretch


def test_the_floor_is_an_obstacle_of_the_case():
    case = make_case(replace(USB, floor=Floor(-1.0, 0.3), duration=1.0, start="as-laid"))
    (floor,) = case.obstacles
    assert (floor.kind, floor.position[2], floor.friction) == ("plane", -1.0, 0.3)


@pytest.mark.parametrize(("name", "turns"), [("telephone_cord", 10.0), ("fire_hose", 0.0)])
def test_a_coil_and_a_ribbon_come_to_rest(name, turns):
    user = read_hose_file(find_asset(f"hoses/{name}.toml"))
    fineness = compute_fineness(user)
    assert fineness == max(1, math.ceil(turns / 2.0))
    case = make_case(user)
    found = []
    for n in (24, 48):
        hose = Setting("geds", "statics", n * fineness).make(case)
        case.lay(hose)
        found.append(case.probe(hose))
    # Held at its first place, and the coarse hose agrees with the one twice as fine.
    np.testing.assert_allclose(found[1][:3], user.holds[0].position, atol=1e-9)
    assert np.max(np.abs(found[1] - found[0])) < 0.01 * user.spec.length


@pytest.mark.filterwarnings("ignore:the hose is laid:hose_mj.HoseWarning")
def test_a_director_decides_which_way_a_ribbon_is_stiff():
    user = read_hose_file(find_asset("hoses/fire_hose.toml"))
    drops = []
    # m1 across: the flat side is up, as by default. m1 up: it lies on edge, and twists over.
    for director in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        case = make_case(replace(user, holds=(replace(user.holds[0], director=director),)))
        hose = Setting("geds", "statics", 24).make(case)
        case.lay(hose)
        drops.append(user.holds[0].position[2] - case.probe(hose)[-1])
    flat, on_edge = drops
    assert flat > on_edge + 0.02 * user.spec.length
