"""`hose-mj compare`: GEDS against MuJoCo's cable and closed forms, or on a user's own hose."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.recording.document import make_document, print_document

if TYPE_CHECKING:
    from hose_mj.scenes.hose_file.hose_file import OwnHose
    from hose_mj.validation.case import Case
    from hose_mj.validation.compare import Ratio

MODELS = ("geds", "cable", "flex", "hinge-chain")
_MY_HOSE = tyro.conf.arg(metavar="[MY_HOSE.toml]")


@dataclass(frozen=True)
class Args:
    """Compare the GEDS hose with MuJoCo's cable and flex and with closed forms.

    With a file that describes your own hose (docs/own_hose.md), compare the models on that hose
    instead: how far they disagree, how fine each must be for a wanted error, what that costs.

    Writes report.html (self-contained), plots as PNG, the numbers as records.parquet and
    records.csv, and models.rrd, a Rerun recording with the models overlaid.
    """

    my_hose: Annotated[Path | None, tyro.conf.Positional, _MY_HOSE] = None
    """A hose of your own, in TOML; the examples that come with hose_mj are found by their names."""
    cases: tuple[str, ...] = ()
    """Case ids or families; all of them by default, with the checks of GEDS's own numerics."""
    models: Annotated[tuple[str, ...], tyro.conf.arg(metavar="{geds,cable,flex,hinge-chain}")] = (
        MODELS
    )
    """Models to run."""
    out: Path = Path("out/compare")
    """Folder for the report, the plots, the numbers and the recording."""
    quick: bool = False
    """A smaller grid, about two minutes once compiled. For your own hose:
    a third of its budget."""
    json: bool = False
    """Print one JSON document on stdout; messages go to stderr."""
    seed: int = 0
    """Seed of the random states."""


def run(args: Args) -> int:
    """Runs the comparison; 1 if a check failed."""
    from hose_mj.cli.compare_own import choose_own_models, print_own, study_own_hose
    from hose_mj.validation.report.output import write_all
    from hose_mj.validation.study import run_study

    own = None if args.my_hose is None else check_own_arguments(args, args.my_hose)
    cases = check_arguments(args) if own is None else ()
    begun = time.perf_counter()
    with show_progress() as advance:
        if own is not None:
            study = study_own_hose(own, choose_own_models(args.models), advance)
        else:
            study = run_study(
                cases,
                tuple(dict.fromkeys(args.models)),
                quick=args.quick,
                seed=args.seed,
                with_numerics=not args.cases and "geds" in args.models,
                advance=advance,
            )
        results = {
            "records": [outcome.to_record() for outcome in study.outcomes],
            "ratios": [asdict(ratio) for ratio in study.ratios],
            "skipped": study.list_skipped(),
        }
        if study.own is not None:
            results |= study.own.to_results()
        document = make_document("compare", args, checks=study.checks, results=results)
        advance("report")
        report = write_all(study, document, args.out)
    if args.json:
        print_document(document)
    elif study.own is not None:
        print_own(study.own)
    else:
        _summarize(study.checks, study.ratios)
    failed = [check for check in study.checks if not check.ok]
    seconds = time.perf_counter() - begun
    passed = f"{len(study.checks) - len(failed)} of {len(study.checks)} checks ok"
    stream = sys.stderr if args.json else sys.stdout
    print(f"{passed}, {seconds:.0f} s\nreport: {report.resolve()}", file=stream)
    return 1 if failed else 0


def check_arguments(args: Args) -> tuple[Case, ...]:
    """Returns the cases to run, those that some chosen model runs; makes the folder `out`.

    Raises:
        InputError: an unknown case or model, no case left, a bad seed or folder.
    """
    from hose_mj.validation.cases import find_cases

    for model in args.models:
        if model not in MODELS:
            raise InputError("model", model, ", ".join(MODELS))
    if not args.models:
        raise InputError("models", args.models, f"one or more of {', '.join(MODELS)}")
    _check_seed(args.seed)
    found = find_cases(args.cases)
    cases = tuple(case for case in found if set(case.models) & set(args.models))
    if not cases:
        run_with = dict.fromkeys(model for case in found for model in case.models)
        raise InputError("models", args.models, f"for these cases one of {', '.join(run_with)}")
    make_folder(args.out)
    return cases


def check_own_arguments(args: Args, path: Path) -> OwnHose:
    """Returns the user's hose; makes the folder `out`.

    Raises:
        InputError: something wrong in the file, an unknown model, a bad seed or folder; cases.
    """
    from hose_mj.cli.compare_own import choose_own_models, read_own

    if args.cases:
        raise InputError("cases", args.cases, "none beside a hose of your own")
    choose_own_models(args.models)
    _check_seed(args.seed)
    own = read_own(path, quick=args.quick)
    make_folder(args.out)
    return own


def _check_seed(seed: int) -> None:
    if seed < 0:
        raise InputError("seed", seed, "a whole number, at least 0")


def make_folder(out: Path) -> None:
    """Makes the folder `out` unless it is there.

    Raises:
        InputError: it cannot be made or written to.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        valid = f"a folder, or a place where one can be made ({error.strerror})"
        raise InputError("out", str(out), valid) from error
    if not os.access(out, os.W_OK):
        raise InputError("out", str(out), "a folder that you may write to")


@contextmanager
def show_progress() -> Iterator[Any]:
    """A line on stderr that says what is being run; nothing where that is no terminal."""
    from rich.console import Console
    from rich.status import Status

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda text: None
        return
    with Status("starting", console=console) as status:
        yield status.update


def _summarize(checks: list[Check], ratios: list[Ratio]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    table = Table(title="Checks")
    for name in ("", "what", "value", "limit"):
        table.add_column(name, justify="left" if name in ("", "what") else "right")
    for check in checks:
        mark = "[green]ok[/]" if check.ok else "[red]failed[/]"
        table.add_row(mark, check.name, f"{check.value:.3g}", f"{check.comparison} {check.limit:g}")
    console.print(table)
    if not ratios:
        return
    table = Table(title="Wall time at equal error, each model at its cheapest setting")
    for name in ("case", "error", "times cheaper", "GEDS", "against"):
        table.add_column(name, justify="right" if name in ("error", "times cheaper") else "left")
    for ratio in ratios:
        table.add_row(
            ratio.case,
            f"{100 * ratio.at_error:g} %",
            f"{ratio.wall_ratio:.1f}",
            ratio.model_setting.removeprefix("geds, "),
            ratio.against_setting,
        )
    console.print(table)
