"""The line-segment hose task (thesis B.2) in plain Python: the specification of `line_kernels`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise, product

from hose_mj.tasks.line.settings import Cell, LineSettings
from reference_tasks.reference import Reference, ReferenceStream

HALF = Fraction(1, 2)
STEPS = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0), "none": (0, 0)}
NAMES = tuple(STEPS)


@lru_cache(maxsize=100_000)
def covers(a: Cell, b: Cell, cell: Cell) -> bool:
    """Whether the segment a + t (b - a), 0 <= t <= 1, meets the open unit square around the cell.

    Each axis allows an open interval of t; the two and [0, 1] must have a point in common.
    """
    first, last = Fraction(-1), Fraction(2)
    for start, end, middle in zip(a, b, cell, strict=True):
        if start == end:
            if start != middle:
                return False
            continue
        bounds = [(middle + side - start) / (end - start) for side in (-HALF, HALF)]
        first, last = max(first, min(bounds)), min(last, max(bounds))
    return first < last and first < 1 and last > 0


class LineReference(Reference):
    """The task's state and rules.

    Attributes:
        robots: cells of the robots, tip first.
        goals: the tip's goal, or one for each robot.
    """

    def __init__(self, settings: LineSettings) -> None:
        self.settings = settings
        n, h = settings.n_robots, settings.half_width
        self.n_agents = 1 if settings.single_agent else n
        self.robots: list[Cell] = [(0, 0)] * n
        self.goals: list[Cell] = [(0, 0)] * (n if settings.own_goals else 1)
        span = range(-settings.hose_length, settings.hose_length + 1)
        self.offsets = [c for c in product(span, span) if self.is_short_enough(c)]
        self.numbers = {offset: number for number, offset in enumerate(self.offsets)}
        grid = range(-h, h + 1)
        self.goal_cells = [
            (x, y) for x, y in product(grid, grid) if x * x + y * y <= settings.hose_length**2
        ]
        self.farthest = max(x for x, _ in self.offsets) + 2

    def list_state(self) -> Sequence[int]:
        """Lists x and y of the robots, the source and the goals."""
        return [value for cell in (*self.robots, (0, 0), *self.goals) for value in cell]

    # Geometry

    def is_short_enough(self, offset: Cell) -> bool:
        """Whether neighbours may be that far apart: |offset| <= L_hose / N."""
        squared = offset[0] ** 2 + offset[1] ** 2
        return squared * self.settings.n_robots**2 <= self.settings.hose_length**2

    def is_inside(self, cell: Cell) -> bool:
        """Whether the cell is on the grid."""
        return max(map(abs, cell)) <= self.settings.half_width

    def list_segments(self) -> list[tuple[Cell, Cell]]:
        """Lists the segments; segment j joins the points j and j + 1, point N is the source."""
        points = [*self.robots, (0, 0)]
        return list(pairwise(points))

    def is_blocked(self, robot: int, cell: Cell) -> bool:
        """Whether another robot, or a segment that this one does not end, is on the cell."""
        if any(self.robots[other] == cell for other in self.list_others(robot)):
            return True
        if self.settings.collision == "robots":
            return False
        return any(
            covers(a, b, cell)
            for j, (a, b) in enumerate(self.list_segments())
            if robot not in (j, j + 1)
        )

    def list_others(self, robot: int) -> Iterator[int]:
        """Lists the other robots."""
        return (other for other in range(len(self.robots)) if other != robot)

    def is_stretched(self, robot: int) -> bool:
        """Whether a segment that the robot ends is too long."""
        return any(
            not self.is_short_enough((a[0] - b[0], a[1] - b[1]))
            for j, (a, b) in enumerate(self.list_segments())
            if robot in (j, j + 1)
        )

    # Moves

    def find_target(self, robot: int, action: str) -> Cell:
        """Returns the cell that an action leads to."""
        (x, y), (dx, dy) = self.robots[robot], STEPS[action]
        return x + dx, y + dy

    def find_breaks(self, robot: int, moved: bool) -> set[str]:
        """Returns the constraints that a robot breaks where it now stands."""
        here = self.robots[robot]
        looks = moved or self.settings.collision == "sweeping"
        broken = {
            "out": not self.is_inside(here),
            "stretch": self.is_stretched(robot),
            "collision": looks and self.is_blocked(robot, here),
        }
        return {name for name, happened in broken.items() if happened}

    def find_goals(self, robot: int) -> set[str]:
        """Returns the goal events after a move of the robot that broke nothing."""
        if self.settings.goal == "none":
            return set()
        if not self.settings.own_goals:
            return {"goal"} if self.robots[0] == self.goals[0] else set()
        if self.robots[robot] != self.goals[robot]:
            return set()
        return {"goal", "all_goals"} if self.robots == self.goals else {"goal"}

    def move(self, agent: int, action: int) -> set[str]:
        """Lets an agent move and returns the events."""
        self.end_turn(agent)
        robot, direction = divmod(action, 4) if self.settings.single_agent else (agent, action)
        name = NAMES[direction]
        target = self.find_target(robot, name)
        events = set()
        if self.settings.move_rule == "cancelling" and name != "none":
            if not self.is_inside(target):
                events = {"out"}
            elif any(self.robots[other] == target for other in self.list_others(robot)):
                events = {"collision"}
        moved = name != "none" and not events
        if moved:
            self.robots[robot] = target
        events |= self.find_breaks(robot, moved)
        if self.settings.collision == "sweeping" and any(
            self.is_blocked(other, cell) for other, cell in enumerate(self.robots)
        ):
            events.add("collision")
        return events or self.find_goals(robot)

    def move_jointly(self, actions: Sequence[int]) -> list[set[str]]:
        """Lets all robots move at once and returns the events that each one caused."""
        if self.settings.single_agent:
            return [self.move(0, actions[0])]
        self.end_joint()
        before = list(self.robots)
        wanted = [self.find_target(i, NAMES[a]) for i, a in enumerate(actions)]
        charged: list[set[str]] = [set() for _ in actions]
        if self.settings.move_rule == "cancelling":
            self.robots = self.resolve(wanted)
            for i, (target, got) in enumerate(zip(wanted, self.robots, strict=True)):
                if target != got:
                    charged[i] = {"collision" if self.is_inside(target) else "out"}
        else:
            self.robots = list(wanted)
            for i in range(len(actions)):
                for j in self.list_others(i):
                    if before[i] != before[j] and wanted[i] == before[j] and wanted[j] == before[i]:
                        charged[i] = {"collision"}
        for i in range(len(actions)):
            charged[i] |= self.find_breaks(i, moved=self.robots[i] != before[i])
        if not any(charged):
            for i in range(len(actions) if self.settings.own_goals else 1):
                charged[i] = self.find_goals(i)
        return charged

    def resolve(self, wanted: list[Cell]) -> list[Cell]:
        """Returns where the robots get to when impossible moves are cancelled.

        First those that leave the grid. Then, pair by pair and until nothing changes: a move onto a
        robot that stays, both of two that would change places, the second of two to one cell.
        """
        here = self.robots
        goes = [to if self.is_inside(to) else at for at, to in zip(here, wanted, strict=True)]
        while True:
            before = list(goes)
            for i in range(len(here)):
                for j in range(i + 1, len(here)):
                    if goes[i] == goes[j] and goes[j] == here[j]:
                        goes[i] = here[i]
                    elif goes[i] == goes[j]:
                        goes[j] = here[j]
                    elif goes[i] == here[j] and goes[j] == here[i]:
                        goes[i], goes[j] = here[i], here[j]
            if goes == before:
                return goes

    # Variables

    def clip(self, cell: Cell) -> Cell:
        """Returns the nearest cell of the grid."""
        h = self.settings.half_width
        return min(max(cell[0], -h), h), min(max(cell[1], -h), h)

    def number_cell(self, cell: Cell, half_width: int) -> int:
        """Numbers the cells of a square grid, y running fastest."""
        return (cell[0] + half_width) * (2 * half_width + 1) + cell[1] + half_width

    def number_offset(self, a: Cell, b: Cell) -> int:
        """Numbers a - b among the allowed offsets; beyond them the nearest one counts."""
        if (a[0] - b[0], a[1] - b[1]) in self.numbers:
            return self.numbers[a[0] - b[0], a[1] - b[1]]
        far = self.farthest
        x, y = (min(max(p - q, -far), far) for p, q in zip(a, b, strict=True))
        squares = [(x - u) ** 2 + (y - v) ** 2 for u, v in self.offsets]
        return squares.index(min(squares))

    def observe_robot(self, robot: int) -> dict[str, int]:
        """Returns the variables of one robot."""
        h = self.settings.half_width
        points = [*self.robots, (0, 0)]
        here = points[robot]
        inside = self.clip(here)
        goal = self.goals[robot if self.settings.own_goals else 0]
        dx, dy = goal[0] - inside[0], goal[1] - inside[1]
        squared = dx * dx + dy * dy
        following = points[robot - 1] if robot > 0 else here
        flags = {}
        for name in NAMES[:4]:
            cell = self.find_target(robot, name)
            flags[f"o_{name}"] = int(self.is_inside(cell) and self.is_blocked(robot, cell))
        return {
            "p": self.number_cell(inside, h),
            "r_g": self.number_cell((dx, dy), 2 * h),
            "d_g": min(squared, 255) if self.settings.own_goals else min(math.isqrt(squared), 23),
            "theta_g": math.floor((math.atan2(dy, dx) + math.pi / 8) / (math.pi / 4)) % 8,
            "r_n": self.number_offset(following, here),
            "r_p": self.number_offset(here, points[robot + 1]),
            **flags,
        }

    def observe(self, agent: int) -> dict[str, int]:
        """Returns all variables as the agent sees them."""
        goal = self.goals[agent if self.settings.own_goals else 0]
        seen = {"goal": self.number_cell(goal, self.settings.half_width)}
        formation = {
            f"r_n_{j + 1}": self.number_offset(a, b)
            for j, (a, b) in enumerate(self.list_segments())
        }
        if not self.settings.single_agent:
            return {**seen, **self.observe_robot(agent), **formation}
        for robot in range(len(self.robots)):
            values = self.observe_robot(robot)
            seen |= {f"{name}_{robot}": value for name, value in values.items()}
        return {**seen, **formation}

    # Initial states

    def draw_chain(self, stream: ReferenceStream) -> list[Cell]:
        """Draws robots' cells, from the source outwards, anew at the first that does not fit."""
        while True:
            self.robots = []
            while len(self.robots) < self.settings.n_robots:
                x, y = self.robots[0] if self.robots else (0, 0)
                dx, dy = self.offsets[stream.draw_below(len(self.offsets))]
                self.robots.insert(0, (x + dx, y + dy))
                if not self.is_feasible():
                    break
            else:
                return self.robots

    def is_feasible(self) -> bool:
        """Whether every robot is on the grid, alone in its cell and beside the hose."""
        return all(
            self.is_inside(cell) and not self.is_blocked(robot, cell)
            for robot, cell in enumerate(self.robots)
        )

    def reset(self, stream: ReferenceStream) -> None:
        """Draws goals and robots until the task is not solved at the start."""
        self.begin()
        goal, start = self.settings.goal, self.settings.start
        solved = True
        while solved:
            if goal == "none":
                self.goals = [(0, 0)] * len(self.goals)
            elif goal != "random":
                self.goals = list(goal) if self.settings.own_goals else [goal]  # type: ignore[arg-type, list-item]
            elif self.settings.own_goals:
                self.goals = list(self.draw_chain(stream))
            else:
                self.goals = [self.goal_cells[stream.draw_below(len(self.goal_cells))]]
            self.robots = self.draw_chain(stream) if start == "random" else list(start)
            solved = goal != "none" and self.robots[: len(self.goals)] == self.goals
