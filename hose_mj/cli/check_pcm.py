"""`hose-mj check-pcm`: is a task a partially constrained model of another (Definition 11)?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish
from hose_mj.cli.task_options import read_options
from hose_mj.errors import InputError, check_choice
from hose_mj.recording.document import make_document, print_document
from hose_mj.recording.files import write_atomically

if TYPE_CHECKING:
    from hose_learning.mdp.partially_constrained import (
        Pair,
        PcmViolation,
        Propositions,
        WrittenPair,
    )


@dataclass(frozen=True)
class Args:
    """Check that SOURCE is a partially constrained model (PCM) of TARGET, state by state.

    Both tasks are written out from one start. Each property of Definition 11 that does not hold is
    named with a witness: a state, an action, and what both tasks say there. For a PCM, Propositions
    4 and 5 are checked too. Options of both tasks: --set n_robots=2 source.collision=robots
    """

    source: Annotated[str | None, tyro.conf.Positional] = None
    """Id of the task that is learnt first."""
    target: Annotated[str | None, tyro.conf.Positional] = None  # Id of the task that is wanted.
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Options of both tasks, or of one: source.NAME=VALUE, target.NAME=VALUE."""
    example: str | None = None  # A ready pair instead of two tasks.
    list: bool = False  # List the ready pairs.
    reading: Literal["equal", "signs"] = "equal"
    """Property 4 compares rewards of undesired states, or their signs only."""
    discount: float = 0.9  # Discount gamma of the values that Proposition 5 is about.
    limit: int = 100_000  # Largest number of states of a task.
    out: Path | None = None  # Folder for a picture of a PCM's values.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the start, where it is random.


def run(args: Args) -> int:
    """Checks a pair; 1 if it is not a PCM."""
    import numpy as np
    from hose_learning.mdp import partially_constrained as pcm

    if args.list:
        return list_pairs(args)
    check_counts(args, seed=0)
    if not 0.0 <= args.discount < 1.0:
        raise InputError("discount", args.discount, "a number from 0 up to, but not including, 1")
    pair = choose_pair(args)
    written = pcm.write_pair(*pcm.make_tasks(pair), np.random.default_rng(args.seed), args.limit)
    models = (written.source.model, written.target.model, written.projection)
    violations = pcm.find_violations(*models, args.reading)
    propositions = None if violations else pcm.compute_propositions(*models, args.discount)
    checks = make_checks(violations, propositions)
    if args.out is not None and propositions is not None:
        title = args.example or f"{args.source} to {args.target}"
        write_atomically(args.out / "pcm.png", draw_values(title, propositions))
    found = (pair, written, violations, propositions)
    ending = "a PCM" if not violations else "not a PCM"
    results = make_results(*found)
    return finish("check-pcm", args, checks, results, lambda: _summarize(*found), ending=ending)


def choose_pair(args: Args) -> Pair:
    """Returns the pair that the arguments name.

    Raises:
        InputError: an unknown example, an example with tasks or options, or tasks left out.
    """
    from hose_learning.mdp.partially_constrained import PAIRS, Pair

    if args.example is not None:
        check_choice("example", args.example, PAIRS)
        if args.source is not None or args.set:
            raise InputError("example", args.example, "an example without tasks and options")
        return PAIRS[args.example]
    if args.source is None or args.target is None:
        given = (args.source, args.target)
        raise InputError("tasks", given, "two ids, SOURCE TARGET, or --example")
    options = read_options(args.set, ("source", "target"))
    return Pair("", args.source, args.target, options[""], options["source"], options["target"])


def make_checks(violations: list[PcmViolation], propositions: Propositions | None) -> list[Check]:
    """Makes the checks: four properties, and for a PCM the two propositions."""
    from hose_learning.mdp.partially_constrained import PROPERTIES

    counts = {violation.number: violation.count for violation in violations}
    checks = [
        Check(f"property {number}: exceptions ({says})", counts.get(number, 0), 0, "==")
        for number, says in PROPERTIES.items()
    ]
    if propositions is not None:
        unsafe = propositions.unsafe_in_source
        checks += [
            Check("proposition 4: safe in the target, not in the source", unsafe, 0, "=="),
            Check("proposition 5, corrected: V_t* - max Q_s*", propositions.excess, 1e-9),
        ]
    return checks


def make_results(
    pair: Pair,
    written: WrittenPair,
    violations: list[PcmViolation],
    propositions: Propositions | None,
) -> dict[str, Any]:
    """Returns the document's own entries."""
    actions, names = written.target.model.actions, written.target.model.names
    return {
        "source": pair.source,
        "target": pair.target,
        "source_states": written.source.model.n_states,
        "target_states": written.target.model.n_states,
        "is_pcm": not violations,
        "violations": [
            {
                "property": violation.number,
                "count": violation.count,
                "state": names[violation.state],
                "action": None if violation.action is None else actions[violation.action],
                "source": violation.source,
                "target": violation.target,
            }
            for violation in violations
        ],
        "propositions": None
        if propositions is None
        else {
            "unsafe_in_source": propositions.unsafe_in_source,
            "excess": propositions.excess,
            "shortfall": propositions.shortfall,
            "shortfall_state": names[propositions.shortfall_state],
        },
    }


def list_pairs(args: Args) -> int:
    """Prints the ready pairs."""
    from hose_learning.mdp.partially_constrained import PAIRS

    if args.json:
        pairs = [{"name": name, **asdict(pair)} for name, pair in PAIRS.items()]
        print_document(make_document("check-pcm", args, results={"pairs": pairs}))
        return 0
    for name, pair in PAIRS.items():
        properties = ", ".join(map(str, pair.violated))
        print(f"{name:20} {pair.meaning} ({f'violates {properties}' if properties else 'a PCM'})")
    return 0


def _summarize(
    pair: Pair,
    written: WrittenPair,
    violations: list[PcmViolation],
    propositions: Propositions | None,
) -> None:
    sizes = (written.source.model.n_states, written.target.model.n_states)
    print(f"source {pair.source}: {sizes[0]:,} states; target {pair.target}: {sizes[1]:,} states")
    for violation in violations:
        print(f"\n{violation}, first:")
        print(f"  source: {violation.source}\n  target: {violation.target}")
    if propositions is not None and propositions.shortfall > 0.0:
        state = written.target.model.names[propositions.shortfall_state]
        print(f"greedy on the transferred values is {propositions.shortfall:.4g} short at {state}")


def draw_values(title: str, propositions: Propositions) -> bytes:
    """Returns the PNG: the bound of each target state and what greedy transfer gets, over V_t*."""
    import numpy as np

    from hose_mj.recording.palette import OTHERS, format_hex
    from hose_mj.recording.plots.style import SOFT, add_legend, encode_png, make_axes

    best = propositions.best
    with make_axes(f"Values that a PCM transfers: {title}", (6.4, 4.6)) as (figure, axes):
        ends = np.array([min(best.min(), propositions.greedy.min()), propositions.bounds.max()])
        axes.plot(ends, ends, color=SOFT, lw=0.8, ls=(0, (4, 3)), label="$V_t^*$ itself")
        for values, name, marker, place in (
            (propositions.bounds, "$\\max_a Q_s^*([s], a)$: never below", "o", 1),
            (propositions.greedy, "greedy on the transferred values: never above", "x", 0),
        ):
            color = format_hex(OTHERS[place])
            axes.plot(best, values, ls="", marker=marker, ms=5.0, mfc="none", c=color, label=name)
        axes.set_xlabel("best value of a target state, $V_t^*(s)$")
        axes.set_ylabel("value")
        add_legend(figure, axes.get_legend_handles_labels()[0], columns=2)
        return encode_png(figure)
