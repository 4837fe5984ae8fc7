"""The shared part of the interfaces: the task made, the episode played, the agents by name."""

from collections.abc import Sequence
from typing import Any

from gymnasium import spaces
from gymnasium.utils import seeding

from hose_mj.envs.drawing import RENDER_MODES, Renderer
from hose_mj.envs.episode import Episode
from hose_mj.envs.view import Form, View
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.registry import make_task
from hose_mj.tasks.task import Task


def build_task(task: str | Task, options: dict[str, Any], max_cycles: int | None = None) -> Task:
    """Returns a task.

    Args:
        task: its id in `hose_mj.tasks.registry`, or a task made before.
        options: options of the task; none if it is made already.
        max_cycles: rounds of moves after which an episode is cut off, in place of the task's
            `step_limit`, which counts the moves of single agents.

    Raises:
        InputError: an unknown task or option, or a value outside its valid set.
    """
    if isinstance(task, Task):
        if options or max_cycles is not None:
            given = sorted(options) + ["max_cycles"] * (max_cycles is not None)
            raise InputError("options", given, "none beside a Task, which has its own")
        return task
    made = make_task(task, **options)
    if max_cycles is None:
        return made
    if "step_limit" in options:
        raise InputError("max_cycles", max_cycles, "given without step_limit")
    if isinstance(max_cycles, bool) or not isinstance(max_cycles, int) or max_cycles < 1:
        raise InputError("max_cycles", max_cycles, "an integer, at least 1")
    return make_task(task, **options, step_limit=max_cycles * made.n_agents)


def refuse_reset_options(options: dict[str, Any] | None) -> None:
    """Raises `InputError` for options of a reset: there are none."""
    if options:
        valid = "none; a task's options are made with it"
        raise InputError("options of reset", sorted(options), valid)


class Interface:
    """An environment of one copy of a task; comes before the library's own class."""

    metadata: dict[str, Any] = {"render_modes": RENDER_MODES, "render_fps": 10}  # noqa: RUF012

    def __init__(self, task: Task, rewards: Sequence[str] | None, render_mode: str | None) -> None:
        super().__init__()
        self.task = task
        self.episode = Episode(task, rewards)
        self.render_mode = render_mode
        self._renderer = Renderer(task, render_mode)

    def state(self) -> Integers:
        """Returns a copy of the task's state, with turn and step count before it."""
        return self.episode.state.copy()

    def render(self) -> Any:
        """Returns the picture that `render_mode` asks for; None without one."""
        return self._renderer.render(self.episode)

    def close(self) -> None:
        """Ends nothing: no window is open. PettingZoo wants it of what renders."""


class AgentsInterface(Interface):
    """An environment of agents by name, as PettingZoo has them.

    Args:
        task, observe, rewards, render_mode, options: as in `TaskEnv`.
        form: "array" (a Box of integers), "dict" or "index", as in `TaskEnv`.
        max_cycles: rounds after which an episode is cut off, in place of the task's `step_limit`.

    Raises:
        InputError: an unknown task, option or name, or a value outside its valid set.
    """

    def __init__(
        self,
        task: str | Task,
        *,
        observe: Sequence[str] | None = None,
        form: Form = "array",
        rewards: Sequence[str] | None = None,
        render_mode: str | None = None,
        max_cycles: int | None = None,
        **options: Any,
    ) -> None:
        super().__init__(build_task(task, options, max_cycles), rewards, render_mode)
        self.metadata = {**self.metadata, "name": self.task.id}
        self.possible_agents = list(self.task.agents)
        self.agents: list[str] = []
        self._views = [View(self.task, observe, form, [i]) for i in range(self.task.n_agents)]
        self._numbers = {agent: number for number, agent in enumerate(self.task.agents)}
        self._spaces = [view.make_agent_space() for view in self._views]
        self._actions = [spaces.Discrete(self.task.n_actions) for _ in self.task.agents]
        self._generator, _ = seeding.np_random()

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Returns what the agent may see."""
        return self._spaces[self._numbers[agent]]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Returns what the agent may do."""
        return self._actions[self._numbers[agent]]

    def observe(self, agent: str) -> Any:
        """Returns what the agent sees now, in new arrays."""
        view = self._views[self._numbers[agent]]
        return view.shape(view.look(self.task.kernel, self.episode.state))

    def _start(self, seed: int | None) -> None:
        """Starts an episode of all agents."""
        if seed is not None:
            self._generator, _ = seeding.np_random(seed)
        self.episode.reset(self._generator)
        self.agents = list(self.possible_agents)

    def _make_info(
        self, mask: Any, events: int, caused_events: int, signals: Any, cycle_rewards: Any
    ) -> dict[str, Any]:
        """Makes an agent's info; the key "charged" is the older name of "caused_events"."""
        caused = self.task.name_events(caused_events)
        return {
            "action_mask": mask.copy(),
            "events": self.task.name_events(events),
            "caused_events": caused,
            "charged": caused,
            "signals": dict(zip(self.task.rewards, signals.tolist(), strict=True)),
            "cycle_rewards": cycle_rewards,
        }
