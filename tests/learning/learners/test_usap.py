"""Undesired state-action prediction: the balanced buffer, the flat forest, vetoes."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from hose_learning.experience import record_experience
from hose_learning.learners import usap
from hose_learning.learners.usap import UndesiredPredictor
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.ensemble import RandomForestClassifier
from sklearn.tree import DecisionTreeClassifier

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import draw_below, make_stream

TAXI = make_task("taxi", step_limit=10**9)
N_VARIABLES, N_ACTIONS = len(TAXI.variables), TAXI.n_actions


def make_predictor(seed=0, task=TAXI, **options):
    return UndesiredPredictor(task, np.random.default_rng(seed), **options)


def predict(predictor, values, agent):
    forest = predictor.forest
    return np.array([usap.predict_undesired(forest, values, agent, a) for a in range(N_ACTIONS)])


def fill(predictor, moves=1500, seed=1):
    log = record_experience(TAXI, moves, np.random.default_rng(seed))
    for values, agent, action, undesired in zip(
        log.values, log.agents, log.actions, log.undesired, strict=True
    ):
        predictor.remember(values, int(agent), int(action), bool(undesired))
    return log


instances = st.lists(
    st.tuples(st.integers(0, 1), st.integers(0, N_ACTIONS - 1), st.booleans()), max_size=150
)


@settings(max_examples=40, deadline=None)
@given(instances, st.integers(1, 5))
def test_the_buffer_keeps_of_each_action_and_class_up_to_its_capacity_and_only_what_was_seen(
    given_instances, capacity
):
    predictor = make_predictor(capacity=capacity, minimum=1, refit_every=10**6)
    seen = {}
    for number, (agent, action, undesired) in enumerate(given_instances):
        values = np.full(N_VARIABLES, number)
        predictor.remember(values, agent, action, undesired)
        seen.setdefault((agent, action, int(undesired)), []).append(number)
    for place in np.ndindex(*predictor.buffer.counts.shape):
        here = seen.get(place, [])
        count = predictor.buffer.counts[place]
        assert count == min(len(here), capacity)
        kept = predictor.buffer.values[place][:count]
        assert (kept == kept[:, :1]).all()
        numbers = kept[:, 0].tolist()
        assert set(numbers) <= set(here)
        assert len(set(numbers)) == count
        if len(here) <= capacity:
            assert numbers == here
        if here:
            assert here[-1] in numbers  # the newest one always gets in
    for agent in range(2):
        attributes, undesired = predictor.list_instances(agent)
        assert len(attributes) == predictor.buffer.counts[agent].sum()
        assert undesired.sum() == predictor.buffer.counts[agent, :, usap.UNDESIRED].sum()
        for row, label in zip(attributes, undesired, strict=True):
            assert (agent, row[-1], label) == given_instances[row[0]]


def test_every_place_is_as_likely_to_be_replaced():
    """2000 instances too many on 10 places: 200 each, with a deviation of 13."""
    predictor = make_predictor(capacity=10, minimum=1, refit_every=10**6)
    replaced = np.zeros(10, int)
    kept = predictor.buffer.values[0, 0, 0, :, 0]
    for number in range(2010):
        before = kept.copy()
        predictor.remember(np.full(N_VARIABLES, number + 1), 0, 0, False)
        if number >= 10:
            (place,) = np.flatnonzero(kept != before)
            replaced[place] += 1
    assert (np.abs(replaced - 200) < 70).all()


@pytest.mark.parametrize("classifier", ["tree", "forest"])
def test_the_flat_forest_answers_as_scikit_learn_does(classifier):
    """The same instances and seed give the same trees; then any values and actions."""
    predictor = make_predictor(classifier=classifier, minimum=1, refit_every=10**6)
    fill(predictor)
    attributes, undesired = predictor.list_instances(1)
    seed = int(draw_below(predictor.stream.copy(), 2**31))
    predictor.fit(1)
    model = (
        DecisionTreeClassifier(criterion="entropy", random_state=seed)
        if classifier == "tree"
        else RandomForestClassifier(10, criterion="entropy", max_features=4, random_state=seed)
    )
    model.fit(attributes, undesired)
    generator = np.random.default_rng(2)
    sizes = [variable.cardinality for variable in TAXI.variables]
    for values in generator.integers(0, sizes, (200, N_VARIABLES)):
        rows = np.column_stack([np.tile(values, (N_ACTIONS, 1)), np.arange(N_ACTIONS)])
        expected = model.predict_proba(rows)[:, 1]
        expected[(predictor.forest.trained[1] == 0).any(axis=1)] = 0.0
        assert predict(predictor, values, 1) == pytest.approx(expected, abs=1e-12)
        mask = sum(1 << a for a in range(N_ACTIONS) if predict(predictor, values, 1)[a] >= 0.5)
        assert predictor.veto_mask(values, 1) == mask


def test_compiled_code_gets_the_same_mask_and_fills_the_same_buffer():
    @numba.njit
    def run(buffer, forest, values, agent, action, stream):
        usap.add_instance(buffer, values, agent, action, 1, stream)
        return usap.compute_veto_mask(forest, values, agent)

    # Five instances a class: most of these replace one, at a place that the stream draws.
    one, other = (make_predictor(capacity=5, minimum=1, refit_every=50) for _ in range(2))
    fill(one, 400)
    fill(other, 400)
    log = record_experience(TAXI, 100, np.random.default_rng(9))
    for values, agent, action in zip(log.values, log.agents, log.actions, strict=True):
        mask = run(one.buffer, one.forest, values, agent, action, one.stream)
        assert mask == other.veto_mask(values, agent)
        usap.add_instance(other.buffer, values, agent, action, 1, other.stream)
    assert all(np.array_equal(a, b) for a, b in zip(one.buffer, other.buffer, strict=True))


def teach_flags(predictor):
    """Every place of taxi 0, and what each move there does."""
    record, state, scratch = TAXI.kernel, TAXI.make_state(), TAXI.make_state()
    pairs = [(a, b) for a in range(25) for b in range(25) if a != b]
    told = []
    for cell, other in pairs:
        kernels.begin(state)
        state[TAXI.layout["taxis"]] = cell, other
        values = TAXI.observe(state, 0)
        safe = kernels.compute_safe_mask(record, state, 0, scratch)
        for action in range(N_ACTIONS):
            predictor.remember(values, 0, action, not safe >> action & 1)
        told.append((values, safe))
    predictor.fit(0)
    return told


@pytest.mark.parametrize("minimum", [1, 100])
def test_after_all_pairs_were_remembered_exactly_the_undesired_actions_are_vetoed(minimum):
    predictor = make_predictor(capacity=700, minimum=minimum, refit_every=10**6)
    for values, safe in teach_flags(predictor):
        assert predictor.veto_mask(values, 0) == (1 << N_ACTIONS) - 1 & ~safe


@pytest.mark.parametrize("minimum", [3, 4])
def test_no_action_is_vetoed_below_the_minimum_of_either_class(minimum):
    """Action 0 has 3 undesired and 9 safe instances, action 1 has 9 and 3, action 2 only bad."""
    predictor = make_predictor(minimum=minimum, refit_every=10**6)
    bad, good = np.full(N_VARIABLES, 1), np.zeros(N_VARIABLES, int)
    for action, n_bad, n_good in ((0, 3, 9), (1, 9, 3), (2, 9, 0)):
        for _ in range(n_bad):
            predictor.remember(bad, 0, action, True)
        for _ in range(n_good):
            predictor.remember(good, 0, action, False)
    assert predictor.veto_mask(bad, 0) == 0  # nothing is fitted yet
    predictor.fit(0)
    assert predictor.veto_mask(bad, 0) == (0b11 if minimum == 3 else 0)
    assert predictor.veto_mask(good, 0) == 0
    assert predictor.veto_mask(bad, 1) == 0  # the other agent has seen nothing


def test_what_was_remembered_after_a_fit_counts_from_the_next_one_on():
    predictor = make_predictor(minimum=2, refit_every=10**6)
    bad, good = np.full(N_VARIABLES, 1), np.zeros(N_VARIABLES, int)
    for _ in range(2):
        predictor.remember(bad, 0, 0, True)
    predictor.remember(good, 0, 0, False)
    predictor.fit(0)
    predictor.remember(good, 0, 0, False)
    assert predictor.veto_mask(bad, 0) == 0
    predictor.fit(0)
    assert predictor.veto_mask(bad, 0) == 1


@pytest.mark.parametrize(("veto_probability", "mask"), [(0.5, 1), (np.nextafter(0.5, 1.0), 0)])
def test_one_half_is_vetoed_by_algorithm_8_1_and_not_by_8_2(veto_probability, mask):
    predictor = make_predictor(minimum=1, veto_probability=veto_probability)
    values = np.zeros(N_VARIABLES, int)
    for undesired in (True, False):
        predictor.remember(values, 0, 0, undesired)
    predictor.fit(0)
    assert predict(predictor, values, 0)[0] == 0.5
    assert predictor.veto_mask(values, 0) == mask


def test_a_fit_is_made_after_so_many_moves_of_an_agent():
    predictor = make_predictor(minimum=1, refit_every=6)
    bad, good = np.full(N_VARIABLES, 1), np.zeros(N_VARIABLES, int)
    masks = []
    for k in range(12):
        predictor.remember(bad if k % 2 else good, 0, 0, bool(k % 2))
        predictor.remember(bad, 1, 1, True)  # another agent's moves neither hasten nor delay it
        masks.append(predictor.veto_mask(bad, 0))
    assert masks == [0] * 5 + [1] * 7
    assert predictor.forest.trained[0, 0].tolist() == [6, 6]
    assert not predictor.forest.trained[1].any()  # one class alone is no training set


def test_random_moves_under_the_vetoes_rarely_collide():
    """Half as often at most as without vetoes, the time to learn them left out."""
    predictor = make_predictor(refit_every=50)
    generator = np.random.default_rng(3)
    state = TAXI.reset(make_stream(generator))
    collided = []
    for _ in range(2500):
        agent = int(state[kernels.TURN])
        values = TAXI.observe(state, agent)
        vetoed = predictor.veto_mask(values, agent)
        allowed = [a for a in range(N_ACTIONS) if not vetoed >> a & 1]
        action = int(generator.choice(allowed))
        events = kernels.apply(TAXI.kernel, state, agent, action)
        collided.append(events & TAXI.kernel.violations != 0)
        predictor.remember(values, agent, action, collided[-1])
    free = record_experience(TAXI, 2500, np.random.default_rng(3))
    assert np.mean(collided[500:]) < 0.5 * free.undesired[500:].mean()


def get_arrays(predictor):
    return [a for a in (*predictor.buffer, *predictor.forest, predictor.stream) if np.ndim(a)]


def test_a_seed_fixes_everything():
    one, same = make_predictor(capacity=20), make_predictor(capacity=20)
    for predictor in (one, same):
        fill(predictor)
    assert all(map(np.array_equal, get_arrays(one), get_arrays(same)))
    assert not np.array_equal(make_predictor(1).stream, make_predictor(2).stream)


def test_the_arrays_stay_where_they_are():
    """A compiled loop that was given them sees every fit."""
    predictor = make_predictor()
    before = get_arrays(predictor)
    fill(predictor)
    assert all(now is then for now, then in zip(get_arrays(predictor), before, strict=True))
    assert predictor.forest.trained.sum() > 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"classifier": "oracle"},
        {"capacity": 0},
        {"minimum": 0},
        {"minimum": 101},
        {"refit_every": 0},
        {"veto_probability": 0.0},
        {"veto_probability": 1.1},
    ],
)
def test_wrong_options_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        make_predictor(**wrong)
