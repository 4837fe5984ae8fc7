"""What every learner of the catalog does on every kind of task, whatever its rule."""

import numpy as np
import pytest
from hose_learning.learners.catalog import list_learners, make_settings
from hose_learning.settings import Exploration
from hose_learning.study.run_folder import describe, flatten, load_memory, remake, save_memory
from hose_learning.study.training import Training

from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task

TASKS = {
    "maze": {},
    "corridor": {},
    "line": {"n_robots": 2, "half_width": 2, "hose_length": 4, "goal": (1, 1), "step_limit": 40},
    "taxi": {"passengers": (("R", "G"),), "step_limit": 60},
}
SEED = 11
LEARNERS = list_learners()


def make(id, name, **settings):
    """Makes an uncompiled training; a joint learner may refuse to be alone."""
    task = make_task(name, **TASKS[name])
    settings.setdefault("exploration", Exploration(epsilon=0.6, per_episode=1e-3))
    made = make_settings(id, task, **settings)
    try:
        return Training(task, id, made, np.random.default_rng(SEED), compiled=False)
    except InputError as error:
        if LEARNERS[id].schedule == "turns" or task.n_agents > 1:
            raise
        pytest.skip(str(error))


def check_same(one, other):
    arrays, others = flatten(one.memory), flatten(other.memory)
    assert list(arrays) == list(others)
    for name, array in arrays.items():
        assert array.tobytes() == others[name].tobytes(), name


@pytest.fixture(params=[(id, name) for id in LEARNERS for name in TASKS], ids="-".join)
def pair(request):
    return request.param


def test_same_seed_same_result_saved_or_not(pair, tmp_path):
    once, stopped = make(*pair), make(*pair)
    once.advance(moves=500)
    stopped.advance(moves=300)
    path = tmp_path / "last.npz"
    save_memory(path, stopped.memory)
    again = remake(describe(stopped, SEED))
    again._compiled = False
    again.restore(load_memory(path, again.memory))
    check_same(again, stopped)
    again.advance(moves=once.moves - again.moves)
    check_same(once, again)
    # A goal module has nothing to learn from before the taxis first deliver everyone.
    assert once.memory.table.rows.any() or pair[1] == "taxi"


def test_it_counts_tests_and_ends(pair):
    training = make(*pair)
    task = training.task
    ended = training.advance(moves=400)
    assert 400 <= training.moves < 400 + task.n_agents
    assert len(ended) == training.episodes > 0
    assert ended.moves.min() > 0
    assert ended.moves.max() <= task.step_limit
    assert np.isfinite(training.memory.table.rows).all()
    before = {name: array.copy() for name, array in flatten(training.memory).items()}
    tests = training.test(3)
    assert len(tests) == 3
    assert tests.moves.max() <= task.step_limit + task.n_agents - 1
    for name, array in flatten(training.memory).items():
        assert array.tobytes() == before[name].tobytes(), name


# Not a careful learner's defaults: the goal is to count soon.
BOLD = {"risk-q": {"settle_episodes": 0, "xi_step": 1.0, "xi_most": 1e6}}


@pytest.mark.parametrize("id", LEARNERS)
def test_it_learns_the_maze(id):
    """Every start is at most six steps from the goal; by chance it takes twenty."""
    falls = Exploration(per_episode=0.02)
    settings = {"vetoes": "none", "values": "monolithic", "options": BOLD.get(id, {})}
    training = make(id, "maze", exploration=falls, **settings)
    training.advance(episodes=150)
    tests = training.test(30)
    assert tests.find_successes(training.task).all()
    assert tests.moves.max() <= 6


@pytest.mark.parametrize("id", LEARNERS)
def test_vetoes_combine_with_it(id):
    """Once every wall was hit in every way, none is hit again."""
    training = make(id, "maze", exploration=Exploration(), vetoes="modules")
    training.advance(moves=1500)
    vetoes = training.memory.vetoes.rows[:-1, 0]
    # o_up, o_down, o_left, o_right, the last one running fastest; never all four at once.
    task = training.task
    state, stream = task.make_state(), np.array([1], np.uint64)
    for _ in range(40):
        kernels.reset(task.kernel, state, stream)
        flags = task.observe(state, 0)[2:]
        assert vetoes[flags @ [8, 4, 2, 1]] == flags @ [1, 2, 4, 8]
    hit = training.memory.event_counts[0]
    assert hit > 0
    training.advance(moves=1500)
    assert training.memory.event_counts[0] == hit


@pytest.mark.parametrize("id", LEARNERS)
def test_an_entry_says_what_it_is(id):
    entry = LEARNERS[id]
    assert entry.description
    assert entry.section
    assert not entry.description.endswith(".")
    training = make(id, "corridor")
    assert training.learner.rule is not None
    assert {module.kind for module in training.settings.modules} <= {"value", "veto"}
    other = "turns" if entry.schedule == "joint" else "joint"
    with pytest.raises(InputError, match="manner"):
        training.test(manner=other)
