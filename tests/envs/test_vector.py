"""Many copies: what is not the same as for one, and what the process looks like afterwards."""

from __future__ import annotations

import subprocess
import sys

import numba
import numpy as np
import pytest

from hose_mj.envs.vector import VectorTaskEnv, choose_cores

CORES = numba.config.NUMBA_NUM_THREADS


@pytest.mark.parametrize("num_envs", [1, 3, 17])
def test_the_result_does_not_depend_on_the_cores(num_envs):
    one, all_of_them = (VectorTaskEnv("line", num_envs, cores=cores) for cores in (1, CORES))
    one.action_space.seed(0)
    assert np.array_equal(one.reset(seed=0)[0], all_of_them.reset(seed=0)[0])
    for _ in range(30):
        actions = one.action_space.sample()
        for ours, theirs in zip(one.step(actions)[:4], all_of_them.step(actions)[:4], strict=True):
            assert np.array_equal(ours, theirs)


def test_few_copies_take_one_core():
    assert choose_cores(None, 128) == 1
    assert choose_cores(None, 10**6) == CORES
    assert choose_cores(CORES, 1) == 1


def test_seeds_for_each_copy():
    env = VectorTaskEnv("line", 3)
    first = env.reset(seed=[5, 6, 5])[0]
    assert np.array_equal(first[0], first[2])
    assert not np.array_equal(first[0], first[1])
    assert np.array_equal(env.reset(seed=5)[0][:2], first[:2])
    later = env.reset(seed=[5, None, None])[0]
    assert np.array_equal(later[0], first[0])
    assert not np.array_equal(later[1], first[1])


def test_without_a_seed_the_copies_differ_and_go_on():
    env = VectorTaskEnv("line", 4)
    first, second = env.reset()[0], env.reset()[0]
    assert len({tuple(row) for row in np.concatenate([first, second])}) == 8


def test_threads_leave_the_environment_and_numbas_settings_alone():
    """In a fresh process, where GNU OpenMP is not loaded yet."""
    code = (
        "import os, numba, numpy as np; from hose_mj.envs.vector import VectorTaskEnv;"
        "before = dict(os.environ);"
        "env = VectorTaskEnv('maze', 4, cores=numba.config.NUMBA_NUM_THREADS);"
        "env.reset(seed=0); env.step(np.zeros(4, np.int64));"
        "assert dict(os.environ) == before;"
        "assert numba.get_num_threads() == numba.config.NUMBA_NUM_THREADS"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_kernels_are_found_on_disk_by_the_next_process():
    code = (
        "import numpy as np; from hose_mj.envs import kernels;"
        "from hose_mj.envs.gym import TaskEnv; from hose_mj.envs.vector import VectorTaskEnv;"
        "env = TaskEnv('maze'); env.reset(seed=0); env.step(0);"
        f"[VectorTaskEnv('maze', 4, cores=cores).reset(seed=0) for cores in (1, {CORES})];"
        "functions = [kernels.play_all, *kernels._COMPILED.values()];"
        "print(sum(sum(f.stats.cache_misses.values()) for f in functions));"
        "print(sum(sum(f.stats.cache_hits.values()) for f in functions))"
    )
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    misses, hits = map(int, done.stdout.split())
    assert misses == 0
    assert hits >= 4
