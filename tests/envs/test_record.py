import json

import gymnasium
import pytest

from hose_mj.envs.gym import TaskEnv
from hose_mj.envs.record import RecordEpisode, RecordTurns
from hose_mj.envs.turns import TurnsEnv
from hose_mj.errors import InputError
from hose_mj.recording.keep import Keep
from hose_mj.recording.rerun import read_recording


def read_index(folder):
    return json.loads((folder / "index.json").read_text())["recordings"]


def test_episodes_become_recordings_and_old_ones_go(tmp_path):
    env = RecordEpisode(TaskEnv("corridor", step_limit=6), tmp_path, Keep(last=2))
    lengths = []
    for seed in range(8):
        env.reset(seed=seed)
        env.action_space.seed(seed)
        over, steps = False, 0
        while not over:
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            over, steps = terminated or truncated, steps + 1
        lengths.append(steps)
    index = read_index(tmp_path)
    files = {entry["file"] for entry in index}
    assert {path.name for path in tmp_path.glob("*.rrd")} == files
    assert [entry["number"] for entry in index][-2:] == [6, 7]
    assert sum("best" in entry["reasons"] for entry in index) == 1
    for entry in index:
        rows = read_recording(tmp_path / entry["file"])["entities"]["/reward"]["rows"]
        assert rows == lengths[entry["number"]] + 1


def test_agents_in_turns_are_recorded_too(tmp_path):
    env = RecordTurns(TurnsEnv("corridor", max_cycles=3), tmp_path)
    env.reset(seed=1)
    moves = 0
    for agent in env.agent_iter():
        over = env.terminations[agent] or env.truncations[agent]
        env.step(None if over else 0)
        moves += not over
    (entry,) = read_index(tmp_path)
    summary = read_recording(tmp_path / entry["file"])
    assert summary["timelines"] == ["turn"]
    assert summary["entities"]["/reward"]["rows"] == moves + 1


def test_a_foreign_environment_is_refused(tmp_path):
    with pytest.raises(InputError, match="recorder_source"):
        RecordEpisode(gymnasium.make("CartPole-v1"), tmp_path)


def test_an_environment_may_say_itself_what_to_record(tmp_path):
    class Source:
        def begin(self):
            self.steps = 0

        def follow(self):
            self.steps += 1

        def summarize(self):
            return float(self.steps), True, ("stretch",)

        def encode(self):
            return b"an rrd"

    class Own(gymnasium.Env):
        def recorder_source(self):
            return Source()

        def reset(self, *, seed=None, options=None):
            return 0, {}

        def step(self, action):
            return 0, 1.0, True, False, {}

    env = RecordEpisode(Own(), tmp_path)
    env.reset()
    env.step(0)
    env.step(0)  # after the end: nothing is counted
    (entry,) = read_index(tmp_path)
    assert entry["reasons"] == ["last", "best", "first success", "first stretch"]
    assert entry["total_reward"] == 1.0
