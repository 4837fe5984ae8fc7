"""What `hose-mj classifiers` prints and writes: tables, log, records and a plot."""

import math
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from hose_learning.experience import write_experience
from hose_learning.prediction.classifiers import CLASSIFIERS
from hose_learning.prediction.cross_validation import MEASURES, Score, compute_score
from hose_learning.prediction.offline import Result, Study
from hose_mj.recording.document import format_document
from hose_mj.recording.files import write_atomically
from hose_mj.recording.parquet import write_records
from hose_mj.recording.plots.bars import Bar, BarPanel, plot_bars

HEADINGS = dict(
    zip(
        (*MEASURES, "over_logs"),
        ("accuracy", "sens.", "spec.", "NPV", "PPV", "over logs"),
        strict=True,
    )
)
PLOTTED = {"accuracy": "accuracy", "specificity": "specificity: undesired moves found"}


def print_study(study: Study) -> None:
    """Prints a table for each agent, and what stands in for what."""
    console = Console()
    for agent in study.experience.agent_names:
        console.print(make_table(study, agent))
    console.print("accuracy ± deviation over folds; over logs: accuracy ± deviation over logs")
    stand_ins = [f"{e.name}: {e.runs}" for e in CLASSIFIERS.values() if e.stands_in]
    console.print("* stand-ins. " + "; ".join(stand_ins) + ".")
    if study.table is not None:
        console.print("? accuracy is not between sensitivity and specificity: misprinted")


def make_table(study: Study, agent: str) -> Table:
    """Returns the table of an agent: per cent, and the standard deviation over the folds."""
    title = f"{study.plan.task}, {agent}: per cent"
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("classifier", no_wrap=True)
    for name in (*MEASURES, "over_logs"):
        table.add_column(HEADINGS[name], justify="right", no_wrap=True)
    for result in study.results:
        if result.agent != agent:
            continue
        entry = CLASSIFIERS[result.classifier]
        table.add_row(entry.name + "*" * entry.stands_in, *format_scores(result))
        if result.published is not None:
            mark = " ?" if result.published.doubtful else ""
            table.add_row(f"  thesis{mark}", *format_published(result), style="dim")
    return table


def format_scores(result: Result) -> list[str]:
    """Returns the measures on the first log, then the accuracy over all logs."""
    over_logs = compute_score(result.over_logs["accuracy"], 0.0)
    rest = [format_mean(result.scores[name]) for name in MEASURES[1:]]
    return [format_spread(result.scores[MEASURES[0]]), *rest, format_spread(over_logs)]


def format_spread(score: Score) -> str:
    """Returns "85.1 ± 2.4"; the mean alone where there is no deviation."""
    if not math.isfinite(score.deviation):
        return format_mean(score)
    return f"{format_mean(score)} ± {100 * score.deviation:.1f}"


def format_mean(score: Score) -> str:
    """Returns "85.1", a dash where the measure does not exist."""
    return f"{100 * score.mean:.1f}" if math.isfinite(score.mean) else "-"


def format_published(result: Result) -> list[str]:
    """Returns the thesis's measures, nothing where the table has none."""
    row = result.published.measures if result.published else {}
    return [f"{100 * row[name]:.1f}" if name in row else "" for name in MEASURES]


def write_study(study: Study, document: dict[str, Any], folder: Path) -> None:
    """Writes the log, the document, the records and the plot into a folder."""
    write_experience(folder / "experience.npz", study.experience)
    write_atomically(folder / "document.json", format_document(document).encode())
    write_records(
        document["records"],
        folder / "records.parquet",
        folder / "records.csv",
        metadata={name: str(document[name]) for name in ("version", "revision", "machine")},
        types={**dict.fromkeys(("logs_deviation", "thesis"), float), "doubtful": bool},
    )
    write_atomically(folder / "classifiers.png", draw_study(study))


def draw_study(study: Study) -> bytes:
    """Draws accuracy and specificity of all classifiers, a panel for each agent."""
    panels = []
    for agent, agent_name in enumerate(study.experience.agent_names):
        results = [result for result in study.results if result.agent == agent_name]
        series = {
            label: [make_bar(result, name) for result in results] for name, label in PLOTTED.items()
        }
        safe = 1.0 - float(study.experience.select(agent).undesired.mean())
        guide = (safe, 'accuracy of always "safe"')
        panels.append(BarPanel(agent_name, series, guide))
    names = [entry.name + "*" * entry.stands_in for entry in CLASSIFIERS.values()]
    reference = f"thesis, Table {study.table.number}" if study.table else "thesis (none)"
    return plot_bars(names, panels, reference)


def make_bar(result: Result, measure: str) -> Bar:
    """Returns the bar of a measure, with its 95 % interval."""
    score = result.scores[measure]
    published = result.published
    reference = None if published is None else published.measures.get(measure)
    sure = published is None or not published.doubtful
    return Bar(score.mean, score.interval, reference, sure)
