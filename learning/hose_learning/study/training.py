"""`Training`: a learner on a task, trained for as long as one likes, tested and saved."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from hose_learning import evaluation, loop
from hose_learning.learners import catalog
from hose_learning.records import EPISODES, EPSILON, MOVES, Memory, make_log
from hose_learning.settings import LearnerSettings
from hose_learning.tables import count_free, grow
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Floats, Integers
from hose_mj.tasks.task import Task

LOG_CAPACITY = 2**14
CHUNK = {True: 2**18, False: 2**9}  # moves between two looks at the clock, compiled and not
Manner = Literal["turns", "joint", "composed"]


@dataclass(frozen=True)
class Episodes:
    """Episodes as columns (n,)."""

    moves: Integers  # of single agents
    events: Integers  # the last ones
    returns: Floats  # sums of all rewards; NaN in a test

    def __len__(self) -> int:
        """Number of episodes."""
        return len(self.moves)

    def find_successes(self, task: Task) -> npt.NDArray[np.bool_]:
        """Returns which of them reached the goal (n,)."""
        return np.array(self.events & task.kernel.success, bool)

    def count_breaks(self, task: Task) -> dict[str, int]:
        """Returns how many ended with each event that breaks a constraint."""
        return {
            name: int(np.count_nonzero(self.events >> bit & 1))
            for bit, name in enumerate(task.events)
            if task.kernel.violations >> bit & 1
        }


def join(parts: list[Episodes]) -> Episodes:
    """Puts episodes one after the other."""
    if not parts:
        return Episodes(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    columns = zip(*((p.moves, p.events, p.returns) for p in parts), strict=True)
    return Episodes(*map(np.concatenate, columns))


class Training:
    """A learner that is being trained.

    The loops are compiled where the task's record is a NamedTuple of numbers and arrays, and run as
    plain Python for any other.

    Args:
        task: the task.
        learner_id: one of `hose_learning.learners.catalog.list_learners`.
        settings: the learner's settings (`catalog.make_settings`).
        generator: seeds everything that is left to chance.
        compiled: whether loops run compiled; by default where they can.

    Attributes:
        task, learner_id, settings: as given.
        learner: the learner's record.
        memory: what it has learned, see `hose_learning.records.Memory`.

    Raises:
        InputError: an unknown id, or settings that the task or the rule does not allow.
    """

    def __init__(
        self,
        task: Task,
        learner_id: str,
        settings: LearnerSettings,
        generator: np.random.Generator,
        compiled: bool | None = None,
    ) -> None:
        self.task, self.learner_id, self.settings = task, learner_id, settings
        self.entry = catalog.find_learner(learner_id)
        self.learner, self.memory = catalog.make(learner_id, task, settings, generator)
        self._compiled = isinstance(task.kernel, tuple) if compiled is None else compiled
        self._log = make_log(LOG_CAPACITY)

    @property
    def moves(self) -> int:
        """Moves of single agents so far."""
        return int(self.memory.counters[MOVES])

    @property
    def episodes(self) -> int:
        """Episodes ended so far."""
        return int(self.memory.counters[EPISODES])

    @property
    def epsilon(self) -> float:
        """What is left to chance now."""
        return float(self.memory.numbers[EPSILON])

    def advance(self, moves: int | None = None, episodes: int | None = None) -> Episodes:
        """Trains for a number of moves of single agents, or of episodes, whichever comes first.

        A joint move counts as many as there are agents and is always completed.

        Returns:
            The episodes that ended meanwhile.

        Raises:
            InputError: neither number is given, or one is negative.
        """
        return join(list(self.advance_in_chunks(moves, episodes)))

    def advance_in_chunks(
        self, moves: int | None = None, episodes: int | None = None
    ) -> Iterator[Episodes]:
        """Does what `advance` does and hands over what ended after each chunk."""
        if moves is None and episodes is None:
            raise InputError("moves", None, "a number of moves or of episodes")
        for name, value in (("moves", moves), ("episodes", episodes)):
            if value is not None and value < 0:
                raise InputError(name, value, "at least 0")
        last_move = 2**62 if moves is None else self.moves + moves
        last_episode = 2**62 if episodes is None else self.episodes + episodes
        while self.moves < last_move and self.episodes < last_episode:
            most = min(last_move - self.moves, CHUNK[self._compiled])
            if self.entry.refresh_moves:
                most = min(most, self.entry.refresh_moves - self.moves % self.entry.refresh_moves)
            yield self._run(most, last_episode - self.episodes)

    def _run(self, max_moves: int, max_episodes: int) -> Episodes:
        kernel = loop.run_joint if self.entry.schedule == "joint" else loop.run_turns
        run = kernel if self._compiled else kernel.py_func
        run(self.task.kernel, self.learner, self.memory, self._log, max_moves, max_episodes)
        log, n = self._log, int(self._log.used[0])
        moves, events = log.episodes[:n].T.copy()
        ended = Episodes(moves, events, log.returns[:n].copy())
        log.used[0] = 0
        self._make_room()
        if self.entry.refresh_moves and self.moves % self.entry.refresh_moves == 0:
            catalog.refresh(self.learner_id, self.task, self.settings, self.memory)
        return ended

    def _make_room(self) -> None:
        """Doubles the tables that the loop finds too full."""
        while not loop.has_room(self.learner, self.memory, self._log, self.task.n_agents):
            table, vetoes = self.memory.table, self.memory.vetoes
            free = count_free(table) // max(1, len(self.learner.bases))
            if free <= count_free(vetoes) // max(1, len(self.learner.veto_bases)):
                self.memory = self.memory._replace(table=grow(table))
            else:
                self.memory = self.memory._replace(vetoes=grow(vetoes))

    def test(
        self, episodes: int = 1, max_moves: int | None = None, manner: Manner | None = None
    ) -> Episodes:
        """Plays greedy episodes; the training goes on as if there had been none.

        Args:
            episodes: how many.
            max_moves: moves of single agents after which one is given up; the task's step limit by
                default.
            manner: how the agents move: in "turns", "joint", or "composed" (section 6.4); by
                default as they learn.

        Raises:
            InputError: a manner that the learner does not have.
        """
        manner = manner or ("joint" if self.entry.schedule == "joint" else "turns")
        valid = ("joint",) if self.entry.schedule == "joint" else ("turns", "composed")
        if manner not in valid:
            raise InputError("manner", manner, f"{' or '.join(valid)} for {self.learner_id}")
        results = np.zeros((episodes, 2), np.int64)
        probe = evaluation.make_probe(self.memory)
        composed = evaluation.Composed(self.task.make_state())
        manners = {"turns": evaluation.Turns(), "joint": evaluation.Joint(), "composed": composed}
        most = self.task.step_limit if max_moves is None else max_moves
        run = evaluation.run_tests if self._compiled else evaluation.run_tests.py_func
        run(manners[manner], self.task.kernel, self.learner, probe, episodes, most, results)
        return Episodes(results[:, 0], results[:, 1], np.full(episodes, np.nan))

    def restore(self, memory: Memory) -> None:
        """Goes on from what was learned before (`hose_learning.study.run_folder`)."""
        self.memory = memory
