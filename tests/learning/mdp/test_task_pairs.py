"""Definition 11 on the project's own tasks."""

from itertools import product

import numpy as np
import pytest
from hose_learning.mdp.partially_constrained import (
    PAIRS,
    compute_propositions,
    find_violations,
    make_tasks,
    project_state,
    write_pair,
)

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.kernels import HEADER, TURN
from hose_mj.tasks.registry import make_task

PCMS = [name for name, pair in PAIRS.items() if not pair.violated]


def write(name):
    return write_pair(*make_tasks(PAIRS[name]), np.random.default_rng(0))


@pytest.mark.parametrize("name", PAIRS)
def test_each_ready_pair_violates_what_it_says(name):
    written = write(name)
    violations = find_violations(written.source.model, written.target.model, written.projection)
    assert tuple(v.number for v in violations) == PAIRS[name].violated


def test_there_is_an_example_of_every_property():
    assert {number for pair in PAIRS.values() for number in pair.violated} == {1, 2, 3, 4}
    assert len(PCMS) == 2


@pytest.mark.parametrize("name", PCMS)
def test_propositions_4_and_5(name):
    written = write(name)
    found = compute_propositions(written.source.model, written.target.model, written.projection)
    assert found.unsafe_in_source == 0
    assert found.excess <= 1e-9


def test_a_hose_in_the_way_refutes_the_printed_proposition_5():
    written = write("hose-passes")
    model = written.target.model
    found = compute_propositions(written.source.model, model, written.projection)
    # 100 gamma^8: the goal is eight more moves away, and greedy on the PCM's values never comes.
    assert found.shortfall == pytest.approx(100 * 0.9**8)
    assert found.greedy[found.shortfall_state] == 0.0
    assert not model.terminal[found.shortfall_state]


@pytest.mark.parametrize("name", PCMS)
def test_both_tasks_go_the_same_way_under_the_same_moves(name):
    # Property 2 without matrices: play both tasks side by side, from all states of the target.
    source, target = make_tasks(PAIRS[name])
    written = write(name)
    for state, over in zip(written.target.states, written.target.model.terminal, strict=True):
        if over:
            continue
        for action in range(target.n_actions):
            there, here = project_state(source, target, state), state.copy()
            agent = int(state[TURN])
            there_events = kernels.apply(source.kernel, there, agent, action)
            events = kernels.apply(target.kernel, here, agent, action)
            assert (there[HEADER:] == here[HEADER:]).all()
            assert there_events & ~events == 0


def test_the_floor_flag_is_the_variable_that_a_wide_floor_lacks():
    source, target = make_tasks(PAIRS["wide-floor"])
    written = write("wide-floor")
    out = 1 << target.events.index("out")
    left = (written.target.events & out) != 0
    assert left.any()
    assert (written.source.events[written.projection[left]] == 0).all()
    assert (written.target.model.rewards[left] == -50.0).all()
    assert (written.source.model.rewards[written.projection[left]] == 0.0).all()
    assert source.layout == target.layout


def test_the_witness_of_a_goal_under_the_hose():
    written = write("goal-under-the-hose")
    (violation,) = find_violations(written.source.model, written.target.model, written.projection)
    assert violation.source.endswith("goal: reward 100")
    assert violation.target.endswith("collision: reward -50")
    # The tip has stepped onto (0, 1), which the segment from (0, 2) to the source covers.
    assert "robots [0, 1, 0, 2]" in violation.target


def test_two_constraints_broken_at_once_are_a_matter_of_reading():
    floor = {"n_robots": 2, "hose_length": 6, "start": ((1, 1), (1, 0)), "goal": (2, 2)}
    tasks = (make_task("line", half_width=width, **floor) for width in (3, 2))
    written = write_pair(*tasks, np.random.default_rng(0))
    arguments = (written.source.model, written.target.model, written.projection)
    (violation,) = find_violations(*arguments)
    assert violation.number == 4
    assert violation.target.endswith("out, stretch: reward -100")
    assert violation.source.endswith("stretch: reward -50")
    assert find_violations(*arguments, reading="signs") == []


@pytest.mark.parametrize("id", ["corridor", "maze"])
def test_every_task_is_a_pcm_of_itself_and_its_own_bound(id):
    tasks = make_task(id), make_task(id)
    written = write_pair(*tasks, np.random.default_rng(3))
    assert (written.projection == np.arange(len(written.projection))).all()
    arguments = (written.source.model, written.target.model, written.projection)
    assert find_violations(*arguments) == []
    found = compute_propositions(*arguments)
    assert (found.bounds == found.best).all()


def test_a_part_that_is_shorter_in_the_source_keeps_its_beginning():
    source, target = make_tasks(PAIRS["fewer-passengers"])
    state = np.array([0, 7, 12, 1, 2])
    assert project_state(source, target, state).tolist() == [0, 0, 12, 1]


@pytest.mark.parametrize(
    ("source", "target", "named"),
    [
        (("corridor", {}), ("maze", {}), "agents"),
        (("line", {"n_robots": 2}), ("line", {"n_robots": 3}), "agents"),
        (("maze", {}), ("maze", {"actions": "up"}), "actions"),
        (
            ("taxi", {}),
            ("taxi", {"passengers": (("R", "B"),)}),
            "size of 'passengers' in the source",
        ),
    ],
)
def test_tasks_that_cannot_be_compared_are_refused(source, target, named):
    tasks = (make_task(id, **settings) for id, settings in (source, target))
    with pytest.raises(InputError, match=named):
        write_pair(*tasks, np.random.default_rng(0))


def test_the_limit():
    for name, limit in product(PCMS, (10, 700)):
        with pytest.raises(InputError, match="at most"):
            write_pair(*make_tasks(PAIRS[name]), np.random.default_rng(0), limit)
