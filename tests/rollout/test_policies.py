"""Policies in the shipped scenes: each breaks what it says, first; the others do what they can."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError
from hose_mj.rollout.episode import run_episode
from hose_mj.rollout.policies import POLICIES, make_policy
from hose_mj.scenes.mjcf.scene import list_scenes
from hose_mj.world.registry import make_world

KINDS = ("stretch", "run-over", "collision", "obstacle", "bounds")
FLOORS = tuple(name for name in list_scenes() if name.startswith("floor"))
IMPOSSIBLE = {
    ("floor_1", "stretch"): "a scene with room for it",  # the floor is smaller than the hose
    ("floor_1", "collision"): "a scene with two robots or more",
    ("corridor", "bounds"): "a scene with room for it",  # walls stand before them
    **{(name, "obstacle"): "a scene with solid geoms to run into" for name in FLOORS},
}
QUICK = ("floor_1", "floor_2", "floor_3")
CASES = [
    pytest.param(name, kind, marks=() if name in QUICK else pytest.mark.slow)
    for name in list_scenes()
    for kind in KINDS
]


def run(name, policy, duration=5.0, seed=0, model="geds"):
    world = make_world(name, model)
    monitor = Monitor(world)
    generator = np.random.default_rng(seed)
    policy = make_policy(policy)
    outcome = run_episode(world, monitor, policy, duration=duration, generator=generator)
    return world, outcome


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_the_break_comes_first(name, kind):
    if (name, kind) in IMPOSSIBLE:
        with pytest.raises(InputError, match=IMPOSSIBLE[name, kind]):
            run(name, f"break-{kind}")
        return
    _, outcome = run(name, f"break-{kind}")
    assert outcome.ended_by == "break"
    assert outcome.broken.kind == kind
    assert outcome.sim_time > 0.05  # not from the start


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["run-over", "collision"])
def test_what_a_spline_rehearses_is_confirmed_on_the_hose_itself(kind):
    # On the deck the first scripts that do so with a spline stretch this hose before.
    _, outcome = run("deck", f"break-{kind}", model="flex")
    assert outcome.broken.kind == kind


def test_the_scene_to_copy_runs_into_its_post(tmp_path):
    # Straight ahead, the hose lies between robot and post; from a side it does not.
    text = (Path(__file__).parents[2] / "docs/scenes.md").read_text()
    path = tmp_path / "my_scene.xml"
    path.write_text(text.split("```xml\n")[1].split("```")[0])
    _, outcome = run(path, "break-obstacle")
    assert (outcome.broken.kind, outcome.broken.other) == ("obstacle", "post")
    assert run(path, "to-goal")[1].ended_by == "goal"


@pytest.mark.parametrize("kind", KINDS[:3])
def test_the_same_again(kind):
    first, second = (run("floor_2", f"break-{kind}") for _ in range(2))
    assert first[1] == second[1]
    assert np.array_equal(first[0].data.qpos, second[0].data.qpos)


def test_random_moves_depend_on_the_seed_alone():
    runs = {seed: run("floor_2", "random", 2.0, seed)[0].data.qpos for seed in (0, 1)}
    assert np.array_equal(runs[0], run("floor_2", "random", 2.0, 0)[0].data.qpos)
    assert not np.array_equal(runs[0], runs[1])


def test_random_robots_take_turns_from_cell_to_cell():
    world = make_world("floor_2")
    policy = make_policy("random")
    policy.start(world, Monitor(world), np.random.default_rng(5))
    seen = []
    for _ in range(1500):
        policy.update()
        info = policy.describe()
        if not seen or seen[-1][0] != info["turn"]:
            seen.append((info["turn"], info["owner"], info["action"]))
        world.step()
    assert [turn for turn, _, _ in seen] == list(range(1, len(seen) + 1))
    assert [owner for _, owner, _ in seen] == [f"robot{k % 2}" for k in range(len(seen))]
    assert len(seen) >= 4
    assert {action for _, _, action in seen} <= {"up", "down", "left", "right"}


@pytest.mark.parametrize(
    "name",
    [
        *("floor_1", "floor_2", "floor_3"),
        *(pytest.param(n, marks=pytest.mark.slow) for n in ("floor_5", "floor_6", "lift", "deck")),
    ],
)
def test_the_tip_gets_to_the_goal(name):
    _, outcome = run(name, "to-goal")
    assert outcome.ended_by == "goal"


def test_names():
    assert ("random", "to-goal", *(f"break-{kind}" for kind in KINDS)) == POLICIES
    with pytest.raises(InputError, match="policy is 'nap'; valid: one of random, to-goal, break-s"):
        make_policy("nap")
