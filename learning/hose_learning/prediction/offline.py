"""The experiment of section 8.3.1: all classifiers on random logs, beside the thesis's tables."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.stats import t as student

from hose_learning.experience import Experience, record_experience
from hose_learning.prediction import cross_validation
from hose_learning.prediction.attributes import Encoding, make_attributes
from hose_learning.prediction.classifiers import CLASSIFIERS, ClusterRule, Setup, make_classifier
from hose_mj.checks import Check
from hose_mj.errors import InputError
from hose_mj.tasks.kernels import Floats
from hose_mj.tasks.registry import make_task

MARGIN = 0.001  # the tables round their numbers (to 0.01 %), and average them over folds


@dataclass(frozen=True)
class Published:
    """A row of a table.

    Attributes:
        measures: by the names of `MEASURES`, as fractions. The last column of Table 8.2b is headed
            NPV but holds the positive predictive value, which its rows give within half a per cent,
            so it is `ppv`.
        doubtful: accuracy does not lie between sensitivity and specificity, as it must: one of the
            three is misprinted.
    """

    measures: dict[str, float]
    doubtful: bool


@dataclass(frozen=True)
class PublishedTable:
    """A table of the thesis."""

    number: str  # such as 8.2
    data: str  # what was classified, in words
    cycles: int  # length of the log, in moves of each agent
    agents: tuple[dict[str, Published], ...]  # for each agent the rows by id of the classifier


def read_table(task: str) -> PublishedTable | None:
    """Returns the table about a task, None where there is none."""
    text = files("hose_learning.prediction").joinpath("published.json").read_text(encoding="utf-8")
    for table in json.loads(text)["tables"]:
        if table["task"] == task:
            agents = tuple(
                {
                    id: _make_row(dict(zip(agent["columns"], row, strict=True)))
                    for id, row in agent["rows"].items()
                }
                for agent in table["agents"]
            )
            return PublishedTable(table["table"], table["data"], table["cycles"], agents)
    return None


def _make_row(per_cent: dict[str, float]) -> Published:
    measures = {name: round(value / 100.0, 6) for name, value in per_cent.items()}
    ends = sorted((measures["sensitivity"], measures["specificity"]))
    is_between = ends[0] - MARGIN <= measures["accuracy"] <= ends[1] + MARGIN
    return Published(measures, not is_between)


Scores = dict[str, cross_validation.Score]  # by the names of `MEASURES`

LIFTED = 10**9  # a step limit that no log reaches
COMPARED = ("1-nn", "naive-bayes", "random-forest", "c4.5")
"""Whose accuracy is held against the table: they hardly depend on settings that it leaves open."""
CONFIDENCE = 0.99


@dataclass(frozen=True, kw_only=True)
class OfflinePlan:
    """What is to be measured; `InputError` for fewer than one cycle or log, or a negative seed."""

    task: str = "taxi"  # id of the task
    cycles: int = 2002  # moves of each agent in a log
    # Number of logs. The first is measured as the thesis's was, the others once each, for how much
    # the numbers differ from log to log.
    logs: int = 8
    repeats: int = 10  # how often the folds of the first log are drawn anew
    folds: int = 10  # parts that each agent's moves are split into
    encoding: Encoding = field(default_factory=Encoding)  # how states and actions become attributes
    cluster_rule: ClusterRule = "matched"  # how clusters become classes, see `ClusterClassifier`
    seed: int = 0  # of everything random

    def __post_init__(self) -> None:
        for name in ("cycles", "logs"):
            if getattr(self, name) < 1:
                raise InputError(name, getattr(self, name), "a whole number, at least 1")
        if self.seed < 0:
            raise InputError("seed", self.seed, "a whole number, at least 0")


@dataclass(frozen=True)
class Result:
    """One classifier on one agent's moves."""

    agent: str
    classifier: str
    scores: Scores  # on the first log
    over_logs: dict[str, Floats]  # the mean of each measure on every log (n_logs,)
    published: Published | None  # the row of the thesis's table, None without one


@dataclass(frozen=True, eq=False)
class Study:
    """All results, and the first log."""

    plan: OfflinePlan
    experience: Experience
    table: PublishedTable | None
    results: tuple[Result, ...]


def run_study(plan: OfflinePlan, on_fold: Callable[[], object] = lambda: None) -> Study:
    """Logs random moves, the step limit lifted, and cross-validates all classifiers on them.

    `on_fold` is called after each fold of each classifier. `InputError` is raised for a task that
    does not exist, or too few undesired moves for the folds.
    """
    task = make_task(plan.task, step_limit=LIFTED)
    experiences, logs = [], []
    for k, generator in enumerate(np.random.default_rng(plan.seed).spawn(plan.logs)):
        experiences.append(record_experience(task, plan.cycles * task.n_agents, generator))
        once = plan if k == 0 else replace(plan, repeats=1)
        logs.append(score_log(once, experiences[k], generator, on_fold))
    table = read_table(plan.task)
    results = []
    for (agent, id), scores in logs[0].items():
        rows = table.agents[agent] if table and agent < len(table.agents) else {}
        over_logs = {name: np.array([log[agent, id][name].mean for log in logs]) for name in scores}
        results.append(Result(task.agents[agent], id, scores, over_logs, rows.get(id)))
    return Study(plan, experiences[0], table, tuple(results))


def score_log(
    plan: OfflinePlan,
    experience: Experience,
    generator: np.random.Generator,
    on_fold: Callable[[], object],
) -> dict[tuple[int, str], Scores]:
    """Cross-validates all classifiers on each agent's moves: scores by agent and classifier."""
    scored = {}
    for agent in range(len(experience.agent_names)):
        own = experience.select(agent)
        attributes, _ = make_attributes(own, plan.encoding)
        undesired = own.undesired
        splits = cross_validation.make_splits(undesired, plan.repeats, plan.folds, generator)
        setup = Setup(attributes.shape[1], float(undesired.mean()), plan.cluster_rule, 0)
        for id in CLASSIFIERS:
            make = _make_maker(id, setup)
            scored[agent, id] = cross_validation.cross_validate(
                make, attributes, undesired, splits, on_fold
            )
    return scored


def _make_maker(id: str, setup: Setup) -> cross_validation.MakeClassifier:
    return lambda seed: make_classifier(id, replace(setup, seed=seed))


def count_folds(plan: OfflinePlan) -> int:
    """Returns how often `run_study` calls `on_fold`."""
    folds = (plan.repeats + plan.logs - 1) * plan.folds
    return make_task(plan.task).n_agents * len(CLASSIFIERS) * folds


def list_records(study: Study) -> list[dict[str, Any]]:
    """Lists every measure of every classifier as a flat record, None where it does not exist."""

    def finite(value: float) -> float | None:
        return value if math.isfinite(value) else None

    records = []
    for result in study.results:
        published = result.published
        for name in cross_validation.MEASURES:
            score = result.scores[name]
            over_logs = cross_validation.compute_score(result.over_logs[name], 0.0)
            records.append(
                {
                    "agent": result.agent,
                    "classifier": result.classifier,
                    "measure": name,
                    "value": finite(score.mean),
                    "deviation": finite(score.deviation),
                    "interval": finite(score.interval),
                    "logs_mean": finite(over_logs.mean),
                    "logs_deviation": finite(over_logs.deviation),
                    "thesis": published.measures.get(name) if published else None,
                    "doubtful": published.doubtful if published else None,
                }
            )
    return records


def list_checks(study: Study) -> list[Check]:
    """Holds the taxi against Table 8.2, where logs and attributes are made as for the table.

    The claims of section 8.3.1.2 are that C4.5 is the best of all, and that tree-based methods are
    better than any other family. Besides, each accuracy of the table that comes from an algorithm
    without open settings should be one more draw from the distribution of ours over logs. Table 8.1
    is about a task that cannot be logged yet.
    """
    plan, table = study.plan, study.table
    if table is None or plan.cycles != table.cycles or plan.encoding != Encoding():
        return []
    checks = []
    for agent in study.experience.agent_names:
        results = [result for result in study.results if result.agent == agent]
        checks += _check_claims(agent, results)
        if plan.logs > 1:
            rows = [r for r in results if r.classifier in COMPARED and r.published is not None]
            checks += [_check_row(row, row.published) for row in rows if row.published]
    return checks


def _check_claims(agent: str, results: Sequence[Result]) -> list[Check]:
    accuracies = {result.classifier: result.scores["accuracy"].mean for result in results}
    trees = {id for id in accuracies if CLASSIFIERS[id].family == "tree"}
    others = max(value for id, value in accuracies.items() if id != "c4.5")
    worst_tree = min(accuracies[id] for id in trees)
    best_other = max(value for id, value in accuracies.items() if id not in trees)
    what = f"{agent}: accuracy of the "
    best = Check(what + "entropy tree less the best other", accuracies["c4.5"] - others, 0.0, ">=")
    family = Check(what + "worst tree less the best of no tree", worst_tree - best_other, 0.0, ">=")
    return [best, family]


def _check_row(result: Result, published: Published) -> Check:
    """Whether the table's accuracy lies in the 99 % prediction interval of one more log."""
    ours = result.over_logs["accuracy"]
    n = len(ours)
    spread = float(ours.std(ddof=1)) * math.sqrt(1.0 + 1.0 / n)
    distance = abs(published.measures["accuracy"] - float(ours.mean()))
    limit = float(student.ppf(0.5 + CONFIDENCE / 2.0, n - 1))
    name = CLASSIFIERS[result.classifier].name
    what = f"{result.agent}: accuracy of {name} in the thesis, deviations from ours over logs"
    return Check(what, distance / spread if spread > 0.0 else math.inf, limit)
