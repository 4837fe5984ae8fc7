"""`hose-mj check-breaks`: do the hose models break in the same way under the same moves?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.checks import Check
from hose_mj.cli.progress import show_progress
from hose_mj.cli.results import check_counts, finish
from hose_mj.constraints.limits import Limits
from hose_mj.errors import InputError, check_choice
from hose_mj.world.registry import WORLDS, make_world

if TYPE_CHECKING:
    from hose_mj.rollout.break_sequences import Ending, Move

AGREE = 0.9
QUICK = 20
_NOT_SHOWN = ("least", "warnings")  # of an ending: what stands elsewhere in the document
QUICK_MODELS = ("geds", "flex")
FINER = 2
"""Control points of geds per one that its world takes by itself, to be as fine as 40 segments."""


@dataclass(frozen=True)
class Args:
    """Play the same random moves with every hose model and compare what breaks, and where.

    One robot after another goes to a neighbouring cell, until a constraint breaks or the moves are
    over. Two models agree on a sequence when the same kind of constraint breaks while the same
    robot moves out of the same cell, or when nothing breaks in either.
    """

    scene: Annotated[str, tyro.conf.Positional] = "floor_2"
    """A shipped scene, or your own MJCF file."""
    models: tuple[str, ...] = ("geds", "cable", "flex")  # Hose models; each is compared with each.
    sequences: int = 200  # How many sequences of moves.
    moves: int = 24  # Moves in a sequence at most.
    quick: bool = False  # Play 20 sequences, with geds and flex.
    control_points: int | None = None
    """Control points of geds; by default twice as many as its world takes by itself, see docs."""
    max_tension: float | None = None
    """Tension that breaks a segment (N); by default the rule of the constraints."""
    out: Path | None = None
    """Folder to keep the endings in; the command goes on from those that are there."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the moves.


def run(args: Args) -> int:
    """Plays all sequences; 1 if two models agree in less than 90 % of them."""
    from hose_mj.rollout.break_sequences import EndingsFile, draw_sequences, play_all
    from hose_mj.scenes.mjcf.scene import find_scene, read_scene
    from hose_mj.world.initial_shape import count_control_points

    check_counts(args, sequences=1, moves=1, seed=0)
    if len(set(args.models)) < max(2, len(args.models)):
        raise InputError("models", args.models, "at least two, each once")
    for model in args.models:
        check_choice("models", model, WORLDS)
    models = QUICK_MODELS if args.quick else args.models
    number = min(args.sequences, QUICK) if args.quick else args.sequences
    limits = Limits(max_tension=args.max_tension)
    scene = read_scene(find_scene(args.scene))
    sequences = draw_sequences(args.seed, number, args.moves, len(scene.robots))
    points = args.control_points
    if points is None:
        points = FINER * count_control_points(len(scene.robots))
    endings = {}
    with show_progress("sequences", number * len(models)) as advance:
        for model in models:
            settings = {"scene": args.scene, "model": model, "seed": args.seed}
            settings |= {"moves": args.moves, "max_tension": args.max_tension}
            options = {"control_points": points} if model == "geds" else {}
            kept = EndingsFile(args.out and args.out / f"{model}.json", settings | options)
            make = partial(make_world, scene, model, **options)
            endings[model] = play_all(make, sequences, limits, kept, advance)
    pairs = [
        compare_models((a, b), (endings[a], endings[b]), sequences)
        for a, b in combinations(models, 2)
    ]
    checks = [
        Check(f"{pair['first']} and {pair['second']} break alike", pair["same_cell"], AGREE, ">=")
        for pair in pairs
    ]
    counts = {model: Counter(ending.kind for ending in found) for model, found in endings.items()}
    kinds = {model: dict(sorted(count.items())) for model, count in counts.items()}
    said = {model: [e.warnings for e in found if e.warnings] for model, found in endings.items()}
    health = {
        model: {"sequences": len(found), "warnings": sorted({w for one in found for w in one})}
        for model, found in said.items()
    }
    results = {"kinds": kinds, "pairs": pairs, "health": health}
    return finish("check-breaks", args, checks, results, lambda: _print(kinds, pairs))


def compare_models(
    names: tuple[str, str],
    endings: tuple[Sequence[Ending], Sequence[Ending]],
    sequences: Sequence[Sequence[Move]],
) -> dict[str, Any]:
    """Compares two models: shares of sequences that end alike, and those that do not."""
    both = list(zip(*endings, strict=True))
    unlike = [k for k, (a, b) in enumerate(both) if not a.agrees(b)]
    return {
        **{"first": names[0], "second": names[1], "sequences": len(both)},
        "same_kind": sum(a.kind == b.kind for a, b in both) / len(both),
        "same_cell": 1.0 - len(unlike) / len(both),
        "disagreements": [
            _describe(k, sequences[k], dict(zip(names, both[k], strict=True))) for k in unlike
        ],
    }


def _describe(number: int, moves: Sequence[Move], endings: Mapping[str, Ending]) -> dict[str, Any]:
    """A sequence that ends differently, with both models' least margins in either last move."""
    last = max(ending.turn for ending in endings.values())
    record: dict[str, Any] = {
        "number": number,
        "moves": [f"{robot} {action}" for robot, action in moves[: last + 1]],
    }
    for model, ending in endings.items():
        found = {name: value for name, value in asdict(ending).items() if name not in _NOT_SHOWN}
        found["margins"] = [
            {"turn": turn, **ending.least[turn]}
            for turn in sorted({one.turn for one in endings.values()})
            if turn < len(ending.least)
        ]
        record[model] = found
    return record


def _print(kinds: Mapping[str, Mapping[str, int]], pairs: Sequence[Mapping[str, Any]]) -> None:
    for model, counts in kinds.items():
        print(f"{model}: " + ", ".join(f"{count} {kind}" for kind, count in counts.items()))
    for pair in pairs:
        names = pair["first"], pair["second"]
        print(
            f"\n{names[0]} and {names[1]}: {100 * pair['same_kind']:.1f} % the same kind, "
            f"{100 * pair['same_cell']:.1f} % the same kind and cell"
        )
        for record in pair["disagreements"]:
            print(f"sequence {record['number']}: {', '.join(record['moves'])}")
            for model in names:
                found = record[model]
                print(f"  {model}, move {found['turn']} out of {found['cell']}: {found['text']}")
                for margins in found["margins"]:
                    texts = [f"{k} {v:.4g}" for k, v in margins.items() if k != "turn"]
                    print(f"    least margins in move {margins['turn']}: {', '.join(texts)}")
    print()
