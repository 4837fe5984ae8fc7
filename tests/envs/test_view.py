"""What is observed: order, names, spaces, and the index against numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from hose_mj.envs.episode import Episode
from hose_mj.envs.view import View
from hose_mj.tasks.registry import make_task


@pytest.fixture
def episode():
    played = Episode(make_task("line", n_robots=3))
    played.reset(np.random.default_rng(5))
    return played


def test_a_team_sees_shared_variables_once(episode):
    view = View(episode.task, ("o_up", "goal", "r_n_1"), "array", range(3))
    assert view.names == ("goal", "r_n_1", "robot_0.o_up", "robot_1.o_up", "robot_2.o_up")
    by_agent = [episode.task.observe(episode.state, agent) for agent in range(3)]
    places = {variable.name: k for k, variable in enumerate(episode.task.variables)}
    expected = [
        by_agent[0][places["goal"]],
        by_agent[0][places["r_n_1"]],
        *(values[places["o_up"]] for values in by_agent),
    ]
    assert view.look(episode.task.kernel, episode.state).tolist() == expected


def test_all_variables_without_a_choice(episode):
    view = View(episode.task, None, "array", [1])
    assert view.names == tuple(variable.name for variable in episode.task.variables)
    seen = view.look(episode.task.kernel, episode.state)
    assert np.array_equal(seen, episode.task.observe(episode.state, 1))


def test_variables_that_say_they_are_shared_are(episode):
    for task in ("line", "line-non-cooperative", "taxi", "corridor"):
        played = Episode(make_task(task))
        played.reset(np.random.default_rng(1))
        shared = [k for k, variable in enumerate(played.task.variables) if not variable.per_agent]
        views = [played.task.observe(played.state, agent) for agent in range(played.task.n_agents)]
        assert all(np.array_equal(view[shared], views[0][shared]) for view in views)


def test_the_index_is_numpys(episode):
    names = ("r_n", "r_p", "o_left", "d_g")
    view = View(episode.task, names, "index", [1])
    seen = view.look(episode.task.kernel, episode.state)
    index = view.shape(seen)
    assert index == np.ravel_multi_index(tuple(seen), tuple(view.cardinalities))
    assert view.make_space().n == np.prod(view.cardinalities)
    many = np.stack([seen, np.zeros_like(seen), view.cardinalities - 1])
    assert view.shape(many).tolist() == [index, 0, np.prod(view.cardinalities) - 1]


def test_the_forms_say_the_same(episode):
    names = ("r_n", "o_left")
    views = {form: View(episode.task, names, form, range(3)) for form in ("array", "dict")}
    seen = views["array"].look(episode.task.kernel, episode.state)
    by_name = views["dict"].shape(seen)
    assert list(by_name) == list(views["array"].names)
    assert [int(value) for value in by_name.values()] == views["array"].shape(seen).tolist()
    assert views["dict"].make_space().contains(by_name)
