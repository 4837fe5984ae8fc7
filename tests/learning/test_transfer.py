"""Eqs 7.1 and 7.2 for every state and action, and what learning goes on from."""

from __future__ import annotations

import dataclasses
from itertools import product

import numpy as np
import pytest
from hose_learning import transfer as transfer_module
from hose_learning.learners import catalog
from hose_learning.loop import see
from hose_learning.mdp.joint_policy import make_evaluate, make_key
from hose_learning.settings import Exploration
from hose_learning.study.training import Training
from hose_learning.tables import claim, find, make_table
from hose_learning.transfer import TransferPlan, list_vetoes, make_tasks, run_trial, transfer

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import enumerate_turns
from hose_mj.tasks.kernels import TURN
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import draw_below, make_stream

ONE_TAXI = {"starts": ((2, 2),), "passengers": (("R", "B"),)}
TWO_PASSENGERS = {"starts": ((2, 2),), "passengers": (("R", "B"), ("G", "Y"))}
SMALL_LINE = {"n_robots": 2, "half_width": 3, "hose_length": 6, "goal": (2, 2)}


def make_training(task, hashed=None, **exploration):
    settings = catalog.make_settings(
        "d-rr-ql", task, hashed=hashed, exploration=Exploration(**exploration)
    )
    return Training(task, "d-rr-ql", settings, np.random.default_rng(0), compiled=False)


def fill(training, seed, share=1.0):
    """Writes random values and vetoes under every key, or under a share of them."""
    generator = np.random.default_rng(seed)
    for kind, table in (("value", training.memory.table), ("veto", training.memory.vetoes)):
        n_parts = training.task.n_agents
        sizes = [
            training.task.make_projection(m.variables).size
            for m in training.settings.modules
            if m.kind == kind
        ]
        for key in range(sum(sizes) * n_parts):
            if generator.random() < share:
                row = claim(table, key)
                if kind == "value":
                    table.rows[row] = generator.normal(size=table.rows.shape[1])
                else:
                    table.rows[row, 0] = generator.integers(0, 1 << training.task.n_actions)


def read(training, name, agent, values):
    """The row of a module in which variables have these values, looked up from first principles."""
    task, modules = training.task, training.settings.modules
    (module,) = [m for m in modules if m.name == name]
    alike = [m for m in modules if m.kind == module.kind]
    counts = {v.name: v.cardinality for v in task.variables}
    key = 0
    for other in alike[: alike.index(module)]:
        key += task.n_agents * int(np.prod([counts[n] for n in other.variables]))
    shape = [counts[n] for n in module.variables]
    key += agent * int(np.prod(shape))
    key += int(np.ravel_multi_index([values[n] for n in module.variables], shape))
    table = training.memory.table if module.kind == "value" else training.memory.vetoes
    return table.rows[find(table, key)].tolist()


@pytest.mark.parametrize("hashed", list(product([False, True], repeat=2)))
@pytest.mark.parametrize("share", [1.0, 0.3])
def test_every_state_that_looks_alike_gets_the_row(hashed, share):
    source = make_training(make_task("taxi", **ONE_TAXI), hashed[0])
    target = make_training(make_task("taxi", **TWO_PASSENGERS), hashed[1])
    fill(source, 1, share)
    assert transfer(source, target) == ("goal", "flags")
    for cell, first, second in product(range(25), range(3), range(3)):
        values = {"taxi_0": cell, "passenger_0": first, "passenger_1": second}
        assert read(target, "goal", 0, values) == read(source, "goal", 0, values)  # eq. 7.1
    for flags in product(range(2), repeat=4):
        values = dict(zip(("o_up", "o_down", "o_left", "o_right"), flags, strict=True))
        assert read(target, "flags", 0, values) == read(source, "flags", 0, values)  # eq. 7.2


def test_variables_may_stand_in_another_order():
    task = make_task("taxi", **TWO_PASSENGERS)
    source, target = make_training(make_task("taxi", **ONE_TAXI)), make_training(task)
    goal, flags = target.settings.modules
    shuffled = dataclasses.replace(goal, variables=("passenger_1", "passenger_0", "taxi_0"))
    settings = dataclasses.replace(target.settings, modules=(flags, shuffled))
    target = Training(task, "d-rr-ql", settings, np.random.default_rng(0), compiled=False)
    fill(source, 2)
    transfer(source, target)
    for cell, first, second in product(range(25), range(3), range(3)):
        values = {"taxi_0": cell, "passenger_0": first, "passenger_1": second}
        assert read(target, "goal", 0, values) == read(source, "goal", 0, values)


def add_wall(task):
    """The taxi's map with a wall above the cell (3, 2)."""
    walls = task.kernel.walls.copy()
    walls[5 * 3 + 2, 0] = walls[5 * 2 + 2, 2] = 1
    return dataclasses.replace(task, kernel=task.kernel._replace(walls=walls))


PAIRS = {
    "a wall more": (
        make_task("taxi", **TWO_PASSENGERS),
        add_wall(make_task("taxi", **TWO_PASSENGERS)),
    ),
    "a passenger more": (make_task("taxi", **ONE_TAXI), make_task("taxi", **TWO_PASSENGERS)),
    "the hose blocks": (
        make_task("line", **SMALL_LINE, collision="robots"),
        make_task("line", **SMALL_LINE, collision="entering"),
    ),
    "the goal ends a move": (make_task("corridor"), make_task("corridor", goal_ends="move")),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_what_agents_see_after_a_transfer(pair):
    """Q_t(s, a) = Q_s([s], a) and A_t(s) = A_s([s]) in every state that can be reached."""
    source, target = map(make_training, PAIRS[pair])
    fill(source, 3)
    transfer(source, target)
    below, above = make_evaluate(source), make_evaluate(target)
    start = target.task.reset(make_stream(np.random.default_rng(0)))
    model = enumerate_turns(target.task, [start])
    compared = 0
    for state in model.states:
        agent = int(state[TURN])
        projected = project(source.task, target.task, state)
        values = above(agent, make_key(state))
        if source.task.variables == target.task.variables:
            seen = source.task.observe(projected, agent), target.task.observe(state, agent)
            if (seen[0] != seen[1]).any():
                continue  # a flag means another thing there: nothing is said about the pair
        assert values == below(agent, make_key(projected))
        compared += 1
    assert compared >= len(model.states) / 2


def project(source, target, state):
    """[s]: a target's state without what the source does not have."""
    projected = source.make_state()
    projected[:2] = state[:2]
    for name, part in source.layout.items():
        n = part.stop - part.start
        projected[part] = state[target.layout[name]][:n]
    return projected


@pytest.mark.parametrize("hashed", [False, True])
def test_no_veto_of_the_source_is_wrong_on_the_target_or_lost(hashed):
    """Proposition 4 on a pair of tasks, and learning that goes on."""
    below, above = PAIRS["the hose blocks"]
    source = make_training(below, hashed)
    source.advance(moves=6000)
    target = make_training(above, hashed, epsilon=0.5)
    transfer(source, target)
    first = list_vetoes(target)
    assert len(first) > 50
    assert first == list_vetoes(source)
    target.advance(moves=3000)
    assert first < list_vetoes(target)
    state, stream = above.make_state(), make_stream(np.random.default_rng(1))
    n_vetoed = 0
    for _ in range(300):
        kernels.reset(above.kernel, state, stream)
        agent = int(draw_below(stream, 2))
        target.memory.state[:] = state
        allowed = see(above.kernel, target.learner, target.memory, agent)
        safe = kernels.compute_safe_mask(above.kernel, state, agent, state.copy())
        assert safe & ~allowed == 0  # no safe action is vetoed
        n_vetoed += bin(~allowed & (1 << above.n_actions) - 1).count("1")
    assert n_vetoed > 100


def test_the_target_keeps_what_is_its_own():
    source = make_training(make_task("corridor"))
    source.advance(episodes=20)
    target = make_training(make_task("corridor"), epsilon=0.25)
    transfer(source, target)
    assert (target.moves, target.episodes, target.epsilon) == (0, 0, 0.25)
    assert (target.memory.table.rows == source.memory.table.rows).all()
    target.memory.table.rows[:] += 1.0
    assert not (target.memory.table.rows == source.memory.table.rows).any()


def test_a_hashed_table_grows_to_hold_it():
    """5,000 rows of two taxis' agents become 20,000, of which 8,192 fit at first."""
    source = make_training(make_task("taxi", passengers=(("R", "B"),)), True)
    target = make_training(make_task("taxi"), True)
    fill(source, 5)
    transfer(source, target)
    table = target.memory.table
    assert 2 * table.used[0] <= len(table.keys)
    assert table.used[0] == 4 * source.memory.table.used[0] == 4 * 2 * 25 * 25 * 4
    generator = np.random.default_rng(6)
    for _ in range(200):
        agent, *places = generator.integers(0, (2, 25, 25, 4, 4)).tolist()
        values = dict(zip(("taxi_0", "taxi_1", "passenger_0", "passenger_1"), places, strict=True))
        assert read(target, "goal", agent, values) == read(source, "goal", agent, values)


def test_modules_with_no_namesake_start_from_nothing():
    task = make_task("corridor")
    source = make_training(task)
    fill(source, 4)
    plain = catalog.make_settings("d-rr-ql", task, vetoes="none")
    target = Training(task, "d-rr-ql", plain, np.random.default_rng(0), compiled=False)
    assert transfer(source, target) == ("goal",)
    renamed = tuple(dataclasses.replace(m, name=m.name + "_2") for m in plain.modules)
    other = dataclasses.replace(plain, modules=renamed)
    target = Training(task, "d-rr-ql", other, np.random.default_rng(0), compiled=False)
    with pytest.raises(InputError, match="modules of the target"):
        transfer(source, target)


def test_what_does_not_fit():
    corridor = make_training(make_task("corridor"))
    with pytest.raises(InputError, match="agents of the source"):
        transfer(make_training(make_task("taxi", **ONE_TAXI)), corridor)
    with pytest.raises(InputError, match="number of values of the source's p_0 is 4; valid: 3"):
        transfer(make_training(make_task("corridor", n_cells=4)), corridor)
    two = make_training(make_task("taxi", **TWO_PASSENGERS))
    with pytest.raises(
        InputError, match="module goal is 'passenger_1'; valid: taxi_0, passenger_0"
    ):
        transfer(two, make_training(make_task("taxi", **ONE_TAXI)))
    wider = make_training(make_task("corridor"))
    wider.restore(wider.memory._replace(table=make_table(18, 9, float)))
    with pytest.raises(InputError, match="laid out as those of d-rr-ql"):
        transfer(wider, corridor)
    moved = make_training(make_task("corridor"))
    moved.advance(moves=1)
    with pytest.raises(InputError, match="must not have learned"):
        transfer(corridor, moved)


def test_too_much_to_copy(monkeypatch):
    source = make_training(make_task("taxi", **ONE_TAXI))
    target = make_training(make_task("taxi", **TWO_PASSENGERS))
    fill(source, 7)
    monkeypatch.setattr(transfer_module, "LARGEST", 75 * 3 - 1)
    with pytest.raises(InputError, match="rows of module goal is 225; valid: at most 224"):
        transfer(source, target)
    assert not target.memory.table.rows.any()
    monkeypatch.setattr(transfer_module, "LARGEST", 2)
    with pytest.raises(InputError, match="variables that only the target sees"):
        transfer(source, target)


PLAN = TransferPlan(
    source="line",
    target="line",
    source_options={"n_robots": 1, "half_width": 2, "hose_length": 3, "collision": "robots"},
    target_options={"n_robots": 1, "half_width": 2, "hose_length": 3},
    moves=1500,
    episodes=3,
    exchange=(1e6, 1.0),
)


@pytest.fixture
def uncompiled(monkeypatch):
    class Plain(Training):
        def __init__(self, *arguments):
            super().__init__(*arguments, compiled=False)

    monkeypatch.setattr(transfer_module, "Training", Plain)


def test_both_tasks_get_one_configuration():
    source, target = make_tasks(PLAN, np.random.default_rng(5))
    assert source.settings.start == target.settings.start != "random"
    assert source.settings.goal == target.settings.goal != "random"
    assert source.settings.collision == "robots"
    fixed = dataclasses.replace(PLAN, target_options={**PLAN.target_options, "goal": (1, 1)})
    assert make_tasks(fixed, np.random.default_rng(5))[1].settings.goal == (1, 1)


def test_a_trial(uncompiled):
    outcome, again = (run_trial(PLAN, np.random.default_rng(2)) for _ in range(2))
    assert outcome == again
    assert outcome.modules == ("goal", "distances", "collisions", "grid")
    # One robot on an open field: what was learned is right on the target from the first episode.
    assert outcome.source_reached
    assert outcome.reached == (True, True, True)
    assert outcome.vetoes_lost == 0
    assert [moves for moves, _ in outcome.controls] == [outcome.moves, outcome.moves + 1500]
    assert outcome.controls[1][1]  # 1500 moves at random on 25 cells meet the goal
