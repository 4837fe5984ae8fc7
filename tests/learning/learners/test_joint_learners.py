"""What all learners of joint moves promise alike."""

import numpy as np
import pytest
from hose_learning import rules
from hose_learning.learners.joint import allow_fallbacks
from hose_learning.loop import run_joint
from hose_learning.modules import Module
from hose_learning.tables import find

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task

CASES = {
    "d-ql": ("distributed_q", {}),
    "d-ql-keeping": ("distributed_q", {"keeps_policy": "yes"}),
    "team-q": ("team_q", {}),
    "hysteretic-q": ("hysteretic_q", {}),
    "distributed-rewards": ("distributed_rewards", {}),
    "distributed-values": ("distributed_values", {}),
    "coordinated-q": ("coordinated_q", {}),
    "coordinated-q-ascent": ("coordinated_q", {"solver": "coordinate-ascent", "rounds": 3}),
    "coordinated-q-max-plus": ("coordinated_q", {"solver": "max-plus"}),
    "sparse-q": ("sparse_q", {}),
    "sparse-q-by-agent": ("sparse_q", {"update": "agent", "solver": "max-plus"}),
}
COMPILED = [
    *("d-ql-keeping", "team-q", "hysteretic-q", "distributed-rewards", "distributed-values"),
    *("coordinated-q", "coordinated-q-ascent", "sparse-q", "sparse-q-by-agent"),
]
VETO = Module(name="walls", variables=("p_0", "p_1"), kind="veto", events=("collision",))


def make_modules(case):
    """Goal and collisions apart, where the rule knows how, and a veto module."""
    state = ("p_0", "p_1")
    if case == "d-ql-keeping":
        return (Module(name="all", variables=state, signals=("goal", "collision")), VETO)
    goal = Module(name="goal", variables=state, signals=("goal",))
    own = Module(name="collisions", variables=state, signals=("collision",), credit="own")
    return (goal, own, VETO)


def flatten(memory):
    for value in memory:
        if isinstance(value, tuple):
            yield from flatten(value)
        else:
            yield value


@pytest.fixture
def make(corridor, make_trainee):
    def make(case, task=corridor, **settings):
        file, options = CASES[case]
        modules = settings.pop("modules", make_modules(case))
        settings = {"epsilon": 0.4, "learning_rate": 0.3, "options": options, **settings}
        return make_trainee(file, task, modules=modules, **settings)

    return make


@pytest.mark.parametrize("case", COMPILED)
def test_compiled_equals_plain_python_bit_for_bit(make, case):
    plain, compiled = make(case), make(case)
    assert plain.run(600) == compiled.run(600, run_joint) == 600
    assert plain.memory.table.rows.any()
    assert plain.memory.vetoes.rows.any()
    both = zip(flatten(plain.memory), flatten(compiled.memory), strict=True)
    assert all(np.array_equal(one, other) for one, other in both)


@pytest.mark.parametrize("case", CASES)
def test_a_hashed_table_learns_what_a_dense_one_does(make, case):
    dense, hashed = make(case), make(case, hashed=True)
    dense.run(400)
    hashed.run(400)
    table = hashed.memory.table
    rows = [table.rows[find(table, key)] for key in range(len(dense.memory.table.rows) - 1)]
    assert np.array_equal(rows, dense.memory.table.rows[:-1])
    assert np.array_equal(hashed.memory.stream, dense.memory.stream)


@pytest.mark.parametrize("case", CASES)
def test_a_run_in_parts_is_one_run(make, case):
    whole, parts = make(case), make(case)
    whole.run(300)
    for n_moves in (2, 98, 200):
        parts.run(n_moves)
    both = zip(flatten(whole.memory), flatten(parts.memory), strict=True)
    assert all(np.array_equal(one, other) for one, other in both)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("explores", [True, False])
def test_no_vetoed_action_is_taken(make, case, explores):
    trainee = make(case)
    memory, generator = trainee.memory, np.random.default_rng(3)
    memory.table.rows[:-1] = generator.normal(size=memory.table.rows[:-1].shape)
    if case == "d-ql-keeping":
        memory.table.rows[:-1, -1] = generator.integers(0, 4, len(memory.table.rows) - 1)
    memory.vetoes.rows[:-1] = generator.integers(0, 7, memory.vetoes.rows[:-1].shape)
    counts = np.zeros(2, int)
    for _ in range(60):
        state = trainee.task.make_state()
        state[2:] = generator.choice(7, 2, replace=False)
        trainee.look(state)
        allowed = memory.allowed.copy()
        rule, kernel = trainee.learner.rule, trainee.task.kernel
        rules.choose_joint(rule, kernel, trainee.learner, memory, explores)
        assert ((allowed >> memory.actions) & 1).all()
        counts += [(allowed < 7).sum(), np.isin(allowed, (1, 2, 4)).sum()]
    assert counts.min() > 5


@pytest.mark.parametrize("case", CASES)
def test_where_all_is_vetoed_agents_do_nothing_or_anything(make, case):
    for fallback, seen in (("none", {2}), ("any", {0, 1, 2})):
        trainee = make(case, fallback=fallback)
        trainee.memory.vetoes.rows[:-1] = 7
        chosen = set()
        for _ in range(20):
            trainee.look(trainee.task.reset(np.array([1], np.uint64)))
            rule, kernel = trainee.learner.rule, trainee.task.kernel
            rules.choose_joint(rule, kernel, trainee.learner, trainee.memory, False)
            chosen.update(trainee.memory.actions.tolist())
        assert chosen == seen


@pytest.mark.parametrize("case", [case for case in CASES if case != "d-ql-keeping"])
def test_several_modules_agree_through_their_sum(make, corridor, case):
    # Two modules that are worth a half each choose as one that is worth it all.
    whole = Module(name="all", variables=("p_0", "p_1"), signals=("goal",))
    one = make(case, modules=(whole,), epsilon=0.0)
    two = make(case, modules=(whole, whole), epsilon=0.0)
    values = np.random.default_rng(5).normal(size=one.memory.table.rows[:-1].shape)
    one.memory.table.rows[:-1] = values
    two.memory.table.rows[:-1] = 0.5 * np.concatenate([values, values])
    for cells in ((0, 6), (1, 3), (3, 1), (0, 1)):
        state = corridor.make_state()
        state[2:] = cells
        for trainee in (one, two):
            trainee.look(state)
            rule, kernel = trainee.learner.rule, corridor.kernel
            rules.choose_joint(rule, kernel, trainee.learner, trainee.memory, False)
        assert one.memory.actions.tolist() == two.memory.actions.tolist()


@pytest.mark.parametrize("file", sorted({file for file, _ in CASES.values()}))
def test_an_unknown_option_is_refused(corridor, make_trainee, file):
    with pytest.raises(InputError, match="option is 'no_such'"):
        make_trainee(file, corridor, options={"no_such": 1.0})


@pytest.mark.parametrize(
    ("file", "options", "message"),
    [
        ("distributed_q", {"keeps_policy": "perhaps"}, "keeps_policy is 'perhaps'"),
        ("hysteretic_q", {"beta_ratio": 1.5}, "beta_ratio is 1.5"),
        ("distributed_rewards", {"neighbour_weight": -0.5}, "neighbour_weight is -0.5"),
        ("distributed_values", {"neighbour_weight": 2.0}, "neighbour_weight is 2.0"),
        ("coordinated_q", {"solver": "oracle"}, "solver is 'oracle'"),
        ("coordinated_q", {"rounds": 0}, "rounds is 0"),
        ("coordinated_q", {"graph": "0-2"}, "graph is '0-2'"),
        ("coordinated_q", {"graph": "ring"}, "graph is 'ring'"),
        ("sparse_q", {"update": "never"}, "update is 'never'"),
    ],
)
def test_a_wrong_option_is_refused(corridor, make_trainee, file, options, message):
    with pytest.raises(InputError, match=message):
        make_trainee(file, corridor, options=options)


def test_a_graph_needs_agents_sums_and_no_thresholds(corridor, make_trainee):
    alone = make_task("taxi", starts=((1, 1),), passengers=(("R", "Y"),))
    with pytest.raises(InputError, match="number of agents is 1"):
        make_trainee("coordinated_q", alone)
    with pytest.raises(InputError, match="mediator is 'best-happiness'"):
        make_trainee("sparse_q", corridor, mediator="best-happiness")
    module = Module(name="goal", variables=("p_0",), signals=("goal",), threshold=-1.0)
    with pytest.raises(InputError, match=r"threshold of module 'goal' is -1\.0"):
        make_trainee("sparse_q", corridor, modules=(module,))


def test_fallbacks_open_only_what_is_closed(corridor, make_trainee):
    trainee = make_trainee("hysteretic_q", corridor)
    trainee.look(corridor.reset(np.array([1], np.uint64)))
    trainee.memory.allowed[:] = (0, 0b010)
    allow_fallbacks(corridor.kernel, trainee.learner, trainee.memory)
    assert trainee.memory.allowed.tolist() == [0b100, 0b010]
