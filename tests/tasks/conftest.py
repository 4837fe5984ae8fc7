import numpy as np
import pytest
from reference_tasks.line import LineTwin
from reference_tasks.taxi import TaxiTwin
from reference_tasks.tiny import CorridorTwin, MazeTwin
from reference_tasks.twin import TwinStream

from hose_mj.tasks import kernels
from hose_mj.tasks.registry import make_task

TWINS = {"line": LineTwin, "taxi": TaxiTwin, "corridor": CorridorTwin, "maze": MazeTwin}
SEED = 0x9E3779B97F4A7C15


class Pair:
    """A compiled task and its twin, held equal at every step."""

    def __init__(self, id, **settings):
        self.task = make_task(id, **settings)
        self.twin = TWINS[id.split("-")[0]](self.task.settings)
        self.state = self.task.make_state()
        self.stream, self.twin_stream = np.array([SEED], np.uint64), TwinStream(SEED)
        self.sizes = np.array([variable.cardinality for variable in self.task.variables])

    def as_events(self, names):
        assert set(names) <= set(self.task.events)
        return sum(1 << bit for bit, name in enumerate(self.task.events) if name in names)

    def reset(self):
        kernels.reset(self.task.kernel, self.state, self.stream)
        self.twin.reset(self.twin_stream)
        assert (self.state == self.twin.as_array()).all()
        assert self.stream[0] == self.twin_stream.state

    def observe(self, agent):
        values = self.task.observe(self.state, agent)
        named = {v.name: x for v, x in zip(self.task.variables, values.tolist(), strict=True)}
        assert named == self.twin.observe(agent)
        assert ((values >= 0) & (values < self.sizes)).all()

    def move(self, agent, action):
        events = kernels.apply(self.task.kernel, self.state, agent, action)
        assert events == self.as_events(self.twin.move(agent, action))
        assert (self.state == self.twin.as_array()).all()
        return events

    def move_jointly(self, actions):
        charged = np.full(self.task.n_agents, -1)
        actions = np.array(actions)
        events = kernels.apply_joint(self.task.kernel, self.state, actions, charged)
        by_twin = self.twin.move_jointly(actions.tolist())
        assert charged.tolist() == [self.as_events(names) for names in by_twin]
        assert events == np.bitwise_or.reduce(charged)
        assert (self.state == self.twin.as_array()).all()
        return events


@pytest.fixture
def make_pair():
    return Pair
