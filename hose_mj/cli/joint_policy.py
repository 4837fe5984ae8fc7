"""`hose-mj joint-policy`: joint moves composed from what agents learned in turns (section 6.4)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish, print_table
from hose_mj.cli.task_options import parse_options
from hose_mj.errors import InputError, check_choice
from hose_mj.tasks.registry import make_task

if TYPE_CHECKING:
    import numpy as np
    from hose_learning.mdp.joint_policy import JointMove
    from hose_learning.study.training import Training

    from hose_mj.tasks.task import Task

LARGEST = 20_000  # most states of a task whose joint optimum is searched


@dataclass(frozen=True)
class Args:
    """Let agents learn in turns, and compose what they learned into joint moves.

    Each agent estimates from further play what its moves do. The composed policy is then played
    from one initial state and held against the fewest joint moves there are, which a search over
    all joint moves finds: so the task has to be a small one.
    """

    task: Annotated[str, tyro.conf.Positional] = "corridor"  # Id of the task.
    learner: str = "d-rr-ql"  # A learner whose agents move in turns.
    set: tuple[str, ...] = ()  # Options of the task, as n_robots=3 goal=(2,1).
    episodes: int = 2000  # Episodes to train for; epsilon falls from 1 to 0 over half of them.
    moves: int = 20_000  # Moves of single agents that transitions and rewards are estimated from.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the training, the play and the initial state.


def run(args: Args) -> int:
    """Learns and composes; 1 if the joint moves do not reach the goal, or not the shortest way."""
    import numpy as np
    from hose_learning.learners import catalog
    from hose_learning.mdp import joint_policy as joint

    from hose_mj.tasks.exact import enumerate_joint
    from hose_mj.tasks.stream import make_stream

    check_counts(args, episodes=1, moves=1, seed=0)
    if not catalog.find_learner(args.learner).composes:
        known = [id for id, entry in catalog.list_learners().items() if entry.composes]
        check_choice("learner", args.learner, known)
    begun = time.perf_counter()
    task = make_task(args.task, **parse_options(args.set))
    training_seed, play_seed, start_seed = np.random.default_rng(args.seed).spawn(3)
    start = task.reset(make_stream(start_seed))
    fewest = joint.count_fewest_moves(enumerate_joint(task, [start], LARGEST), task.kernel.success)
    if fewest is None:
        raise InputError("initial state", start.tolist(), "one from which the goal can be reached")
    training = _train(task, args, training_seed)
    evaluate = joint.make_evaluate(training)
    estimates = joint.estimate(task, evaluate, args.moves, play_seed)
    discount = training.settings.discount
    most = max(1, task.step_limit // task.n_agents)
    moves = joint.play_composed(task, start, estimates, evaluate, discount, most)
    reached = bool(moves[-1].events & task.kernel.success)
    checks = [
        Check("the joint moves reach the goal (1 yes, 0 no)", float(reached), 1, "=="),
        Check("joint moves, against the fewest there are", len(moves), fewest),
    ]
    results = {"joint_moves": _list(task, moves), "reached": reached, "fewest": fewest}
    show = partial(_print, task, moves)
    return finish("joint-policy", args, checks, results, show, begun=begun)


def _train(task: Task, args: Args, generator: np.random.Generator) -> Training:
    from hose_learning.learners import catalog
    from hose_learning.settings import Exploration
    from hose_learning.study import training as study

    from hose_mj.jit import compile_notice

    exploration = Exploration(per_episode=min(1.0, 2.0 / args.episodes))
    settings = catalog.make_settings(args.learner, task, exploration=exploration)
    training = study.Training(task, args.learner, settings, generator)
    with compile_notice("learner's kernels"):
        training.advance(episodes=args.episodes)
    return training


def _list(task: Task, moves: list[JointMove]) -> list[dict[str, Any]]:
    """Each joint move: actions by agent, what was expected, what came of it."""
    return [
        {
            "actions": [task.action_names[a] for a in move.composition.actions],
            "outcomes": len(move.composition.messages[-1]),
            "value": move.composition.value,
            "events": task.name_events(move.events),
            "state": {name: move.state[part] for name, part in task.layout.items()},
        }
        for move in moves
    ]


def _print(task: Task, moves: list[JointMove]) -> None:
    rows = []
    for number, (move, row) in enumerate(zip(moves, _list(task, moves), strict=True), start=1):
        places = (" ".join(map(str, move.state[part])) for part in task.layout.values())
        events = ", ".join(row["events"])
        rows.append((str(number), *row["actions"], f"{row['value']:.1f}", *places, events))
    columns = ("move", *task.agents, "value expected", *task.layout, "events")
    print_table(f"Joint policy of {task.id} from its initial state", columns, rows)
