"""The numbers of Tables 8.1 and 8.2, to be read beside ours."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib.resources import files

MARGIN = 0.001
"""The tables round their numbers (to 0.01 %), and average them over folds."""


@dataclass(frozen=True)
class Published:
    """A row of a table.

    Attributes:
        measures: by the names of `measures.MEASURES`, as fractions. The last column of Table 8.2b
            is headed NPV but holds the positive predictive value, which its rows give within half
            a per cent, so it is `ppv`.
        doubtful: accuracy does not lie between sensitivity and specificity, as it must: one of the
            three is misprinted.
    """

    measures: dict[str, float]
    doubtful: bool


@dataclass(frozen=True)
class Table:
    """A table of the thesis.

    Attributes:
        number: such as "8.2".
        data: what was classified, in words.
        cycles: length of the log, in moves of each agent.
        agents: for each agent, the rows by id of the classifier.
    """

    number: str
    data: str
    cycles: int
    agents: tuple[dict[str, Published], ...]


def read_table(task: str) -> Table | None:
    """Returns the table about a task, None where there is none."""
    text = files("hose_learning").joinpath("published.json").read_text(encoding="utf-8")
    for table in json.loads(text)["tables"]:
        if table["task"] == task:
            agents = tuple(
                {
                    id: _make_row(dict(zip(agent["columns"], row, strict=True)))
                    for id, row in agent["rows"].items()
                }
                for agent in table["agents"]
            )
            return Table(table["table"], table["data"], table["cycles"], agents)
    return None


def _make_row(per_cent: dict[str, float]) -> Published:
    measures = {name: round(value / 100.0, 6) for name, value in per_cent.items()}
    ends = sorted((measures["sensitivity"], measures["specificity"]))
    is_between = ends[0] - MARGIN <= measures["accuracy"] <= ends[1] + MARGIN
    return Published(measures, not is_between)
