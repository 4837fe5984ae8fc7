import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hose_mj.errors import InputError
from hose_mj.tasks.kernels import project
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.variables import Variable, make_projection

sizes = st.lists(st.integers(1, 6), min_size=1, max_size=6)


@settings(deadline=None)
@given(sizes, st.data())
def test_a_projection_is_numpys_mixed_radix_index(sizes, data):
    variables = [Variable(f"v{k}", size, "") for k, size in enumerate(sizes)]
    kept = data.draw(st.permutations(range(len(sizes))))[: data.draw(st.integers(0, len(sizes)))]
    projection = make_projection(variables, [f"v{k}" for k in kept])
    radices = [sizes[k] for k in kept]
    assert projection.size == np.prod(radices, dtype=int)
    seen = set()
    for values in np.ndindex(*sizes):
        index = project(projection, np.array(values))
        expected = np.ravel_multi_index([values[k] for k in kept], radices) if kept else 0
        assert index == expected
        seen.add(index)
    assert seen == set(range(projection.size))


def test_wrong_names_and_too_many_states():
    task = make_task("line")
    with pytest.raises(InputError, match="r_x"):
        task.make_projection(["r_n", "r_x"])
    with pytest.raises(InputError, match="only once"):
        task.make_projection(["r_n", "r_n"])
    with pytest.raises(InputError, match=r"2\^62"):
        make_projection([Variable(f"v{k}", 2**20, "") for k in range(4)], ["v0", "v1", "v2", "v3"])


def test_the_formation_is_told_by_r_n_of_all():
    task = make_task("line", n_robots=3)
    names = [variable.name for variable in task.variables]
    state = task.reset(np.array([8], np.uint64))
    values = [dict(zip(names, task.observe(state, agent), strict=True)) for agent in range(3)]
    for agent in range(3):
        assert values[agent]["r_p"] == values[0][f"r_n_{agent + 1}"]
        assert agent == 0 or values[agent]["r_n"] == values[0][f"r_n_{agent}"]
    assert task.make_projection(["r_n_1", "r_n_2", "r_n_3"]).size == 89**3
