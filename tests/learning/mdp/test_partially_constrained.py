"""Definition 11 and Propositions 4 and 5, on pairs made by hand and on random ones."""

from dataclasses import replace

import numpy as np
import pytest
from hose_learning.mdp.explicit_mdp import MarkovModel, solve
from hose_learning.mdp.partially_constrained import (
    choose_greedy,
    compute_propositions,
    find_violations,
)
from scipy.sparse import csr_array

from hose_mj.errors import InputError

GAMMA = 0.9
N_SOURCE, N_HIDDEN, N_ACTIONS = 7, 3, 3


def make_random_pair(seed):
    """A random source; a target with a hidden variable y, some of whose values are undesired."""
    random = np.random.default_rng(seed)
    n = N_SOURCE * N_HIDDEN
    rewards = np.zeros(N_SOURCE)
    rewards[-2:] = 100.0, -50.0
    over = rewards != 0.0
    source = random.dirichlet(np.full(N_SOURCE, 0.3), (N_SOURCE, N_ACTIONS))
    source[:, 0] = np.eye(N_SOURCE)  # an action that changes nothing
    source[over] = 0.0
    hidden = random.dirichlet(np.full(N_HIDDEN, 0.5), (n, N_ACTIONS, N_SOURCE))
    projection = np.repeat(np.arange(N_SOURCE), N_HIDDEN)
    target = (source[projection][..., None] * hidden).reshape(n, N_ACTIONS, n)
    worse = (random.random(n) < 0.3) & (rewards[projection] == 0.0)
    target_rewards = np.where(worse, -20.0, rewards[projection])
    target_over = over[projection] | worse
    target[target_over] = 0.0
    return (
        pack(source, rewards, over),
        pack(target, target_rewards, target_over),
        projection,
    )


def pack(transitions, rewards, over):
    n = len(rewards)
    return MarkovModel(
        transitions=csr_array(transitions.reshape(n * N_ACTIONS, n)),
        rewards=rewards,
        terminal=over,
        actions=("stay", "a", "b"),
        names=tuple(f"s{k}" for k in range(n)),
    )


def unpack(model):
    return model.transitions.toarray().reshape(model.n_states, N_ACTIONS, model.n_states)


@pytest.mark.parametrize("seed", range(20))
def test_random_pcms_and_what_the_propositions_say_of_them(seed):
    source, target, projection = make_random_pair(seed)
    assert find_violations(source, target, projection) == []
    found = compute_propositions(source, target, projection, GAMMA)
    assert found.unsafe_in_source == 0
    assert found.excess <= 1e-9
    assert found.shortfall >= -1e-9
    # The bound holds for each action, not only for the best.
    all_values = solve(source, GAMMA)[projection] - solve(target, GAMMA)
    assert all_values[~target.terminal].min() >= -1e-9


def test_a_state_without_a_projection():
    source, target, projection = make_random_pair(0)
    projection[5] = -1
    (violation,) = find_violations(source, target, projection)
    assert (violation.number, violation.count, violation.state) == (1, 1, 5)
    assert violation.action is None
    assert (violation.source, violation.target) == ("no such state", "s5")


def test_a_transition_of_another_probability():
    source, target, projection = make_random_pair(0)
    state = int(np.flatnonzero(~target.terminal)[2])
    transitions = unpack(target)
    onto = np.bincount(projection, transitions[state, 1], N_SOURCE)
    likely = int(onto.argmax())
    other = (likely + 1) % N_SOURCE
    row = np.where(projection == likely, 0.5, 1.0) * transitions[state, 1]
    row[N_HIDDEN * other] += onto[likely] / 2
    transitions[state, 1] = row
    changed = pack(transitions, target.rewards, target.terminal)
    (violation,) = find_violations(source, changed, projection)
    assert (violation.number, violation.count) == (2, 1)
    assert (violation.state, violation.action) == (state, 1)
    assert violation.target.startswith(f"s{state} -- a -> ")
    assert violation.source.startswith(f"s{projection[state]} -- a -> ")


@pytest.mark.parametrize(
    ("reward", "number"), [(99.0, 3), (0.0, 3), (-1.0, 4), (-100.0, 4), (100.0, None)]
)
def test_another_reward_of_a_goal(reward, number):
    source, target, projection = make_random_pair(0)
    rewards = target.rewards.copy()
    goal = int(np.flatnonzero(rewards == 100.0)[0])
    rewards[goal] = reward
    violations = find_violations(source, replace(target, rewards=rewards), projection)
    assert [v.number for v in violations] == ([] if number is None else [number])
    for violation in violations:
        assert (violation.count, violation.state) == (1, goal)
        assert violation.target == f"s{goal}: reward {reward:g}"
        assert violation.source == f"s{projection[goal]}: reward 100"


def test_an_undesired_state_may_be_worse_in_one_reading_only():
    source, target, projection = make_random_pair(0)
    rewards = np.where(target.rewards == -50.0, -70.0, target.rewards)
    worse = replace(target, rewards=rewards)
    (violation,) = find_violations(source, worse, projection)
    assert (violation.number, violation.count) == (4, N_HIDDEN)
    assert find_violations(source, worse, projection, reading="signs") == []


def test_figure_7_2s_kind_of_pair(model_of):
    # Two transitions of the target that differ in y alone are one of the source, summed up.
    source = model_of({("x0", "a"): {"x1": 0.7, "G": 0.3}}, {"x0": 0, "x1": 0, "G": 1}, {"G"})
    target = model_of(
        {
            ("x0y0", "a"): {"x1y0": 0.2, "x1y1": 0.5, "Gy0": 0.3},
            ("x0y1", "a"): {"x1y1": 0.7, "Gy0": 0.3},
        },
        {"x0y0": 0, "x0y1": 0, "x1y0": 0, "x1y1": -1, "Gy0": 1},
        {"Gy0", "x1y1"},
    )
    projection = np.array([0, 0, 1, 1, 2])
    assert find_violations(source, target, projection) == []
    wrong = model_of(
        {("x0y0", "a"): {"x1y0": 0.2, "x1y1": 0.4, "Gy0": 0.4}, ("x0y1", "a"): {"x1y1": 1.0}},
        dict(zip(target.names, target.rewards, strict=True)),
        {"Gy0", "x1y1"},
    )
    (violation,) = find_violations(source, wrong, projection)
    assert (violation.number, violation.count, violation.action) == (2, 2, 0)
    assert violation.source == "x0 -- a -> x1 with probability 0.7 or G with probability 0.3"
    assert "x1y1 with probability 0.4" in violation.target


def make_detour(model_of, undesired):
    """From s, a leads by door and hall to G, b by a longer way; hall may be undesired."""
    return model_of(
        {
            ("s", "a"): {"door": 1.0},
            ("s", "b"): {"1": 1.0},
            ("door", "a"): {"hall": 1.0},
            ("door", "b"): {"s": 1.0},
            ("hall", "a"): {"G": 1.0},
            ("1", "a"): {"2": 1.0},
            ("2", "a"): {"3": 1.0},
            ("3", "a"): {"G": 1.0},
        },
        {"s": 0, "door": 0, "hall": -10 if undesired else 0, "1": 0, "2": 0, "3": 0, "G": 100},
        {"G", "hall"} if undesired else {"G"},
    )


def test_the_printed_proposition_5_is_false(model_of):
    source, target = (make_detour(model_of, undesired) for undesired in (False, True))
    projection = np.arange(7)
    assert find_violations(source, target, projection) == []
    found = compute_propositions(source, target, projection, GAMMA)
    assert found.unsafe_in_source == 0
    assert found.excess <= 1e-12
    # The source sends the agent to the door, where only the way back is safe: for ever.
    assert found.best[0] == pytest.approx(100 * GAMMA**3)
    assert found.bounds[0] == pytest.approx(100 * GAMMA**2)
    assert found.greedy[:2].tolist() == [0.0, 0.0]
    assert found.shortfall == pytest.approx(100 * GAMMA**3)
    assert found.shortfall_state == 0


def test_the_corrected_proposition_5_needs_a_source_that_is_worth_something(model_of):
    # In the target the episode ends, cheaply, before the source's unavoidable loss.
    rewards = {"s": 0, "t": 0, "pit": -100}
    moves = {(s, a): {e: 1.0} for s, e in (("s", "t"), ("t", "pit")) for a in "ab"}
    source = model_of(moves, rewards, {"pit"})
    target = model_of(moves, {**rewards, "t": -1}, {"pit", "t"})
    assert find_violations(source, target, np.arange(3)) == []
    found = compute_propositions(source, target, np.arange(3), GAMMA)
    assert found.best[0] == -1.0
    assert found.bounds[0] == pytest.approx(-90.0)
    assert found.excess == pytest.approx(89.0)
    # With an action that costs nothing the source is worth 0, and the bound is back.
    idle = {key: value for key, value in moves.items() if key[1] == "a"}
    pair = (model_of(idle, rewards, {"pit"}), model_of(idle, {**rewards, "t": -1}, {"pit", "t"}))
    assert find_violations(*pair, np.arange(3)) == []
    assert compute_propositions(*pair, np.arange(3), GAMMA).excess <= 0.0


def test_greedy_keeps_to_what_is_allowed():
    values = np.array([[1.0, 5.0, 3.0], [2.0, 1.0, 0.0], [0.0, 0.0, 7.0]])
    allowed = np.array([[True, False, True], [True, True, True], [False, False, False]])
    assert choose_greedy(values, allowed).tolist() == [2, 0, 2]


def test_pairs_that_do_not_fit_are_refused(model_of):
    source, target, projection = make_random_pair(0)
    with pytest.raises(InputError, match="actions of the target"):
        find_violations(replace(source, actions=("x", "a", "b")), target, projection)
    with pytest.raises(InputError, match="shape of the projection"):
        find_violations(source, target, projection[:-1])
    for wrong in (-2, N_SOURCE):
        with pytest.raises(InputError, match="projection"):
            find_violations(source, target, np.where(projection == 0, wrong, projection))
