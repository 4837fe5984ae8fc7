import json
import os
import subprocess
import sys

PROGRAM = """
import gc, json
import numpy as np
from numba.core.dispatcher import Dispatcher
from hose_mj.tasks import kernels
from hose_mj.tasks.registry import TASKS, make_task
from hose_mj.tasks.stream import make_stream

for id in TASKS:
    task = make_task(id)
    stream = make_stream(np.random.default_rng(1))
    state, values = task.reset(stream), task.observe(task.make_state(), 0)
    counts = np.zeros(4, np.int64)
    kernels.run_random(task.kernel, state, stream, 1000, values, counts)
dispatchers = [k for k in gc.get_objects() if isinstance(k, Dispatcher)]
ours = [k for k in dispatchers if "hose_mj" in k.__module__]
misses = sum(sum(k.stats.cache_misses.values()) for k in ours)
loop = len(kernels.run_random.signatures), sum(kernels.run_random.stats.cache_hits.values())
print(json.dumps([misses, *loop]))
"""


def run(cache):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=True
    )
    return json.loads(done.stdout)


def test_a_loop_over_any_task_is_found_on_disk_by_a_second_process(tmp_path):
    misses, versions, hits = run(tmp_path)
    assert (misses > 0, versions, hits) == (True, 4, 0)  # line, taxi, corridor, maze
    assert run(tmp_path) == [0, 4, 4]
