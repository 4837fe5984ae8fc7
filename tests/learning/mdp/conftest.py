import numpy as np
import pytest
from hose_learning.mdp.explicit_mdp import MarkovModel
from scipy.sparse import csr_array


def make_model(moves, rewards, terminal, actions=("a", "b")):
    """moves: (state, action) -> {successor: probability}; an action left out stays."""
    names = tuple(rewards)
    transitions = np.zeros((len(names) * len(actions), len(names)))
    for s, name in enumerate(names):
        for a, action in enumerate(actions if name not in terminal else ()):
            for successor, probability in moves.get((name, action), {name: 1.0}).items():
                transitions[s * len(actions) + a, names.index(successor)] = probability
    return MarkovModel(
        transitions=csr_array(transitions),
        rewards=np.array(list(rewards.values()), float),
        terminal=np.array([name in terminal for name in names]),
        actions=actions,
        names=names,
    )


@pytest.fixture
def model_of():
    return make_model
