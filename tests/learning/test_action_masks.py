"""Learned vetoes as action masks: what they forbid, that something is left, that they grow."""

from __future__ import annotations

from itertools import product

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import TimeLimit
from hose_learning.action_masks import MaskedEnv, SharedPolicyEnv, VetoMasks
from hose_learning.learners import catalog
from hose_learning.loop import compute_unvetoed
from hose_learning.study.training import Training
from hose_learning.tables import FIRST_CAPACITY, SLOTS_PER_KEY

import hose_mj.envs  # noqa: F401  (registers the ids)
from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.turns import TurnsEnv
from hose_mj.errors import InputError
from hose_mj.tasks import kernels
from hose_mj.tasks.exact import enumerate_turns
from hose_mj.tasks.kernels import HEADER
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.stream import make_stream
from hose_mj.tasks.task import Task
from hose_mj.tasks.variables import Variable


class Ledge:
    """A plain Python task: three places, a fall at both ends; nobody may wait at the left one."""

    n_agents, n_actions, step_limit = 1, 3, 50
    terminal = violations = 1
    success = shared = 0
    reward_table = np.array([[0.0], [-1.0]])


@kernels.reset.register
def reset_ledge(record: Ledge, state, stream):
    kernels.begin(state)
    state[HEADER] = 0


@kernels.apply.register
def apply_ledge(record: Ledge, state, agent, action):
    state[HEADER] += (-1, 1, 0)[action]
    kernels.end_turn(record, state, agent)
    return int(not 0 <= state[HEADER] <= 2)


@kernels.apply_joint.register
def apply_joint_ledge(record: Ledge, state, actions, charged):
    charged[0] = apply_ledge(record, state, 0, actions[0])
    return int(charged[0])


@kernels.observe.register
def observe_ledge(record: Ledge, state, agent, values):
    values[0] = np.clip(state[HEADER], 0, 2)


@kernels.mask.register
def mask_ledge(record: Ledge, state, agent):
    return 0b011 if state[HEADER] == 0 else 0b111


LEDGE = Task(
    id="ledge",
    agents=("walker",),
    action_names=("left", "right", "wait"),
    variables=(Variable("place", 3, "where it stands"),),
    rewards=("fall",),
    events=("fall",),
    schedule="single",
    settings=None,
    kernel=Ledge(),
    layout={"place": slice(HEADER, HEADER + 1)},
    state_size=HEADER + 1,
)
SB3 = "sb3-contrib is not installed: it comes with the extra deep"


def make_training(id, learner="safe-msav", moves=0, **options):
    task = LEDGE if id == "ledge" else make_task(id)
    settings = catalog.make_settings(learner, task, **options)
    training = Training(task, learner, settings, np.random.default_rng(0), compiled=False)
    if moves:
        training.advance(moves=moves)
    return training


def list_states(task):
    """All states that agents in turns can reach, a single agent from all its starts."""
    starts = {"maze": [(0, 0, x, y) for x in range(4) for y in range(2) if (x, y) != (0, 1)]}
    first = starts.get(task.id, [(0, 0, 0, 2)])
    return enumerate_turns(task, [np.array(s, np.int64) for s in first]).states


def unpack(bits, n_actions):
    return (int(bits) >> np.arange(n_actions) & 1).astype(bool)


def find_safe(task, state):
    scratch = task.make_state()
    bits = kernels.compute_safe_mask(task.kernel, state, int(state[kernels.TURN]), scratch)
    return unpack(bits, task.n_actions)


@pytest.mark.parametrize(("id", "moves"), [("maze", 60), ("maze", 2000), ("corridor", 200)])
def test_masks_are_the_veto_bits_in_every_state(id, moves):
    training = make_training(id, moves=moves)
    task, masks = training.task, VetoMasks(training)
    veto = next(module for module in training.settings.modules if module.kind == "veto")
    projection = task.make_projection(veto.variables)
    for state in list_states(task):
        agent = int(state[kernels.TURN])
        key = kernels.project(projection, task.observe(state, agent)) + agent * projection.size
        free = ~unpack(training.memory.vetoes.rows[key, 0], task.n_actions)
        if free.any():
            np.testing.assert_array_equal(masks.compute_mask(state, agent), free)
        else:
            assert masks.compute_mask(state, agent).any()


def test_after_enough_exploration_the_mask_of_the_maze_is_what_is_safe():
    training = make_training("maze", moves=5000)
    for state in list_states(training.task):
        mask = VetoMasks(training).compute_mask(state, 0)
        np.testing.assert_array_equal(mask, find_safe(training.task, state))


@pytest.mark.parametrize(("id", "left"), [("maze", [1, 1, 1, 1]), ("corridor", [0, 0, 1])])
def test_something_is_left_where_everything_is_vetoed(id, left):
    training = make_training(id)
    training.memory.vetoes.rows[:] = -1
    for state in list_states(training.task):
        mask = VetoMasks(training).compute_mask(state, int(state[kernels.TURN]))
        assert mask.dtype == bool
        assert mask.tolist() == [bool(k) for k in left]


def test_something_is_left_of_what_is_available_at_all():
    training = make_training("corridor")
    training.memory.vetoes.rows[:] = 0b101  # left and none; the fallback is none
    state = list_states(training.task)[0]
    for available in range(1, 8):
        offered = unpack(available, 3)
        mask = VetoMasks(training).compute_mask(state, 0, offered)
        expected = {0b001: 0b001, 0b100: 0b100, 0b101: 0b100}.get(available, 0b010)
        assert mask.tolist() == unpack(expected, 3).tolist()


def test_values_below_their_threshold_are_vetoed_too():
    training = make_training("maze", "thresholded-msav", vetoes="thresholds")
    learner = training.learner
    walls = 1  # the second module, after that of the goal
    training.memory.table.rows[learner.bases[walls, 0] :, 2] = learner.thresholds[walls] - 1e-9
    training.memory.table.rows[learner.bases[walls, 0] :, 3] = learner.thresholds[walls]
    masks = VetoMasks(training)
    for state in list_states(training.task):
        assert masks.compute_mask(state, 0).tolist() == [True, True, False, True]


def test_compiled_and_plain_kernels_agree():
    training = make_training("corridor", moves=100)
    masks, task = VetoMasks(training), training.task
    for state in list_states(task):
        agent = int(state[kernels.TURN])
        masks._memory.state[:] = state
        arguments = task.kernel, masks._learner, masks._memory, agent
        assert compute_unvetoed(*arguments) == compute_unvetoed.py_func(*arguments)


def test_a_constraint_is_broken_once_and_never_again():
    env = MaskedEnv(TaskEnv("maze"), VetoMasks(make_training("maze")), learns=True)
    task, random = env.unwrapped.task, np.random.default_rng(1)
    env.reset(seed=0)
    broken = set()
    for _ in range(3000):
        before = env.unwrapped.state()
        action = int(random.choice(np.flatnonzero(env.action_masks())))
        *_, terminated, truncated, info = env.step(action)
        if "collision" in info["events"]:
            flags = tuple(task.observe(before, 0)[2:].tolist())
            assert (flags, action) not in broken
            broken.add((flags, action))
        if terminated or truncated:
            env.reset()
    assert env.masks.count_vetoes() == len(broken) > 0
    for state in list_states(task):
        mask = env.masks.compute_mask(state, 0)
        np.testing.assert_array_equal(mask, find_safe(task, state))


def test_a_task_in_plain_python_learns_too():
    training = make_training("ledge", values="monolithic", vetoes="modules")
    env = MaskedEnv(TaskEnv(LEDGE), VetoMasks(training), learns=True)
    env.reset(seed=0)
    assert env.action_masks().tolist() == [True, True, False]  # what the task says
    env.step(0)
    env.reset()
    assert env.action_masks().tolist() == [False, True, False]  # and what was learned
    env.step(1)
    assert env.action_masks().tolist() == [True, True, True]


def test_what_is_learned_here_does_not_reach_the_training():
    training = make_training("maze")
    masks = VetoMasks(training)
    masks.learn(np.array([0, 0, 0, 0]), 0, 0, 1)  # up, into the wall of (0, 0)
    assert masks.count_vetoes() == 1
    assert not masks.compute_mask(np.array([0, 0, 0, 0]), 0)[0]
    assert VetoMasks(training).count_vetoes() == 0


def test_without_learning_nothing_is_added():
    env = MaskedEnv(TaskEnv("maze", start=(0, 0)), VetoMasks(make_training("maze")))
    env.reset(seed=0)
    *_, info = env.step(0)
    assert info["events"] == ("collision",)
    assert env.action_masks().all()


def test_a_hashed_table_grows_and_forgets_nothing():
    training = make_training("line", vetoes="monolithic", hashed=True)
    task, masks = training.task, VetoMasks(training)
    random, stream = np.random.default_rng(2), make_stream(np.random.default_rng(3))
    stretch = 1 << task.events.index("stretch")
    taught = []
    for formation in (task.reset(stream) for _ in range(6)):
        for cell, agent in product(range(441), range(4)):
            state = formation.copy()
            state[task.layout["goals"]] = cell // 21 - 10, cell % 21 - 10
            taught.append((state, agent, int(random.integers(task.n_actions))))
            masks.learn(*taught[-1], stretch)
    assert SLOTS_PER_KEY * len(taught) > FIRST_CAPACITY
    assert masks.count_vetoes() == len(taught)
    for state, agent, action in taught:
        assert masks.compute_mask(state, agent).tolist() == [k != action for k in range(5)]


def test_only_the_agent_that_is_charged_learns():
    masks = VetoMasks(make_training("corridor"))
    env = MaskedEnv(TaskEnv("corridor"), masks, learns=True)
    env.reset(seed=0)
    env.step(np.array([0, 2]))  # robot 0 into the wall, robot 1 stays
    env.reset(seed=0)
    assert env.action_masks().tolist() == [False, True, True, True, True, True]


def test_joint_masks_stand_one_after_the_other():
    training = make_training("corridor", moves=300)
    env = MaskedEnv(TaskEnv("corridor"), VetoMasks(training))
    env.reset(seed=0)
    state = env.unwrapped.state()
    rows = [env.masks.compute_mask(state, agent) for agent in (0, 1)]
    assert env.action_masks().tolist() == [*rows[0], *rows[1]]
    assert env.action_masks().sum() < 6


def test_masks_are_narrowed_by_what_an_environment_in_between_allows():
    class OnlyUp(gymnasium.Wrapper):
        def reset(self, **options):
            observation, info = super().reset(**options)
            return observation, {**info, "action_mask": np.array([1, 0, 0, 0], np.int8)}

    env = MaskedEnv(OnlyUp(TaskEnv("maze", start=(1, 0))), VetoMasks(make_training("maze")))
    env.reset(seed=0)
    assert env.action_masks().tolist() == [True, False, False, False]


@pytest.mark.parametrize(
    "make",
    [
        lambda: TaskEnv("maze"),
        lambda: gymnasium.make("hose_mj/Maze-v0", goal=(3, 1)),
        lambda: TimeLimit(TaskEnv("maze"), 5),
        lambda: TaskEnv("corridor"),
        lambda: SharedPolicyEnv("corridor"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
def test_gymnasium_finds_nothing_wrong(make):
    env = make()
    masked = MaskedEnv(env, VetoMasks(make_training(env.unwrapped.task.id)), learns=True)
    check_env(masked, skip_render_check=True)


def test_a_shared_policy_plays_the_game_of_turns():
    names = ["p_0", "p_1"]
    env, turns = SharedPolicyEnv("corridor", observe=names), TurnsEnv("corridor", observe=names)
    random = np.random.default_rng(3)
    for seed in range(20):
        observation, info = env.reset(seed=seed)
        turns.reset(seed=seed)
        over = False
        while not over:
            agent = turns.agent_selection
            number = turns.possible_agents.index(agent)
            assert observation.tolist() == [number, *turns.observe(agent)]
            np.testing.assert_array_equal(info["action_mask"], turns.infos[agent]["action_mask"])
            action = int(random.integers(3))
            observation, reward, terminated, truncated, info = env.step(action)
            turns.step(action)
            over = terminated or truncated
            assert reward == turns.rewards[agent]
            assert (terminated, truncated) == (
                turns.terminations[agent],
                turns.truncations[agent],
            )


def test_masks_of_a_shared_policy_are_those_of_whose_turn_it_is():
    training = make_training("corridor", moves=300)
    env = MaskedEnv(SharedPolicyEnv("corridor"), VetoMasks(training))
    env.reset(seed=0)
    for agent in (0, 1):
        mask = env.masks.compute_mask(env.unwrapped.episode.state, agent)
        assert env.action_masks().tolist() == mask.tolist()
        env.step(2)
    assert mask.sum() < 3


@pytest.mark.parametrize(
    ("env", "named"),
    [
        (lambda: gymnasium.make("hose_mj/Maze-v0", actions="up"), "variables"),
        (lambda: TaskEnv("corridor"), "agents"),
        (lambda: gymnasium.make("CartPole-v1"), "TaskEnv"),
    ],
)
def test_vetoes_of_another_task_are_refused(env, named):
    with pytest.raises(InputError, match=named):
        MaskedEnv(env(), VetoMasks(make_training("maze")))


def test_agents_that_choose_before_the_others_moved_are_refused():
    with pytest.raises(InputError, match="SharedPolicyEnv"):
        MaskedEnv(TaskEnv("corridor", moves="turns"), VetoMasks(make_training("corridor")))


def test_there_is_no_mask_before_the_first_reset():
    with pytest.raises(InputError, match="reset"):
        MaskedEnv(TaskEnv("maze"), VetoMasks(make_training("maze"))).action_masks()


def test_masks_are_found_the_way_maskable_ppo_looks_for_them():
    """It asks the outermost wrapper for `action_masks`, and stacks those of many copies."""
    masks = VetoMasks(make_training("maze", moves=500))
    copies = [TimeLimit(MaskedEnv(TaskEnv("maze"), masks), 50) for _ in range(3)]
    for seed, env in enumerate(copies):
        env.reset(seed=seed)
    stacked = np.stack([env.get_wrapper_attr("action_masks")() for env in copies])
    assert stacked.shape == (3, 4)
    assert stacked.dtype == bool
    assert stacked.any(axis=1).all()
    assert not stacked.all()


def test_the_real_maskable_ppo_trains_and_obeys():
    contrib = pytest.importorskip("sb3_contrib", reason=SB3)
    from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported

    env = MaskedEnv(TaskEnv("maze"), VetoMasks(make_training("maze", moves=5000)), learns=True)
    known = env.masks.count_vetoes()
    assert is_masking_supported(env)
    model = contrib.MaskablePPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0, device="cpu")
    model.learn(256)
    assert env.masks.count_vetoes() == known  # it never ran into a wall
    observation, _ = env.reset(seed=0)
    for _ in range(50):
        masks = get_action_masks(env)
        action, _ = model.predict(observation, action_masks=masks)
        assert masks[action]
        observation, _, terminated, truncated, info = env.step(int(action))
        assert "collision" not in info["events"]
        if terminated or truncated:
            observation, _ = env.reset()
