"""What every case promises, and the static errors that the comparison is known to find."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from hose_mj.errors import InputError
from hose_mj.hoses.registry import MODELS
from hose_mj.validation import cases
from hose_mj.validation.case import read_texts
from hose_mj.validation.cases import CASES, TRIALS, find_cases
from hose_mj.validation.compare import INEXTENSIBLE
from hose_mj.validation.motions import make_held_capstan
from hose_mj.validation.run import simulate
from hose_mj.validation.settings import FULL, QUICK, Setting, list_ladders, list_static

STATIC = [case for case in CASES if case.motion is None]
DYNAMIC = [case for case in CASES if case.motion is not None]
PAIRS = [(case, model) for case in CASES for model in case.models]
COARSE = {"geds": 12, "cable": 10, "flex": 10, "hinge-chain": 10}


def name(value):
    return getattr(value, "id", value)


def make(case, model, resolution, *, corrected=None):
    if corrected is None and model != "geds" and case.clamped:
        corrected = True
    return Setting(model, "statics", resolution, corrected).make(case)


def find_coarse(case, model):
    return case.resolutions.get(model, (COARSE[model],))[0]


def measure(case, model, resolution, **options):
    """Signed errors of the probe, as fractions of what the case states them by."""
    hose = make(case, model, resolution, **options)
    case.lay(hose)
    truth = case.truth()
    return (case.probe(hose) - truth) / (case.scale or np.abs(truth))


def test_ids_are_unique_and_start_with_their_family():
    ids = [case.id for case in CASES]
    assert len(set(ids)) == len(ids)
    families = {case.family for case in CASES}
    for case in CASES:
        assert case.id == case.family or case.id.startswith(case.family + "-")
        # A family's name alone selects all its values, so it may not be the id of one of several.
        if case.id in families:
            assert [other.id for other in CASES if other.family == case.id] == [case.id]


def test_every_text_belongs_to_a_case():
    names = {name for case in CASES for name in (case.id, case.family)}
    names |= {trial.id for trial in TRIALS}
    assert set(read_texts()) <= names
    assert not any("{}" in case.title for case in CASES)


def test_the_published_ids_are_there():
    wanted = {
        *("heavy-cantilever", "tip-load", "end-moment", "frequencies", "hanging-chain"),
        *("catenary", "euler-buckling", "released-rod", "taut-pull", "free-flight"),
        *("bend-45", "ring-twist", "greenhill", "helix", "coil"),
        *("mooring", "capstan", "held-capstan", "floor-tow", "obstacle-drop"),
    }
    assert wanted <= {case.family for case in CASES}
    ids = {case.id for case in CASES}
    assert {"heavy-cantilever-gamma-10", "tip-load-1", "released-rod"} <= ids


@pytest.mark.parametrize("case", CASES, ids=name)
def test_a_case_says_what_it_is(case):
    assert case.title.strip()
    assert case.about.endswith(".")
    assert len(case.gravity) == 3
    assert case.models
    assert set(case.models) <= set(MODELS)
    assert (case.motion is None) == (case.truth is not None)
    if case.motion is not None:
        assert case.scale is not None
        assert list(case.steps) == sorted(case.steps, reverse=True)


@pytest.mark.parametrize(("case", "model"), PAIRS, ids=name)
def test_every_model_of_a_case_can_be_laid(case, model):
    hose = make(case, model, find_coarse(case, model))
    holds = case.lay(hose)
    places = np.linspace(0.0, case.spec.length, 9)
    points = hose.position(places)
    assert np.all(np.isfinite(points))
    if case.planar:
        # Laid in the xz-plane, in which the planar models move.
        np.testing.assert_allclose(points[:, 1], 0.0, atol=1e-9)
    assert len({hold.number for hold in holds}) == len(holds)
    if case.clamped:
        assert any(hold.fixes_tangent for hold in holds)
    for hold in holds:
        at = hose.position(hold.arc_length)
        assert np.all(np.isfinite(at))


@pytest.mark.parametrize(("case", "model"), PAIRS, ids=name)
def test_the_probe_answers_in_the_shape_of_the_truth(case, model):
    hose = make(case, model, find_coarse(case, model))
    case.lay(hose)
    values = case.probe(hose)
    assert values.ndim == 1
    assert np.all(np.isfinite(values))
    if case.truth is not None:
        truth = case.truth()
        assert truth.shape == values.shape
        assert np.all(np.isfinite(truth))
        # An error may be stated as a fraction of the truth only where that is not zero.
        assert case.scale is not None or np.all(truth != 0.0)
    else:
        # Motions are compared as points in space.
        assert len(values) % 3 == 0


@pytest.mark.parametrize("case", DYNAMIC, ids=name)
def test_time_steps_divide_the_pauses_between_samples(case):
    pause = case.motion.duration / case.motion.n_samples
    for grid in (QUICK, FULL):
        for ladder in list_ladders(case, case.models, grid):
            steps = [setting.timestep for setting in ladder]
            assert steps == sorted(steps, reverse=True)
            parts = pause / np.array(steps)
            np.testing.assert_allclose(parts, np.round(parts), rtol=1e-9)


@pytest.mark.parametrize("case", DYNAMIC, ids=name)
def test_the_grid_of_a_motion_has_all_halves_of_a_chains_steps(case):
    for ladder in list_ladders(case, tuple(set(case.models) & set(INEXTENSIBLE)), FULL):
        steps = np.array([setting.timestep for setting in ladder])
        for step in steps[steps > 2.0 * steps[-1]]:
            assert np.min(np.abs(steps / (0.5 * step) - 1.0)) < 1e-9


@pytest.mark.parametrize("case", CASES, ids=name)
def test_labels_tell_settings_apart(case):
    for grid in (QUICK, FULL):
        if case.motion is None:
            settings = list(list_static(case, case.models, grid))
        else:
            settings = [s for ladder in list_ladders(case, case.models, grid) for s in ladder]
        assert len({setting.label for setting in settings}) == len(settings)


@pytest.mark.parametrize("case", STATIC, ids=name)
def test_geds_keeps_its_promise(case):
    for n, limit in (case.promised or {20: 1e-3}).items():
        assert np.max(np.abs(measure(case, "geds", n))) < limit


@pytest.mark.parametrize("case", CASES, ids=name)
def test_promises_are_those_of_the_issue(case):
    promised = {
        "capstan": {20: 0.01},
        "held-capstan": {20: 0.01},
        "bend-45": {12: 1e-3},
        "ring-twist": {16: 5e-3, 24: 5e-4},
        "greenhill": {16: 2e-3},
        "helix": {100: 5e-3, 130: 1e-3},
        "coil": {96: 5e-3},
    }
    if case.family in promised:
        assert case.promised == promised[case.family]
    if case.id == "floor-tow":
        assert case.promise == 0.005


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
@pytest.mark.parametrize(("turns", "limit"), [(0.25, 0.01), (0.5, 0.01), (1.0, 0.01), (1.5, 0.02)])
def test_a_capstan_slides_and_holds_at_any_wrap(turns, friction, limit):
    case = make_held_capstan(turns, friction)
    slides, held = measure(case, "geds", 48)
    assert abs(slides) < limit
    assert abs(held) < 0.02  # the elastic hose slips back by as much where it stops


def test_a_slow_tow_stays_with_the_minimiser():
    (case,) = find_cases(("floor-tow",))
    reference = case.reference()
    assert reference.uncertainty < case.uncertainty
    hose = Setting("geds", "bdf2", 16, None, case.steps[0]).make(case)
    _, values, _, _ = simulate(case, hose)
    gap = (values - reference.values).reshape(len(values), -1, 3)
    assert np.max(np.linalg.norm(gap, axis=2)) < case.promise * case.spec.length


def test_obstacles_reach_every_model():
    (case,) = find_cases(("obstacle-drop",))
    for model in case.models:
        hose = make(case, model, COARSE[model])
        case.lay(hose)
        hose.step(round(0.3 / hose.timestep))
        tip = hose.position(1.0)[0]
        # Free, it would hang 0.9 m below the wall by now; the bar holds its middle.
        assert hose.position(0.5)[0, 2] > -0.2
        assert tip[2] < -0.1


@pytest.mark.parametrize("gamma", [1, 10])
@pytest.mark.parametrize("model", ["cable", "hinge-chain"])
def test_mujocos_documented_clamp_has_the_published_errors(model, gamma):
    """A whole rigid first segment: -19 / -9.7 / -5 % with 10 / 20 / 40 segments."""
    (case,) = find_cases((f"heavy-cantilever-gamma-{gamma}",))
    errors = [measure(case, model, n, corrected=False)[0] for n in (10, 20, 40)]
    np.testing.assert_allclose(errors, [-0.19, -0.097, -0.05], rtol=0, atol=2e-3)


@pytest.mark.parametrize("model", INEXTENSIBLE)
def test_corrected_clamps_err_by_the_square_of_the_segment_length(model):
    (case,) = find_cases(("heavy-cantilever-gamma-1",))
    segments = np.array([10, 20, 40])
    errors = [abs(measure(case, model, n)[0]) for n in segments]
    orders = np.diff(np.log(errors)) / np.diff(np.log(1.0 / (segments - 0.5)))
    np.testing.assert_allclose(orders, 2.0, atol=0.05)
    assert errors[0] < 0.01


def test_a_driven_hold_starts_from_its_own_hose():
    """What one hose leaves behind must not reach the next, even through an equal handle."""
    (case,) = find_cases(("taut-pull-suture",))
    first = None
    for n in (8, 24):
        hose = make(case, "geds", n)
        holds = case.lay(hose)
        first = first or holds
        assert first == holds
        before = hose.position(0.5 * case.spec.length)[0]
        case.motion.drive(hose, first, 0.0)
        hose.step()
        after = hose.position(0.5 * case.spec.length)[0]
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-12 * case.spec.length)


@pytest.mark.filterwarnings("ignore:a hold moves:hose_mj.HoseWarning")  # to the end in one step
def test_drives_end_where_the_case_says():
    for case_id, place in (("taut-pull-hose", (0.995, 0.0, 0.0)), ("taut-pull-suture", None)):
        (case,) = find_cases((case_id,))
        hose = make(case, "geds", 12)
        holds = case.lay(hose)
        moved = holds[1] if place else holds[2]
        case.motion.drive(hose, holds, case.motion.duration)
        hose.step()
        expected = place or (0.049, 0.0, 0.0105)
        found = hose.position(moved.arc_length)[0]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_find_cases_by_id_family_and_all():
    assert find_cases(()) == CASES
    assert [case.id for case in find_cases(("tip-load-2",))] == ["tip-load-2"]
    assert [case.id for case in find_cases(("tip-load",))] == [
        *("tip-load-1", "tip-load-2", "tip-load-5", "tip-load-10")
    ]


def test_find_cases_answers_in_the_order_of_the_list_and_each_once():
    found = find_cases(("released-rod", "tip-load-5", "tip-load", "tip-load-5"))
    assert [case.id for case in found] == [
        *("tip-load-1", "tip-load-2", "tip-load-5", "tip-load-10", "released-rod")
    ]


@pytest.mark.parametrize("unknown", ["tip", "tip-load-3", "", "Released-rod"])
def test_an_unknown_case_is_answered_with_the_families(unknown):
    with pytest.raises(InputError) as caught:
        find_cases(("catenary", unknown))
    message = str(caught.value)
    assert message.startswith(f"case is {unknown!r}; valid: ")
    for case in CASES:
        assert case.family in message


PLUGIN = """
from dataclasses import replace
from hose_mj.validation.statics import make_tip_load

ONE = replace(make_tip_load(3.0), id="my-load")

def list_some():
    return [replace(ONE, id="my-first", family="mine"), replace(ONE, id="my-second", family="mine")]

def list_nonsense():
    return [ONE, "no case"]
"""


@pytest.fixture
def plug_in(tmp_path, monkeypatch):
    """Lets other packages name these things of a module in `hose_mj.cases`."""
    (tmp_path / "my_plugin.py").write_text(PLUGIN)
    monkeypatch.syspath_prepend(tmp_path)

    def plug(*names):
        found = {n: EntryPoint(n, f"my_plugin:{n}", "hose_mj.cases") for n in names}
        monkeypatch.setattr(cases, "find_plugins", lambda group: found)
        cases.list_plugin_cases.cache_clear()

    yield plug
    cases.list_plugin_cases.cache_clear()


def test_cases_of_other_packages_are_found_by_id_and_family(plug_in):
    plug_in("ONE", "list_some")
    assert [case.id for case in find_cases(("my-load",))] == ["my-load"]
    assert [case.id for case in find_cases(("mine", "tip-load-1"))] == [
        *("tip-load-1", "my-first", "my-second"),
    ]
    assert find_cases(()) == CASES
    with pytest.raises(InputError, match="mine"):
        find_cases(("nonsense",))


@pytest.mark.parametrize(("names", "what"), [(["list_nonsense"], "Case"), (["missing"], "missing")])
def test_a_plugin_that_is_no_case_is_left_out(plug_in, names, what):
    plug_in(*names, "list_some")
    with pytest.warns(RuntimeWarning, match=what), pytest.raises(InputError, match="my-load"):
        find_cases(("my-load",))
    assert len(find_cases(("mine",))) == 2


def test_an_id_that_is_taken(plug_in):
    plug_in("ONE", "list_some")
    cases.find_plugins(None)["again"] = EntryPoint("again", "my_plugin:ONE", "hose_mj.cases")
    with pytest.warns(RuntimeWarning, match="again is left out: id of a case .* 'my-load'"):
        assert len(find_cases(("mine", "my-load"))) == 3
