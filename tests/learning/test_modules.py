"""Modules as data: the keys of what they see, their rewards, events and actions."""

import numpy as np
import pytest
from hose_learning import loop
from hose_learning.learner import make_learner
from hose_learning.modules import (
    Module,
    make_arrays,
    make_masks,
    make_module_rewards,
)
from hose_learning.settings import LearnerSettings

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task

SEEN = (("d_g", "theta_g"), (), ("p",))


def make_modules(**settings):
    return [Module(name=str(k), variables=names, **settings) for k, names in enumerate(SEEN)]


def test_keys_are_numpys_mixed_radix_one_part_after_the_other(make_line):
    task = make_line(goal="random")
    values, vetoes = make_modules(), make_modules(kind="veto", events=("out",))
    settings = LearnerSettings(modules=(*values, *vetoes))
    learner, memory = make_learner(task, settings, None, np.random.default_rng(1))
    sizes = [24 * 8, 1, 25]
    assert len(memory.table.rows) - 1 == len(memory.vetoes.rows) - 1 == 2 * sum(sizes)
    names = [variable.name for variable in task.variables]
    radix = {variable.name: variable.cardinality for variable in task.variables}
    for _ in range(50):
        memory.state[:] = task.reset(memory.starts)
        for agent in (0, 1):
            loop.see(task.kernel, learner, memory, agent)
            seen = dict(zip(names, task.observe(memory.state, agent).tolist(), strict=True))
            first = 0
            for module, variables in enumerate(SEEN):
                index = np.ravel_multi_index(
                    [seen[v] for v in variables] or [0], [radix[v] for v in variables] or [1]
                )
                expected = first + agent * sizes[module] + index
                assert memory.keys[agent, module] == expected
                assert memory.veto_keys[agent, module] == expected
                first += 2 * sizes[module]


def test_a_team_has_one_part(make_line):
    arrays = make_arrays(make_line(), make_modules(), 1)
    assert arrays.bases.tolist() == [[0], [192], [193]]
    assert arrays.size == 192 + 1 + 25


def test_rewards_of_a_cycle_and_of_ones_own_moves(make_line):
    task = make_line(goal_reward=7.0, violation_reward=-3.0)
    modules = [
        Module(name="both", variables=(), signals=("goal", "out")),
        Module(name="own", variables=(), signals=("goal", "stretch"), credit="own"),
    ]
    rewards = make_module_rewards(task, modules)
    bits = {name: 1 << bit for bit, name in enumerate(task.events)}
    assert rewards.shape == (2**4, 2, 2)
    # [another agent's move, one's own] by module; only the goal is shared.
    assert rewards[bits["goal"]].tolist() == [[7.0, 0.0], [7.0, 7.0]]
    assert rewards[bits["out"]].tolist() == [[0.0, 0.0], [-3.0, 0.0]]
    assert rewards[bits["out"] | bits["stretch"]].tolist() == [[0.0, 0.0], [-3.0, -3.0]]
    assert rewards[bits["collision"]].tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert not rewards[0].any()


def test_events_and_actions_as_bits(make_line):
    task = make_line()
    modules = [
        Module(name="a", variables=(), kind="veto", events=("out", "collision")),
        Module(name="b", variables=(), kind="veto", events=("goal",), actions=("up", "none")),
    ]
    assert make_masks("event", task.events, [m.events for m in modules]).tolist() == [0b101, 0b1000]
    assert make_masks(
        "action", task.action_names, [m.actions or task.action_names for m in modules]
    ).tolist() == [0b11111, 0b10001]


@pytest.mark.parametrize(
    ("module", "message"),
    [
        ({"variables": ("moon",)}, "variable is 'moon'"),
        ({"variables": ("p", "p")}, "'p' only once"),
        ({"variables": (), "signals": ("moon",)}, "signal is 'moon'"),
        ({"variables": (), "kind": "veto", "events": ("moon",)}, "event is 'moon'"),
        ({"variables": (), "kind": "veto", "actions": ("jump",)}, "action is 'jump'"),
        ({"variables": (), "kind": "vote"}, "kind of module one is 'vote'"),
        ({"variables": (), "credit": "none"}, "credit of module one is 'none'"),
    ],
)
def test_wrong_names(make_line, module, message):
    def make():
        modules = (Module(name="goal", variables=()), Module(name="one", **module))
        make_learner(make_line(), LearnerSettings(modules=modules), None, np.random.default_rng(1))

    with pytest.raises(InputError, match=message):
        make()


def test_more_states_than_numbers():
    task = make_task("line", n_robots=2)
    sees = ("r_n_1", "r_n_2", "p", "r_g", "goal", "d_g")  # 197^2 441 41^2 441 24
    with pytest.raises(InputError, match=r"fewer than 2\^62 states"):
        make_arrays(task, [Module(name=str(k), variables=sees) for k in range(10_000)], 2)
