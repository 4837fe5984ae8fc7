"""A trained learner's Q-values and vetoes, asked state by state in plain Python."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hose_learning import rules
from hose_learning.evaluation import make_probe
from hose_learning.loop import see
from hose_learning.mdp.joint_policy import State
from hose_learning.mediators import find_above_thresholds
from hose_learning.study.training import Training


def make_evaluate(training: Training) -> Callable[[int, State], dict[int, float]]:
    """Makes a function of agent and state that returns the value of each action not vetoed."""
    task, learner, probe = training.task, training.learner, make_probe(training.memory)

    def evaluate(agent: int, state: State) -> dict[int, float]:
        probe.state[:] = np.array(state)
        allowed = see(task.kernel, learner, probe, agent)
        if learner.has_thresholds:
            allowed &= find_above_thresholds(learner, probe, agent, task.n_actions)
        rules.weigh(learner.rule, learner, probe, agent)
        scores = probe.scores.tolist()
        return {action: scores[action] for action in range(task.n_actions) if allowed >> action & 1}

    return evaluate
