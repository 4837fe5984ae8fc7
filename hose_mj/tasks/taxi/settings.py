"""The multi-agent taxi problem (thesis B.3): map, settings, and the task made from them."""

from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from hose_mj.errors import InputError
from hose_mj.tasks.checks import check_cells, check_choice, check_finite, check_integer
from hose_mj.tasks.kernels import Integers
from hose_mj.tasks.task import Task, compose_task
from hose_mj.tasks.taxi import kernels as rules
from hose_mj.tasks.taxi.kernels import STATIONS
from hose_mj.tasks.variables import Variable

Cell = tuple[int, int]

WALLS_RIGHT_OF = ((0, 1), (1, 1), (3, 0), (3, 2), (4, 0), (4, 2))
"""The cells with an inner wall on their right."""

ACTIONS = ("up", "right", "down", "left", "pick", "drop")
FLAGS = ("up", "down", "left", "right")


@dataclass(frozen=True, kw_only=True)
class TaxiSettings:
    """Taxis that carry passengers on Dietterich's 5 x 5 map (thesis B.3).

    Raises:
        InputError: a value outside its valid set, or taxis that start on one cell.
    """

    starts: tuple[Cell, ...] = ((2, 2), (2, 1))  # first cells (row, column) of one or two taxis
    # One to three pairs of stations (R, G, Y, B), from and to.
    passengers: tuple[tuple[str, str], ...] = (("R", "B"), ("G", "Y"))
    single_agent: bool = False  # one agent chooses for all taxis at once (section 5.5.2)
    goal_reward: float = 100.0  # for all, when every passenger is delivered
    collision_reward: float = -10.0  # for running into a wall or the other taxi
    misplaced_reward: float = 0.0  # for picking or dropping where it does nothing
    step_limit: int = 2000  # actions of single taxis after which an episode is cut off

    def __post_init__(self) -> None:
        if not isinstance(self.starts, tuple) or not 1 <= len(self.starts) <= 2:
            raise InputError("starts", self.starts, "a tuple of one or two cells (row, column)")
        check_cells("starts", self.starts, len(self.starts), 0, rules.WIDTH - 1)
        if len(set(self.starts)) < len(self.starts):
            raise InputError("starts", self.starts, "different cells")
        if not isinstance(self.passengers, tuple) or not 1 <= len(self.passengers) <= 3:
            raise InputError("passengers", self.passengers, "a tuple of one to three pairs")
        for pair in self.passengers:
            known = isinstance(pair, tuple) and all(station in list(STATIONS) for station in pair)
            if not known or len(pair) != 2 or pair[0] == pair[1]:
                valid = "pairs of two different stations of " + ", ".join(STATIONS)
                raise InputError("passengers", self.passengers, valid)
        check_choice("single_agent", self.single_agent, (True, False))
        for name in ("goal_reward", "collision_reward", "misplaced_reward"):
            check_finite(name, getattr(self, name))
        check_integer("step_limit", self.step_limit, 1, 10**9)


def make_taxi(settings: TaxiSettings) -> Task:
    """Makes the taxi task."""
    n, single = len(settings.starts), settings.single_agent
    tails = [f"_{taxi}" for taxi in range(n)] if single else [""]
    collisions = tuple(f"collision{tail}" for tail in tails)
    actions: tuple[str, ...] = ACTIONS
    if single:
        choices = product(ACTIONS, repeat=n)
        actions = tuple("+".join(f"{name}_{k}" for k, name in enumerate(c)) for c in choices)
    places = {name: rules.WIDTH * row + column for name, (row, column) in STATIONS.items()}
    return compose_task(
        partial(
            rules.Taxi,
            n_taxis=n,
            single_agent=single,
            walls=_make_walls(),
            starts=np.array(
                [rules.WIDTH * row + column for row, column in settings.starts], np.int64
            ),
            origins=np.array([places[a] for a, _ in settings.passengers], np.int64),
            destinations=np.array([places[b] for _, b in settings.passengers], np.int64),
        ),
        id="taxi",
        agents=("taxis",) if single else tuple(f"taxi_{taxi}" for taxi in range(n)),
        action_names=actions,
        variables=_list_variables(settings),
        events=(
            *(f"{name}{tail}" for tail in tails for name in ("collision", "misplaced")),
            "goal",
        ),
        rewards={
            "goal": {"goal": settings.goal_reward},
            "collision": dict.fromkeys(collisions, settings.collision_reward),
            "misplaced": {f"misplaced{tail}": settings.misplaced_reward for tail in tails},
        },
        schedule="single" if single else "turns",
        settings=settings,
        sizes={"taxis": n, "passengers": len(settings.passengers)},
        terminal=("goal",),
        violations=collisions,
        success=("goal",),
        shared=("goal",),
    )


def _make_walls() -> Integers:
    """Makes the walls (cell, direction) in the order up, right, down, left."""
    walls = np.zeros((rules.WIDTH, rules.WIDTH, 4), np.int64)
    walls[0, :, 0] = walls[:, -1, 1] = walls[-1, :, 2] = walls[:, 0, 3] = 1
    for row, column in WALLS_RIGHT_OF:
        walls[row, column, 1] = walls[row, column + 1, 3] = 1
    return walls.reshape(-1, 4)


def _list_variables(settings: TaxiSettings) -> tuple[Variable, ...]:
    """Lists the variables in the order in which `kernels.observe_taxi` writes them."""
    n = len(settings.starts)
    meaning = f"waiting (0), in taxi k (k + 1), delivered ({n + 1})"
    taxis = [Variable(f"taxi_{k}", rules.WIDTH**2, f"cell of taxi {k}") for k in range(n)]
    passengers = [
        Variable(f"passenger_{k}", n + 2, meaning) for k in range(len(settings.passengers))
    ]
    flag = "1 when a wall or a taxi is {} of {}"
    if settings.single_agent:
        flags = [
            Variable(f"o_{way}_{k}", 2, flag.format(way, f"taxi {k}"))
            for k in range(n)
            for way in FLAGS
        ]
    else:
        flags = [Variable(f"o_{way}", 2, flag.format(way, "the taxi"), True) for way in FLAGS]
    return (*taxis, *passengers, *flags)
