"""The corridor and the maze in plain Python: the specification of `tiny_kernels`."""

from __future__ import annotations

from collections.abc import Sequence

from hose_mj.tasks.tiny.settings import CorridorSettings, MazeSettings
from reference_tasks.reference import Reference, ReferenceStream

CORRIDOR_STEPS = (-1, 1, 0)
MAZE_STEPS = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0)}


class CorridorReference(Reference):
    """The corridor's state and rules.

    Attributes:
        robots: cells of the two robots.
    """

    n_agents = 2

    def __init__(self, settings: CorridorSettings) -> None:
        self.settings = settings
        self.robots = list(settings.starts)

    def list_state(self) -> Sequence[int]:
        """Lists the robots' cells."""
        return self.robots

    def reset(self, stream: ReferenceStream) -> None:
        """Puts the robots on their first cells."""
        self.begin()
        self.robots = list(self.settings.starts)

    def is_free(self, cell: int) -> bool:
        """Whether a cell is in the corridor and nobody stands there."""
        return 0 <= cell < self.settings.n_cells and cell not in self.robots

    def move(self, agent: int, action: int) -> set[str]:
        """Moves one robot and returns the events."""
        events: set[str] = set()
        target = self.robots[agent] + CORRIDOR_STEPS[action]
        if target != self.robots[agent]:
            if self.is_free(target):
                self.robots[agent] = target
                events |= {"goal"} if target == self.settings.goal else set()
            else:
                events.add("collision")
        self.end_turn(agent)
        if self.turn == 0 or self.settings.goal_ends == "move":
            events |= {"done"} if self.settings.goal in self.robots else set()
        return events

    def move_jointly(self, actions: Sequence[int]) -> list[set[str]]:
        """Moves both robots at once and returns the events that each one caused."""
        here = list(self.robots)
        wants = [cell + CORRIDOR_STEPS[a] for cell, a in zip(here, actions, strict=True)]
        goes = [
            w if 0 <= w < self.settings.n_cells else h for w, h in zip(wants, here, strict=True)
        ]
        if goes == here[::-1]:
            goes = list(here)
        elif goes[0] == goes[1]:
            stands = [go == at for go, at in zip(goes, here, strict=True)]
            loser = {"first": {1}, "second": {0}, "neither": {0, 1}}[self.settings.winner]
            if any(stands):
                loser = {stands.index(False)}
            for robot in loser:
                goes[robot] = here[robot]
        self.robots = goes
        charged: list[set[str]] = []
        for at, want, go in zip(here, wants, goes, strict=True):
            reached = {"goal"} if go != at and go == self.settings.goal else set()
            charged.append({"collision"} if want != go else reached)
        if self.settings.goal in goes:
            charged[0].add("done")
        self.end_joint()
        return charged

    def observe(self, agent: int) -> dict[str, int]:
        """Returns the robots' cells."""
        return {f"p_{robot}": cell for robot, cell in enumerate(self.robots)}


class MazeReference(Reference):
    """The maze's state and rules.

    Attributes:
        at: the robot's cell (x, y).
    """

    n_agents = 1

    def __init__(self, settings: MazeSettings) -> None:
        self.settings = settings
        self.actions = tuple(MAZE_STEPS) if settings.actions == "all" else ("up",)
        self.at = (0, 0)

    def list_state(self) -> Sequence[int]:
        """Lists x and y."""
        return self.at

    def reset(self, stream: ReferenceStream) -> None:
        """Puts the robot on its first cell."""
        self.begin()
        cells = [(x, y) for y in (0, 1) for x in range(4) if (x, y) != self.settings.goal]
        start = self.settings.start
        self.at = cells[stream.draw_below(len(cells))] if start == "random" else start

    def is_walled(self, name: str) -> bool:
        """Whether a wall is in the way: the rim, or one above (0, 0) or (2, 0)."""
        (x, y), (dx, dy) = self.at, MAZE_STEPS[name]
        between = dy != 0 and x in (0, 2)
        return between or not (0 <= x + dx < 4 and 0 <= y + dy < 2)

    def move(self, agent: int, action: int) -> set[str]:
        """Moves the robot and returns the events."""
        self.end_turn(agent)
        name = self.actions[action]
        if self.is_walled(name):
            return {"collision"}
        self.at = (self.at[0] + MAZE_STEPS[name][0], self.at[1] + MAZE_STEPS[name][1])
        return {"goal"} if self.at == self.settings.goal else set()

    def move_jointly(self, actions: Sequence[int]) -> list[set[str]]:
        """Moves the robot; there is only one."""
        return [self.move(0, actions[0])]

    def observe(self, agent: int) -> dict[str, int]:
        """Returns the cell and for each action whether a wall is in its way."""
        walls = {f"o_{name}": int(self.is_walled(name)) for name in self.actions}
        return {"x": self.at[0], "y": self.at[1], **walls}
