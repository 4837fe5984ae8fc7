"""Algorithm 6.2 beside 6.1: the same learning, only spread over the agents."""

import pytest

from hose_mj.tasks.registry import make_task


@pytest.mark.parametrize("vetoes", ["none", "modules"])
@pytest.mark.parametrize("name", ["corridor", "line"])
def test_6_2_equals_6_1_at_every_move(make_training, make_line, name, vetoes):
    task = make_task("corridor", step_limit=9) if name == "corridor" else make_line()
    central, distributed = (
        make_training(
            task,
            id,
            seed=5,
            epsilon=0.4,
            vetoes=vetoes,
            learning_rate=0.3,
            learning_rate_decay=0.01,
        )
        for id in ("rr-q", "d-rr-ql-messages")
    )
    for _ in range(1500):
        central.advance(moves=1)
        distributed.advance(moves=1)
        for field in ("state", "actions", "stream", "starts", "counters", "numbers"):
            one, other = getattr(central.memory, field), getattr(distributed.memory, field)
            assert (one == other).all(), field
        assert (central.memory.table.rows == distributed.memory.table.rows).all()
    assert (central.memory.vetoes.rows == distributed.memory.vetoes.rows).all()
    assert central.episodes > 10
    assert central.memory.table.rows.any()


@pytest.mark.parametrize("id", ["rr-q", "d-rr-ql-messages"])
def test_the_move_before_the_last_learns_when_an_episode_is_cut_off(make_training, id):
    # In one move agent 0 learns r + gamma max_a Q(s', a, 1) = r; agent 1 never moves.
    task = make_task("corridor", step_limit=1)
    training = make_training(task, id, learning_rate=1.0)
    training.advance(episodes=30)
    rows = training.memory.table.rows[:-1]
    assert rows[0 * 3 + 2].tolist() == [-10.0, 100.0, 0.0]
    assert not rows[9:].any()
