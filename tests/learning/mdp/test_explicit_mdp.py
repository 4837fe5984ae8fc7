import numpy as np
import pytest
from hose_learning.mdp.explicit_mdp import (
    MarkovModel,
    compute_safe_actions,
    compute_worth,
    describe_state,
    evaluate,
    solve,
    write_out,
)
from scipy.sparse import csr_array

from hose_mj.errors import InputError
from hose_mj.tasks import exact
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream

GAMMA = 0.9
LINE = {"n_robots": 2, "hose_length": 4, "half_width": 2, "start": ((2, 0), (1, 0))}


def draw_start(task, seed=0):
    return task.reset(make_stream(np.random.default_rng(seed)))


@pytest.fixture
def gamble(model_of):
    # a: 100 with 1/4, else the pit; b: stays.
    return model_of(
        {("s", "a"): {"goal": 0.25, "pit": 0.75}},
        {"s": 0, "goal": 100, "pit": -10},
        {"goal", "pit"},
    )


def test_values_and_safe_actions_by_hand(gamble):
    q_values = solve(gamble, GAMMA)
    expected = 0.25 * 100 - 0.75 * 10
    assert q_values[0] == pytest.approx([expected, GAMMA * expected])
    assert (q_values[1:] == 0.0).all()
    assert evaluate(gamble, np.array([0, 0, 0]), GAMMA) == pytest.approx([expected, 0, 0])
    assert evaluate(gamble, np.array([1, 0, 0]), GAMMA) == pytest.approx([0, 0, 0])
    assert compute_safe_actions(gamble).tolist() == [[False, True], [False, False], [False, False]]


@pytest.mark.parametrize(
    ("id", "settings"),
    [("corridor", {}), ("maze", {}), ("line", {**LINE, "goal": (2, 2)})],
)
def test_a_written_task_has_the_values_of_exact(id, settings):
    task = make_task(id, **settings)
    start = draw_start(task)
    written = write_out(task, [start])
    truth = exact.enumerate_turns(task, [start])
    movers = truth.rewards[np.arange(len(truth.states)), :, truth.turns]
    best = exact.solve(truth, movers, GAMMA)
    mine = solve(written.model, GAMMA)
    for state, events, values, over in zip(
        written.states, written.events, mine, written.model.terminal, strict=True
    ):
        if not over:
            assert values == pytest.approx(best[truth.find(state)], abs=1e-9)
        assert over == bool(events & task.kernel.terminal)
    assert (written.model.rewards == [compute_worth(task, int(e)) for e in written.events]).all()


def test_every_state_has_one_number_and_a_name_of_its_own():
    task = make_task("line", **LINE, goal=(2, 2))
    written = write_out(task, [draw_start(task)])
    assert sorted(written.numbers.values()) == list(range(written.model.n_states))
    assert len(set(written.model.names)) == written.model.n_states
    assert written.model.names[0] == (
        "turn of robot_0, robots [2, 0, 1, 0], source [0, 0], goals [2, 2]"
    )
    assert "stretch" in describe_state(task, written.states[0], 2)


def test_what_is_no_process_is_refused():
    def make(**changed):
        fields = {
            "transitions": csr_array(np.eye(2)),
            "rewards": np.zeros(2),
            "terminal": np.zeros(2, bool),
            "actions": ("a",),
            "names": ("s", "t"),
        }
        return MarkovModel(**{**fields, **changed})

    make()
    with pytest.raises(InputError, match="shapes"):
        make(names=("s",))
    with pytest.raises(InputError, match="sum 1"):
        make(transitions=csr_array(0.5 * np.eye(2)))
    with pytest.raises(InputError, match="terminal"):
        make(terminal=np.array([True, False]))
    with pytest.raises(InputError, match="probabilities"):
        make(transitions=csr_array([[2.0, -1.0], [0.0, 1.0]]))


def test_limits(gamble):
    task = make_task("line", **LINE, goal=(2, 2))
    with pytest.raises(InputError, match="at most 20 states"):
        write_out(task, [draw_start(task)], limit=20)
    for discount in (1.0, -0.1, float("nan")):
        with pytest.raises(InputError, match="discount"):
            solve(gamble, discount)
        with pytest.raises(InputError, match="discount"):
            evaluate(gamble, np.zeros(3, int), discount)
