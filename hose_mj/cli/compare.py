"""`hose-mj compare`: GEDS against MuJoCo's cable and closed forms, or on a user's own hose."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.cli.results import check_counts, make_folder, print_checks, print_table
from hose_mj.errors import InputError
from hose_mj.extras import is_installed, require_all
from hose_mj.recording.document import make_document, print_document

if TYPE_CHECKING:
    from hose_mj.validation.case import Case
    from hose_mj.validation.study import Study
    from hose_mj.validation.user_hose.study import UserHoseStudy

MODELS = ("geds", "cable", "flex", "hinge-chain")
OUT = Path("out/compare")
QUICK_SHARE = 1.0 / 3.0  # of its budget that a user's hose gets with --quick
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
    out: Path = OUT
    """Folder for the report, the plots, the numbers and the recording. With --json alone nothing
    is written there where the extras report and viewer are not installed."""
    quick: bool = False
    """A smaller grid, about two minutes once compiled. For your own hose:
    a third of its budget."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of the random states.


def run(args: Args) -> int:
    """Runs the comparison; 1 if a check failed."""
    with_report = check_report(args)
    users = args.my_hose
    measure = prepare_cases(args) if users is None else prepare_user_hose(args, users)
    if with_report:
        make_folder(args.out)
    begun = time.perf_counter()
    where = "none, for want of the extras report and viewer"
    with show_progress() as advance:
        study = measure(advance)
        results = {
            "records": study.list_records(),
            "ratios": [asdict(ratio) for ratio in study.ratios],
            "skipped": study.list_skipped(),
            "health": study.list_health(),
        }
        if study.user is not None:
            results |= study.user.to_results()
        document = make_document("compare", args, checks=study.checks, results=results)
        if with_report:
            from hose_mj.validation.report.page import write_all

            advance("report")
            where = str(write_all(study, document, args.out).resolve())
    if args.json:
        print_document(document)
    elif study.user is not None:
        print_user_hose(study.user)
    else:
        print_cases(study)
    passed, seconds = sum(check.ok for check in study.checks), time.perf_counter() - begun
    counted = f"{passed} of {len(study.checks)} checks ok, {seconds:.0f} s"
    print(f"{counted}\nreport: {where}", file=sys.stderr if args.json else sys.stdout)
    return 0 if passed == len(study.checks) else 1


def check_report(args: Args) -> bool:
    """Says whether a report is written; not for --json alone where what it needs is missing.

    Raises:
        MissingExtra: one is wanted, and what it needs is not installed.
    """
    if args.json and args.out == OUT and not (is_installed("report") and is_installed("viewer")):
        return False
    require_all(("report", "viewer"), "the report of a comparison")
    return True


def prepare_cases(args: Args) -> Callable[[Callable[[str], None]], Study]:
    """Checks all arguments; returns what runs the cases, told by its argument what comes next.

    Raises:
        InputError: as in `check_arguments`.
    """
    from hose_mj.validation.cases import find_trials
    from hose_mj.validation.settings import has_cable
    from hose_mj.validation.study import read_committed_cable, run_study

    cases = check_arguments(args)
    left_out = args.models == MODELS and not has_cable()
    models = tuple(m for m in dict.fromkeys(args.models) if m != "cable" or not left_out)

    def measure(advance: Callable[[str], None]) -> Study:
        numerics = not args.cases and "geds" in models
        options: Any = {"quick": args.quick, "seed": args.seed, "with_numerics": numerics}
        trials = find_trials(args.cases) if "geds" in models else ()
        study = run_study(cases, models, trials, **options, advance=advance)
        study.committed = read_committed_cable(cases) if left_out else None
        return study

    return measure


def check_arguments(args: Args) -> tuple[Case, ...]:
    """Returns the cases to run, those that some chosen model runs; none where all are trials.

    Raises:
        InputError: an unknown case or model, no case left, a bad seed or folder.
    """
    from hose_mj.validation.cases import find_cases, find_trials
    from hose_mj.validation.settings import has_cable

    for model in args.models:
        if model not in MODELS:
            raise InputError("model", model, ", ".join(MODELS))
    if "cable" in args.models and args.models != MODELS and not has_cable():
        others = ", ".join(model for model in MODELS if model != "cable")
        valid = f"{others} with this MuJoCo, which has no cable (without --models: as committed)"
        raise InputError("model", "cable", valid)
    if not args.models:
        raise InputError("models", args.models, f"one or more of {', '.join(MODELS)}")
    check_counts(args, seed=0)
    found = find_cases(args.cases)
    cases = tuple(case for case in found if set(case.models) & set(args.models))
    if not cases and not (find_trials(args.cases) and "geds" in args.models):
        run_with = dict.fromkeys(model for case in found for model in case.models) or ("geds",)
        raise InputError("models", args.models, f"for these cases one of {', '.join(run_with)}")
    return cases


def prepare_user_hose(args: Args, path: Path) -> Callable[[Callable[[str], None]], Study]:
    """Checks all arguments, returns what runs a user's hose.

    Raises:
        InputError: something wrong in the file, an unknown model, a bad seed or folder; cases.
    """
    from hose_mj.scenes.hose_file.hose_file import find_hose_file, read_hose_file
    from hose_mj.validation.study import study_user_hose
    from hose_mj.validation.user_hose.study import check_models, list_models

    if args.cases:
        raise InputError("cases", args.cases, "none beside a hose of your own")
    models = list_models() if args.models == MODELS else check_models(args.models)
    check_counts(args, seed=0)
    hose = read_hose_file(find_hose_file(path))
    if args.quick:
        hose = replace(hose, budget=hose.budget * QUICK_SHARE)
    return partial(study_user_hose, hose, models)


@contextmanager
def show_progress() -> Iterator[Callable[[str], None]]:
    """A line on stderr that says what is being run; nothing where that is no terminal."""
    from rich.console import Console
    from rich.status import Status

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda text: None
        return
    with Status("starting", console=console) as status:
        yield status.update


def print_cases(study: Study) -> None:
    """Prints checks and ratios on stdout; and the cable's committed runs, where it cannot run."""
    print_checks(study.checks)
    if study.ratios:
        title = "Wall time at equal error, each model at its cheapest setting"
        ratios = [
            (
                *(r.case, f"{100 * r.at_error:g} %", f"{r.wall_ratio:.1f}"),
                *(r.model_setting.removeprefix("geds, "), r.against_setting),
            )
            for r in study.ratios
        ]
        print_table(title, ("case", ">error", ">times cheaper", "GEDS", "against"), ratios)
    if study.committed is not None:
        cable = study.committed
        title = f"MuJoCo's cable, committed: run with MuJoCo {cable.mujoco}, not {cable.here}"
        print_table(title, ("case", ">runs", ">smallest error"), cable.summarize())


def print_user_hose(study: UserHoseStudy) -> None:
    """Prints what was found, on stdout."""
    from rich.console import Console

    from hose_mj.validation.report.findings import describe_findings, make_answer_row

    console = Console(highlight=False)
    console.print(f"[bold]{study.hose.title}[/]\n{study.result.case.about}\n")
    for line in describe_findings(study):
        console.print(f"- {line}")
    console.print()
    title = "The cheapest setting within a wanted error (of the length)"
    names = (">wanted", "model", ">resolution", ">step", ">error", ">wall s / sim s")
    print_table(title, names, [make_answer_row(one, study.cut_short) for one in study.answers])
