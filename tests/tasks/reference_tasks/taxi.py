"""The taxi problem (thesis B.3) in plain Python: the specification of `taxi_kernels`."""

from __future__ import annotations

from collections.abc import Sequence

from hose_mj.tasks.taxi.settings import ACTIONS, Cell, TaxiSettings
from reference_tasks.reference import Reference, ReferenceStream

MAP = (
    "R .|. . G",
    ". .|. . .",
    ". . . . .",
    ".|. .|. .",
    "Y|. .|B .",
)
"""Dietterich's map; a bar is a wall between its neighbours."""

STEPS = {"up": (-1, 0), "right": (0, 1), "down": (1, 0), "left": (0, -1)}


def find_station(name: str) -> Cell:
    """Returns row and column of a station."""
    row = next(row for row, line in enumerate(MAP) if name in line)
    return row, MAP[row].index(name) // 2


def is_walled(cell: Cell, action: str) -> bool:
    """Whether a wall is in the way of a step."""
    row, column = cell
    if action in ("up", "down"):
        return row == (0 if action == "up" else len(MAP) - 1)
    beside = 2 * column + (1 if action == "right" else -1)
    return not 0 <= beside < len(MAP[row]) or MAP[row][beside] == "|"


class TaxiReference(Reference):
    """The task's state and rules.

    Attributes:
        taxis: their cells (row, column).
        passengers: "waiting", the number of a taxi, or "delivered".
    """

    def __init__(self, settings: TaxiSettings) -> None:
        self.settings = settings
        self.n_taxis = len(settings.starts)
        self.n_agents = 1 if settings.single_agent else self.n_taxis
        self.taxis: list[Cell] = list(settings.starts)
        self.passengers: list[str | int] = ["waiting"] * len(settings.passengers)

    def list_state(self) -> Sequence[int]:
        """Lists the cells as 5 row + column, then the passengers' places as numbers."""
        numbers: dict[str | int, int] = {"waiting": 0, "delivered": self.n_taxis + 1}
        numbers |= {taxi: taxi + 1 for taxi in range(self.n_taxis)}
        return [5 * row + column for row, column in self.taxis] + [
            numbers[place] for place in self.passengers
        ]

    def reset(self, stream: ReferenceStream) -> None:
        """Puts everything to its beginning."""
        self.begin()
        self.taxis = list(self.settings.starts)
        self.passengers = ["waiting"] * len(self.settings.passengers)

    def find_target(self, taxi: int, action: str) -> Cell:
        """Returns the cell that an action leads to if nothing is in its way."""
        row, column = self.taxis[taxi]
        down, right = STEPS.get(action, (0, 0))
        return row + down, column + right

    def is_blocked(self, taxi: int, action: str) -> bool:
        """Whether a wall or another taxi is in the way of a step."""
        others = [cell for other, cell in enumerate(self.taxis) if other != taxi]
        return is_walled(self.taxis[taxi], action) or self.find_target(taxi, action) in others

    def act(self, taxi: int, action: str) -> set[str]:
        """Carries out an action that nothing prevents."""
        here = self.taxis[taxi]
        if action in STEPS:
            self.taxis[taxi] = self.find_target(taxi, action)
            return set()
        for passenger, (origin, destination) in enumerate(self.settings.passengers):
            place = self.passengers[passenger]
            if action == "drop" and place == taxi and here == find_station(destination):
                self.passengers[passenger] = "delivered"
                return set()
            waits = place == "waiting" and here == find_station(origin)
            if action == "pick" and waits and taxi not in self.passengers:
                self.passengers[passenger] = taxi
                return set()
        return {"misplaced"}

    def add_goal(self, events: set[str]) -> set[str]:
        """Returns the events, and the goal when all are delivered."""
        return events | {"goal"} if set(self.passengers) == {"delivered"} else events

    def move(self, agent: int, action: int) -> set[str]:
        """Carries out an agent's action and returns the events."""
        if self.settings.single_agent:
            digits = [action // 6 ** (self.n_taxis - 1 - k) % 6 for k in range(self.n_taxis)]
            self.end_turn(agent)
            charged = self.act_jointly(digits)
            return self.add_goal({f"{e}_{k}" for k, events in enumerate(charged) for e in events})
        self.end_turn(agent)
        name = ACTIONS[action]
        if name in STEPS and self.is_blocked(agent, name):
            return {"collision"}
        return self.add_goal(self.act(agent, name))

    def move_jointly(self, actions: Sequence[int]) -> list[set[str]]:
        """Carries out an action of every taxi; the goal is charged to the first."""
        if self.settings.single_agent:
            return [self.move(0, actions[0])]
        self.end_joint()
        first, *others = self.act_jointly(actions)
        return [self.add_goal(first), *others]

    def act_jointly(self, actions: Sequence[int]) -> list[set[str]]:
        """Carries out one action of every taxi at once.

        A taxi at a wall stays. So does one that would enter the cell of a taxi that stays, and so
        do two that would enter one cell or change places.
        """
        names = [ACTIONS[action] for action in actions]
        stays = {
            k for k, name in enumerate(names) if name in STEPS and is_walled(self.taxis[k], name)
        }
        stopped: set[int] | None = None
        while stopped != stays:
            stopped = set(stays)
            goes = [
                self.taxis[k] if k in stays else self.find_target(k, name)
                for k, name in enumerate(names)
            ]
            for one in range(self.n_taxis):
                for other in range(self.n_taxis):
                    swap = goes[one] == self.taxis[other] and goes[other] == self.taxis[one]
                    moves = goes[one] != self.taxis[one]
                    if one != other and moves and (goes[one] == goes[other] or swap):
                        stays.add(one)
        return [{"collision"} if k in stays else self.act(k, name) for k, name in enumerate(names)]

    def observe(self, agent: int) -> dict[str, int]:
        """Returns all variables as the agent sees them."""
        state = self.list_state()
        names = [f"taxi_{k}" for k in range(self.n_taxis)]
        names += [f"passenger_{k}" for k in range(len(self.passengers))]
        seen = dict(zip(names, state, strict=True))
        for taxi in range(self.n_taxis) if self.settings.single_agent else [agent]:
            mark = f"_{taxi}" if self.settings.single_agent else ""
            for way in STEPS:
                seen[f"o_{way}{mark}"] = int(self.is_blocked(taxi, way))
        return seen
