"""Ready modules: each choice fits each task, and they are those of the thesis's chapters."""

import numpy as np
import pytest
from hose_learning.learner import make_learner
from hose_learning.presets import VALUES, VETOES, find_parts, make_modules
from hose_learning.settings import LearnerSettings

from hose_mj.errors import InputError
from hose_mj.tasks.registry import TASKS, make_task

SMALL = {"line": {"n_robots": 2, "half_width": 3, "hose_length": 6}}


@pytest.mark.parametrize("vetoes", VETOES)
@pytest.mark.parametrize("values", VALUES)
@pytest.mark.parametrize("id", TASKS)
def test_each_choice_fits_each_task(id, values, vetoes):
    small = SMALL["line"] if id.startswith("line") and id != "line-2015" else {}
    task = make_task(id, **small)
    modules = make_modules(task, values, vetoes)
    settings = LearnerSettings(modules=modules, hashed=True)
    learner, _ = make_learner(task, settings, None, np.random.default_rng(0))
    kinds = [module.kind for module in modules]
    assert kinds[0] == "value"
    assert (len(kinds) == 1) == (vetoes == "none")
    assert learner.has_thresholds == (vetoes == "thresholds")
    if vetoes in ("modules", "monolithic"):
        # What breaks a constraint is vetoed by some module, whatever the action.
        answered = np.bitwise_or.reduce(learner.veto_events)
        assert answered & task.kernel.violations == task.kernel.violations
        for event in range(len(task.events)):
            answers = learner.veto_events >> event & 1 == 1
            if task.kernel.violations >> event & 1:
                actions = np.bitwise_or.reduce(learner.veto_actions[answers])
                assert actions == (1 << task.n_actions) - 1
    if vetoes in ("thresholds", "values"):
        assert (learner.rewards[:, 0, 1:] == 0.0).all()  # each robot's own constraints
        assert learner.rewards[:, 1, 1:].min() < 0.0


# Cardinality of r_n and r_p by the number of robots (thesis Table 4.1).
@pytest.mark.parametrize(("n", "places"), [(2, 197), (3, 89), (4, 49), (5, 37), (6, 21)])
def test_the_tables_of_chapter_4_have_the_sizes_of_its_variables(n, places):
    task = make_task("line", n_robots=n)
    for vetoes in ("modules", "thresholds"):
        settings = LearnerSettings(modules=make_modules(task, "goal", vetoes), hashed=False)
        _, memory = make_learner(task, settings, None, np.random.default_rng(0))
        vetoed = n * (places**2 + 2**4 + 441)
        in_values = 0 if vetoes == "modules" else vetoed
        assert len(memory.table.rows) - 1 == n * 24 * 8 + in_values
        assert len(memory.vetoes.rows) - 1 == vetoed - in_values


def test_the_goal_module_of_chapter_6_sees_the_formation():
    task = make_task("line", n_robots=3, goal=(2, 1))
    assert find_parts(task).goal == ("r_n_1", "r_n_2", "r_n_3")
    assert find_parts(make_task("line")).goal == ("d_g", "theta_g")


def test_each_robot_of_a_single_agent_has_its_own_vetoes():
    task = make_task("line-single-agent", n_robots=2)
    modules = make_modules(task, "goal", "modules")
    assert [module.name for module in modules[1:]] == [
        f"{what}_{robot}" for robot in (0, 1) for what in ("distances", "collisions", "grid")
    ]
    for module in modules[1:]:
        assert {action[-1] for action in module.actions} == {module.name[-1]}
        assert len(module.actions) == 4
        assert all(name.endswith(module.name[-1]) for name in module.variables)


def test_a_task_that_is_not_listed_is_seen_as_a_whole(make_chain):
    parts = find_parts(make_chain(cliff=True))
    assert parts.state == parts.goal == ("cell",)
    assert parts.signals == ("goal",)
    assert [(c.name, c.events) for c in parts.constraints] == [("fall", ("fall",))]


def test_a_threshold_is_taken(make_line):
    modules = make_modules(make_line(), "goal", "thresholds", -3.0)
    assert [module.threshold for module in modules] == [None, -3.0, -3.0, -3.0]


@pytest.mark.parametrize(("values", "vetoes"), [("moon", "none"), ("goal", "moon")])
def test_unknown_choices(make_line, values, vetoes):
    with pytest.raises(InputError, match="is 'moon'"):
        make_modules(make_line(), values, vetoes)
