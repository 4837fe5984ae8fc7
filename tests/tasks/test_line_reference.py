import numpy as np
import pytest

from hose_mj.tasks import kernels

VARIANTS = [
    *(("line", {"n_robots": n}) for n in range(1, 9)),
    ("line", {"n_robots": 3, "collision": "sweeping"}),
    ("line", {"n_robots": 5, "collision": "robots", "violations_end": False}),
    ("line", {"n_robots": 4, "move_rule": "cancelling", "violations_end": False}),
    ("line", {"n_robots": 5, "half_width": 3, "hose_length": 7, "goal": "none"}),
    # segments longer than those in the cover table
    ("line", {"n_robots": 3, "hose_length": 36, "violations_end": False}),
    ("line-2015", {}),
    ("line-2015", {"start": "random", "goal": "random", "n_robots": 6}),
    ("line-non-cooperative", {"n_robots": 2}),
    ("line-non-cooperative", {"n_robots": 3, "hose_length": 5, "violations_end": False}),
    ("line-single-agent", {"n_robots": 4}),
    ("line-single-agent", {"n_robots": 8, "goal": (3, 4)}),
]
NAMES = [f"{id}-{'-'.join(map(str, settings.values()))}" for id, settings in VARIANTS]


def walk(pair, n_moves):
    """Walks task and reference along, with safe moves, reckless ones and joint ones."""
    task, state = pair.task, pair.state
    choices = np.random.default_rng(7)
    scratch = task.make_state()
    over = True
    for _ in range(n_moves):
        if over:
            pair.reset()
        agent = int(state[kernels.TURN])
        pair.observe(agent)
        if choices.random() < 0.2:
            events = pair.move_jointly(choices.integers(task.n_actions, size=task.n_agents))
        else:
            action = int(choices.integers(task.n_actions))
            safe = kernels.compute_safe_mask(task.kernel, state, agent, scratch)
            if safe and choices.random() < 0.8:
                action = int(choices.choice([a for a in range(task.n_actions) if safe >> a & 1]))
            events = pair.move(agent, action)
        over = kernels.is_over(task.kernel, events) or state[kernels.STEPS] > 200
        if over:
            pair.observe(agent)


@pytest.mark.parametrize(("id", "settings"), VARIANTS, ids=NAMES)
def test_the_compiled_task_equals_its_reference(make_pair, id, settings):
    walk(make_pair(id, **settings), 1000)


@pytest.mark.slow
@pytest.mark.parametrize(("id", "settings"), VARIANTS, ids=NAMES)
def test_the_compiled_task_equals_its_reference_at_length(make_pair, id, settings):
    walk(make_pair(id, **settings), 100_000)
