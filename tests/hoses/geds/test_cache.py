import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import gc, json
from numba.core.dispatcher import Dispatcher
from hose_mj.hoses.geds.hose import GedsHose
from hose_mj.hoses.spec import HoseSpec

spec = HoseSpec(length=1.0, axial_stiffness=1e4, bending_stiffness=0.05, linear_density=0.1)
hose = GedsHose(spec, plane="xz", control_points=8)
hose.clamp(0.0)
hose.contacts.add_floor(-1.0)
hose.step(2)
hose.contacts.list_reactions()
hose.energies(), hose.momentum(), hose.tension(0.5)
{more}
kernels = [k for k in gc.get_objects() if isinstance(k, Dispatcher) and "hose_mj" in k.__module__]
misses = sum(sum(k.stats.cache_misses.values()) for k in kernels)
hits = sum(sum(k.stats.cache_hits.values()) for k in kernels)
print(json.dumps([misses, hits]))
"""


def run(cache, more):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", PROGRAM.format(more=more)]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=True
    )
    return json.loads(done.stdout), done.stderr


@pytest.mark.parametrize(
    "more", ["", pytest.param("hose.solve_static(), hose.linearize()", marks=pytest.mark.slow)]
)
def test_a_second_process_compiles_nothing(tmp_path, more):
    (misses, _), said = run(tmp_path, more)
    assert misses > 0
    assert "compiling the GEDS kernels" in said
    (misses, hits), said = run(tmp_path, more)
    assert misses == 0
    assert hits > 0
    assert said == ""
