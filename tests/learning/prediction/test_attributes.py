"""Attributes: numbers in [0, 1] from which values and actions can be read back."""

from __future__ import annotations

import numpy as np
import pytest
from hose_learning.experience import record_experience
from hose_learning.prediction.attributes import GRID_VARIABLES, Encoding, make_attributes

from hose_mj.errors import InputError
from hose_mj.tasks.registry import TASKS, make_task


def make_log(id):
    return record_experience(make_task(id), 400, np.random.default_rng(2))


def test_every_task_with_a_grid_is_named():
    assert set(GRID_VARIABLES) <= set(TASKS)


@pytest.mark.parametrize("id", TASKS)
@pytest.mark.parametrize("action", ["integer", "one-hot"])
def test_cells_and_actions_can_be_read_back(id, action):
    log = make_log(id)
    encoding = Encoding(action=action)
    attributes, names = make_attributes(log, encoding)
    assert attributes.shape == (len(log), len(names))
    assert len(set(names)) == len(names)
    assert (attributes.min(), attributes.max()) == (0.0, 1.0)
    columns = dict(zip(names, attributes.T, strict=True))
    for k, variable in enumerate(log.variables):
        size = int(log.cardinalities[k])
        if variable in columns:
            read = columns[variable] * max(size - 1, 1)
        else:
            width = round(size**0.5)
            assert width**2 == size
            rows, places = columns[f"{variable}_row"], columns[f"{variable}_column"]
            read = width * np.rint(rows * (width - 1)) + places * (width - 1)
        assert np.array_equal(np.rint(read), log.values[:, k])
    if action == "integer":
        read = columns["action"] * max(len(log.action_names) - 1, 1)
        assert np.array_equal(np.rint(read), log.actions)
    else:
        hot = np.column_stack([columns[name] for name in log.action_names])
        assert np.array_equal(hot.sum(axis=1), np.ones(len(log)))
        assert np.array_equal(hot.argmax(axis=1), log.actions)


def test_the_taxi_in_both_encodings_of_cells():
    log = make_log("taxi")
    _, split = make_attributes(log, Encoding())
    _, whole = make_attributes(log, Encoding(cells="number"))
    assert split[:4] == ("taxi_0_row", "taxi_0_column", "taxi_1_row", "taxi_1_column")
    assert whole == (*log.variables, "action")


@pytest.mark.parametrize("wrong", [{"action": "text"}, {"cells": "polar"}])
def test_unknown_encodings_are_refused(wrong):
    with pytest.raises(InputError, match="one of"):
        Encoding(**wrong)
