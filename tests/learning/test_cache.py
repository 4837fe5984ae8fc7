"""A second process finds the compiled loops on disk."""

import json
import os
import subprocess
import sys

PROGRAM = """
import gc, json
import numpy as np
from numba.core.dispatcher import Dispatcher
from hose_mj.tasks.registry import make_task
from hose_learning import evaluation, loop
from hose_learning.learners import catalog
from hose_learning.study.training import Training

task = make_task("corridor")
settings = catalog.make_settings("d-rr-ql", task)
training = Training(task, "d-rr-ql", settings, np.random.default_rng(0))
training.advance(moves=1000)
training.test(2)
dispatchers = [k for k in gc.get_objects() if isinstance(k, Dispatcher)]
ours = [k for k in dispatchers if k.__module__.startswith(("hose_mj", "hose_learning"))]
misses = sum(sum(k.stats.cache_misses.values()) for k in ours)
loops = loop.run_turns, evaluation.run_tests
print(json.dumps([misses, *(sum(k.stats.cache_hits.values()) for k in loops)]))
"""


def run(cache):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=True
    )
    return json.loads(done.stdout)


def test_a_learning_loop_and_its_test_are_found_on_disk_by_a_second_process(tmp_path):
    misses, *hits = run(tmp_path)
    assert (misses > 0, hits) == (True, [0, 0])
    assert run(tmp_path) == [0, 1, 1]
