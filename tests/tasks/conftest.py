import numpy as np
import pytest
from reference_tasks.line import LineReference
from reference_tasks.reference import ReferenceStream
from reference_tasks.taxi import TaxiReference
from reference_tasks.tiny import CorridorReference, MazeReference

from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task

REFERENCES = {
    "line": LineReference,
    "taxi": TaxiReference,
    "corridor": CorridorReference,
    "maze": MazeReference,
}
SEED = 0x9E3779B97F4A7C15


class Pair:
    """A compiled task and its reference implementation, held equal at every step."""

    def __init__(self, id, **settings):
        self.task = make_task(id, **settings)
        self.reference = REFERENCES[id.split("-")[0]](self.task.settings)
        self.state = self.task.make_state()
        self.stream, self.reference_stream = np.array([SEED], np.uint64), ReferenceStream(SEED)
        self.sizes = np.array([variable.cardinality for variable in self.task.variables])

    def as_events(self, names):
        assert set(names) <= set(self.task.events)
        return sum(1 << bit for bit, name in enumerate(self.task.events) if name in names)

    def reset(self):
        kernels.reset(self.task.kernel, self.state, self.stream)
        self.reference.reset(self.reference_stream)
        assert (self.state == self.reference.as_array()).all()
        assert self.stream[0] == self.reference_stream.state

    def observe(self, agent):
        values = self.task.observe(self.state, agent)
        named = {v.name: x for v, x in zip(self.task.variables, values.tolist(), strict=True)}
        assert named == self.reference.observe(agent)
        assert ((values >= 0) & (values < self.sizes)).all()

    def move(self, agent, action):
        events = kernels.apply(self.task.kernel, self.state, agent, action)
        assert events == self.as_events(self.reference.move(agent, action))
        assert (self.state == self.reference.as_array()).all()
        return events

    def move_jointly(self, actions):
        caused_events = np.full(self.task.n_agents, -1)
        actions = np.array(actions)
        events = kernels.apply_joint(self.task.kernel, self.state, actions, caused_events)
        by_reference = self.reference.move_jointly(actions.tolist())
        assert caused_events.tolist() == [self.as_events(names) for names in by_reference]
        assert events == np.bitwise_or.reduce(caused_events)
        assert (self.state == self.reference.as_array()).all()
        return events


@pytest.fixture
def make_pair():
    return Pair
