"""Definition 10 on the project's own tasks."""

import numpy as np
import pytest
from hose_learning.mdp.sequential_realization import (
    MoveOutcome,
    compare,
    move_alone,
    move_jointly,
    study_sequential,
)

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream

LINE = {
    "n_robots": 2,
    "hose_length": 4,
    "half_width": 3,
    "start": ((2, 0), (1, 0)),
    "goal": (3, 0),
}
NONE = 2


def study(id, settings, **arguments):
    task = make_task(id, **settings)
    start = task.reset(make_stream(np.random.default_rng(0)))
    return study_sequential(task, [start], **arguments)


@pytest.mark.parametrize(
    ("id", "settings"),
    [
        ("corridor", {"goal_ends": "move"}),
        ("corridor", {"goal_ends": "move", "n_cells": 5, "starts": (0, 4), "goal": 2}),
        *(("line", {**LINE, "collision": c}) for c in ("entering", "sweeping", "robots")),
        ("line", {**LINE, "move_rule": "cancelling"}),
    ],
)
def test_tasks_that_are_sequential_realizations(id, settings):
    found = study(id, settings)
    assert found.violations == ()
    n_actions = 3 if id == "corridor" else 5
    assert found.n_moves == found.n_states * 2 * n_actions


def test_table_6_2s_corridor_differs_in_when_it_ends():
    found = study("corridor", {})
    (violation,) = found.violations
    assert violation.number == 3
    assert violation.action == "right"
    assert "the end" in violation.jointly
    assert "the end" not in violation.alone
    # Robot 0 enters the goal from the start; in the middle of a cycle it is there, and may stay or
    # be run into. Robot 1 ends the cycle, so its own moves end alike.
    assert violation.agent == "robot_0"


def test_each_robots_own_reward_differs_where_a_segment_has_two_ends():
    # In turns the mover pays for a stretch; in a joint move both ends of the segment do.
    (violation,) = study("line", LINE, sharing="each").violations
    assert violation.number == 2
    assert "stretch; rewards -50, 0; the end" in violation.alone
    assert "stretch; rewards -50, -50; the end" in violation.jointly


def test_without_a_null_action_the_taxi_is_not_realized():
    with pytest.raises(InputError, match="idle action is 'none'; valid: one of up, right"):
        study("taxi", {})
    one_passenger = {"passengers": (("R", "B"),)}
    violations = study("taxi", one_passenger, idle="pick").violations
    assert [v.number for v in violations] == [1]
    assert "passengers [0]" in violations[0].alone
    assert "passengers [2]" in violations[0].jointly


def test_a_joint_action_of_one_is_read_off_both_kernels():
    # Table 6.1: {right, none} brings 100 for both, {left, none} -10 for both.
    task = make_task("corridor", goal_ends="move")
    start = task.reset(make_stream(np.random.default_rng(0)))
    for action, reward, over in ((0, -10.0, False), (1, 100.0, True), (NONE, 0.0, False)):
        alone = move_alone(task, start, 0, action, "each")
        jointly = move_jointly(task, start, 0, action, NONE, "each")
        for outcome in (alone, jointly):
            assert outcome.rewards.tolist() == [reward, reward]
            assert outcome.over == over
        assert compare(alone, jointly) == []
        assert move_alone(task, start, 0, action, "team").rewards.tolist() == [reward]


def test_every_difference_is_seen():
    same = MoveOutcome(np.array([0, 0, 3, 4]), 1, np.array([1.0, 2.0]), False)
    assert compare(same, MoveOutcome(np.array([1, 7, 3, 4]), 2, np.array([1.0, 2.0]), False)) == []
    assert compare(same, MoveOutcome(np.array([0, 0, 3, 5]), 1, np.array([1.0, 2.0]), False)) == [1]
    assert compare(same, MoveOutcome(np.array([0, 0, 3, 4]), 1, np.array([1.0, 2.5]), False)) == [2]
    assert compare(same, MoveOutcome(np.array([0, 0, 3, 4]), 1, np.array([1.0, 2.0]), True)) == [3]


@pytest.mark.parametrize("id", ["maze", "line-single-agent", "taxi-single-agent"])
def test_a_single_agent_has_no_turns(id):
    with pytest.raises(InputError, match="agents move in turn"):
        study(id, {})


def test_the_limit():
    with pytest.raises(InputError, match="at most 50 states"):
        study("line", LINE, limit=50)
