"""Settings outside their range, and options that a rule does not have."""

import math

import pytest
from hose_learning.learners import catalog
from hose_learning.modules import Module
from hose_learning.settings import Exploration, LearnerSettings

from hose_mj.errors import InputError
from hose_mj.tasks.registry import make_task

GOAL = (Module(name="goal", variables=()),)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("epsilon", value) for value in (-0.1, 1.1, math.nan, "1", True)),
        ("least", 0.6),
        ("per_episode", 2.0),
        ("per_success", -1e-9),
        ("temperature_factor", math.inf),
        ("policy", "bold"),
    ],
)
def test_exploration(name, value):
    with pytest.raises(InputError, match=f"^{name} is"):
        Exploration(**{"epsilon": 0.5, name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("discount", 1.01),
        ("learning_rate", -1.0),
        ("learning_rate_decay", math.nan),
        ("mediator", "judge"),
        ("fallback", "hide"),
        ("modules", ()),
        ("modules", (Module(name="veto", variables=(), kind="veto"),)),
    ],
)
def test_learner(name, value):
    with pytest.raises(InputError, match=f"^{name} is"):
        LearnerSettings(**{"modules": GOAL, name: value})


@pytest.mark.parametrize("id", catalog.LEARNERS)
def test_no_rule_takes_an_option_that_it_does_not_know(make_training, make_line, id):
    with pytest.raises(InputError, match="learner's option is 'moon'"):
        make_training(make_line(), id, options={"moon": 1.0})


def test_unknown_learners_and_settings():
    task = make_task("corridor")
    with pytest.raises(InputError, match="learner is 'q'; valid: one of q-learning"):
        catalog.make_settings("q", task)
    with pytest.raises(InputError, match="setting is 'gamma'; valid: one of modules, discount"):
        catalog.make_settings("q-learning", task, gamma=0.9)
    with pytest.raises(InputError, match="values is 'all'"):
        catalog.make_settings("q-learning", task, values="all")


def test_a_threshold_is_handed_on():
    made = catalog.make_settings("thresholded-msav", make_task("corridor"), threshold=-2.0)
    assert made.modules[-1].threshold == -2.0
