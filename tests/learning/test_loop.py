"""The loops: compiled or not, dense or hashed, in chunks or whole: the same learning."""

from itertools import product

import numpy as np
import pytest
from hose_learning import loop
from hose_learning.learners import catalog
from hose_learning.records import EPSILON, FRESH, TEMPERATURE
from hose_learning.settings import Exploration
from hose_learning.study import training as study
from hose_learning.tables import find

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import enumerate_turns
from hose_mj.tasks.kernels import STEPS
from hose_mj.tasks.registry import make_task

TURNS = [id for id, entry in catalog.LEARNERS.items() if entry.schedule == "turns"]
RULES = ("d-rr-ql", "rr-q", "d-rr-ql-messages", "d-rr-ql-traces", "risk-q")
"""One id for each rule."""
SOFT_MAX = Exploration(epsilon=0.8, per_episode=1e-3, policy="soft-max")
FALLING = Exploration(epsilon=0.9, per_episode=1e-3, per_success=2e-3, least=0.1)


@pytest.mark.parametrize("exploration", [FALLING, SOFT_MAX])
@pytest.mark.parametrize("id", RULES)
def test_compiled_equals_uncompiled(make_training, check_same, id, exploration):
    task = make_task("corridor", step_limit=15)
    settings = {"exploration": exploration, "vetoes": "modules", "learning_rate_decay": 1e-3}
    pair = [make_training(task, id, compiled=c, **settings) for c in (True, False)]
    results = [training.advance(moves=2500) for training in pair]
    check_same(*pair)
    assert results[0].moves.tolist() == results[1].moves.tolist()
    assert results[0].returns.tobytes() == results[1].returns.tobytes()
    assert len(results[0]) > 150
    tests = [training.test(3) for training in pair]
    assert tests[0].moves.tolist() == tests[1].moves.tolist()


@pytest.mark.parametrize(
    ("id", "settings"),
    [
        ("safe-msav", {}),
        ("thresholded-msav", {"mediator": "worst-unhappiness"}),
        ("modular-q", {"mediator": "best-happiness", "hashed": True}),
        ("d-rr-ql", {"share_vetoes": True, "fallback": "any"}),
    ],
)
def test_compiled_equals_uncompiled_on_a_hose(make_training, make_line, check_same, id, settings):
    task = make_line(goal="random", step_limit=30)
    pair = [make_training(task, id, compiled=c, epsilon=0.3, **settings) for c in (True, False)]
    for training in pair:
        training.advance(moves=3000)
    check_same(*pair)
    assert pair[0].memory.table.rows.any()


@pytest.mark.parametrize("id", ["d-rr-ql", "rr-q", "d-rr-ql-traces"])
def test_hashed_tables_that_grow_equal_dense_ones(make_training, make_line, shrink_tables, id):
    shrink_tables(64)
    task = make_line()
    common = {"epsilon": 0.7, "values": "monolithic", "vetoes": "monolithic"}
    dense = make_training(task, id, hashed=False, **common)
    hashed = make_training(task, id, hashed=True, **common)
    for training in (dense, hashed):
        training.advance(moves=4000)
    for name in ("table", "vetoes"):
        by_place, by_key = getattr(dense.memory, name), getattr(hashed.memory, name)
        assert len(by_key.keys) > 64
        n_written = 0
        for key, row in enumerate(by_place.rows[:-1]):
            assert by_key.rows[find(by_key, key)].tolist() == row.tolist()
            n_written += row.any()
        assert n_written > 32
    assert dense.memory.stream == hashed.memory.stream


@pytest.mark.parametrize("id", TURNS)
def test_chunks_change_nothing(make_training, make_line, check_same, monkeypatch, id):
    whole, single, logged = (make_training(make_line(), id, epsilon=0.5) for _ in range(3))
    ended = whole.advance(moves=600)
    ones = study.join([single.advance(moves=1) for _ in range(600)])
    monkeypatch.setattr(study, "CHUNK", {False: 7})
    logged._log = study.make_log(2)  # full after two episodes
    parts = study.join(list(logged.advance_in_chunks(moves=600)))
    for other, episodes in ((single, ones), (logged, parts)):
        check_same(whole, other)
        assert episodes.moves.tolist() == ended.moves.tolist()
        assert episodes.returns.tolist() == ended.returns.tolist()


@pytest.mark.parametrize("manner", ["turns", "composed"])
@pytest.mark.parametrize("id", RULES)
def test_tests_change_nothing(make_training, check_same, id, manner):
    task = make_task("corridor", n_cells=5, goal=3, starts=(0, 4))
    tested, other = (make_training(task, id, epsilon=0.5) for _ in range(2))
    for _ in range(5):
        tested.advance(moves=101)
        other.advance(moves=101)
        tested.test(3, manner=manner, max_moves=20)
        check_same(tested, other)


def test_other_seeds_differ(make_training):
    trainings = [make_training(make_task("maze"), "q-learning", seed=seed) for seed in (0, 1)]
    for training in trainings:
        training.advance(moves=300)
    assert (trainings[0].memory.table.rows != trainings[1].memory.table.rows).any()


def list_neighbours(width):
    """All ordered pairs of neighbouring cells of a square."""
    cells = list(product(range(width), repeat=2))
    return [(a, b) for a in cells for b in cells if abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1]


@pytest.mark.parametrize("name", ["line", "taxi"])
def test_after_exhaustive_exploration_vetoes_are_the_constraints(make_training, make_line, name):
    """No unsafe move is allowed any more, and no safe one is vetoed, in any state."""
    tasks = [make_line(goal="none")]
    if name == "taxi":  # side by side in every place: by chance they would seldom meet
        rest = {"passengers": (("R", "G"),), "step_limit": 6}
        tasks = [make_task("taxi", starts=starts, **rest) for starts in list_neighbours(5)]
    training = make_training(tasks[0], "safe-msav", epsilon=1.0)
    for task in tasks:
        training.task = task
        training.memory.counters[FRESH] = 1
        training.advance(moves=25_000 // len(tasks))
    model = enumerate_turns(task, [task.reset(np.array([s], np.uint64)) for s in range(100)])
    probe, scratch = training.memory, task.make_state()
    unsafe = 0
    before = training.memory.state.copy()
    for state, agent in zip(model.states, model.turns, strict=True):
        probe.state[:] = state
        allowed = loop.see(task.kernel, training.learner, probe, agent)
        assert allowed == kernels.compute_safe_mask(task.kernel, state, agent, scratch)
        unsafe += allowed != (1 << task.n_actions) - 1
    assert len(model.states) > 200
    assert unsafe > 100
    training.memory.state[:] = before
    events = training.memory.event_counts.copy()
    broken = [bit for bit in range(len(task.events)) if task.kernel.violations >> bit & 1]
    assert (events[broken] > 0).all()
    training.advance(moves=5000)
    assert (training.memory.event_counts - events)[broken].sum() == 0


def test_a_shared_veto_concerns_everyone_of_the_cycle(make_training):
    """Only robot 0 can hit its wall, at its first move; robot 1 then shares what follows."""
    task = make_task("corridor", step_limit=2)
    for shares in (False, True):
        training = make_training(task, "safe-msav", share_vetoes=shares)
        training.advance(episodes=400)
        vetoed = training.memory.vetoes.rows[:-1, 0].reshape(2, 9)
        start = 0 * 3 + 2
        # Left of the left wall; and, shared, what robot 0 did before robot 1 hit the right one.
        assert vetoed[0, start] == (0b111 if shares else 0b001)
        assert vetoed[1, start] == 0b010


@pytest.mark.parametrize(("fallback", "wanted"), [("none", {2}), ("any", {0, 1, 2})])
def test_where_everything_is_vetoed_the_fallback_is_done(make_training, fallback, wanted):
    task = make_task("corridor")
    training = make_training(task, "safe-msav", fallback=fallback)
    training.memory.vetoes.rows[:, 0] = 0b111
    done = set()
    for _ in range(60):
        training.advance(moves=1)
        done.add(int(training.memory.actions[0]))
    assert done == wanted


@pytest.mark.parametrize("epsilon", [0.0, 0.3, 1.0])
def test_epsilon_greedy_is_what_it_says(make_training, epsilon):
    """The best of four actions is taken in 1 - epsilon + epsilon / 4 of the cases (eq. 3.6)."""
    task = make_task("maze")
    training = make_training(task, "q-learning", epsilon=epsilon)
    memory = training.memory
    memory.table.rows[:, 2] = 5.0
    kernels.reset(task.kernel, memory.state, memory.starts)
    n = 4000
    loop.see(task.kernel, training.learner, memory, 0)
    arguments = (task.kernel, training.learner, memory, 0, 0b1111)
    drawn = np.bincount([loop.choose(*arguments, True) for _ in range(n)], minlength=4)
    best = 1.0 - 0.75 * epsilon
    spread = 4.0 * np.sqrt(n * best * (1.0 - best))
    assert abs(drawn[2] - n * best) <= spread
    assert abs(drawn[[0, 1, 3]] - n * epsilon / 4.0).max() <= 4.0 * np.sqrt(n * epsilon / 4.0)
    assert {loop.choose(*arguments, False) for _ in range(50)} == {2}
    assert 2 not in {loop.choose(*arguments[:-1], 0b1011, True) for _ in range(50)}


def test_epsilon_falls_by_its_closed_form(make_training):
    task = make_task("corridor", step_limit=2)
    exploration = Exploration(
        epsilon=0.9, per_episode=0.01, per_success=0.02, least=0.2, temperature_factor=3.0
    )
    training = make_training(task, "q-learning", exploration=exploration)
    expected, successes = 0.9, 0
    while training.episodes < 60:
        assert training.epsilon == pytest.approx(expected)
        ended = training.advance(episodes=1)
        successes += ended.find_successes(task)[0]
        expected = max(0.2, 0.9 - 0.01 * training.episodes - 0.02 * successes)
        assert training.memory.numbers[TEMPERATURE] == 3.0 * training.memory.numbers[EPSILON]
    assert 0 < successes < 60
    assert training.epsilon == 0.2


def test_moves_episodes_returns_and_events_are_counted(make_training):
    task = make_task("corridor", step_limit=11)
    training = make_training(task, "rr-q")
    ended = training.advance(episodes=150)
    assert len(ended) == training.episodes == 150
    assert ended.moves.sum() == training.moves
    assert ended.moves.max() == 11
    success = ended.find_successes(task)
    assert 0 < success.sum() < 150
    assert (ended.moves[~success] == 11).all()
    assert (ended.moves[success] % 2 == 0).all()  # the goal ends the cycle
    collisions, goals, done = training.memory.event_counts
    assert ended.returns.sum() == 100.0 * goals - 10.0 * collisions
    assert done == success.sum()
    breaks = ended.count_breaks(task)
    assert breaks == {"collision": int((ended.events & 1).sum())}


def test_training_ends_at_moves_or_episodes_whichever_comes_first(make_training):
    task = make_task("corridor", step_limit=10)
    training = make_training(task, "d-rr-ql")
    training.advance(moves=17)
    assert training.moves == 17
    before = training.episodes
    assert len(training.advance(moves=10**6, episodes=4)) == 4
    assert training.episodes == before + 4
    assert len(training.advance(moves=0)) == len(training.advance(episodes=0)) == 0


def test_a_test_follows_the_greedy_policy(make_training):
    """After learning, each start of the maze is as many moves from the goal as it is steps away."""
    task = make_task("maze", start=(3, 1))
    training = make_training(task, "q-learning", learning_rate=1.0)
    training.advance(moves=3000)
    tests = training.test(20)
    assert tests.moves.tolist() == [3] * 20  # along the upper row
    assert tests.find_successes(task).all()
    assert np.isnan(tests.returns).all()
    given_up = training.test(2, max_moves=2)
    assert given_up.moves.tolist() == [2, 2]
    assert not given_up.find_successes(task).any()


@pytest.mark.parametrize("mediator", ["greatest-mass", "worst-unhappiness"])
def test_a_composed_move_is_that_of_table_6_1(make_training, mediator):
    """From both ends only one robot steps onto the goal's cell, in one joint move (Example 1)."""
    task = make_task("corridor")
    falls = Exploration(per_episode=1e-3)
    settings = {"values": "monolithic", "vetoes": "none", "exploration": falls}
    training = make_training(task, "d-rr-ql", mediator=mediator, **settings)
    training.advance(episodes=1200)
    test = training.test(1, manner="composed")
    assert test.moves.tolist() == [2]
    assert task.name_events(int(test.events[0])) == ("goal", "done")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: t.advance(), "moves is None"),
        (lambda t: t.advance(moves=-1), "moves is -1"),
        (lambda t: t.advance(episodes=-1), "episodes is -1"),
        (lambda t: t.test(manner="joint"), "turns or composed for d-rr-ql"),
        (lambda t: t.test(manner="alone"), "manner is 'alone'"),
    ],
)
def test_mistakes(make_training, call, message):
    with pytest.raises(InputError, match=message):
        call(make_training(make_task("corridor"), "d-rr-ql"))


def test_a_step_limit_below_a_cycle_ends_it(make_training):
    training = make_training(make_task("corridor", step_limit=1), "d-rr-ql")
    ended = training.advance(moves=9)
    assert ended.moves.tolist() == [1] * 9
    assert training.memory.state[STEPS] == 1
