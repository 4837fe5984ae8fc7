"""`hose-mj consensus`: agents agree on whose turn it is (thesis section 6.5)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hose_learning.consensus import ConsensusSettings

from hose_mj.checks import Check
from hose_mj.cli.results import check_counts, finish, print_table
from hose_mj.recording.files import write_atomically

if TYPE_CHECKING:
    from hose_learning.consensus import ConsensusTrial

LOSSES = (0.0, 0.1, 0.5)  # shares of lost messages that are always tried, beside the one asked for
LARGEST_SPREAD = 0.05  # disagreement that counts as agreement, in turns
SCATTER = 1.2  # what chance may add to a disagreement measured over so many turns


@dataclass(frozen=True)
class Args:
    """Simulate turns by consensus: each agent has a clock, and messages are lost and late.

    Every loss of 0, 10 and 50 % is tried, and the one given. Checked are that clocks which begin
    turns apart agree, that they stay within the exact value of their disagreement, that the order
    of turns is kept and that no two agents act at once. Times are in turns.
    """

    agents: int = 4  # Number of agents.
    loss: float = 0.1  # Probability that a message is lost.
    delay: int = 1
    """Largest delay of a message, in rounds of messages; each has a random one up to it."""
    drift: float = 0.02  # Largest relative error of a clock's rate.
    rounds: int = 50  # Rounds of messages in one turn.
    action_time: float = 0.5  # Longest action, in turns; durations are random up to it.
    wait: bool = False
    """Let each turn run out instead of giving it to the next agent when the action is done."""
    falls_back: bool = False
    """Let clocks fall back below a turn that they have reached, as the thesis has it."""
    turns: int = 60  # Turns to play.
    out: Path = Path("out/consensus")  # Folder for the picture.
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of everything random.


def run(args: Args) -> int:
    """Runs the trials; 1 if a check failed."""
    from hose_learning.consensus import draw_consensus, run_trial

    check_counts(args, seed=0)
    asked = ConsensusSettings(
        n_agents=args.agents,
        loss=args.loss,
        delay=args.delay,
        drift=args.drift,
        rounds=args.rounds,
        n_turns=args.turns,
        action_time=args.action_time,
        early_finish=not args.wait,
        falls_back=args.falls_back,
    )
    losses = sorted({*LOSSES, asked.loss})
    trials = [run_trial(replace(asked, loss=loss), args.seed) for loss in losses]
    checks = [check for trial in trials for check in make_checks(trial)]
    picture = args.out / "consensus.png"
    own = next(trial for trial in trials if trial.settings.loss == asked.loss)
    write_atomically(picture, draw_consensus(trials, own))
    passed = sum(check.ok for check in checks)
    results = {"records": [trial.record for trial in trials], "picture": picture}
    ending = f"{passed} of {len(checks)} checks ok\npicture: {picture}"
    return finish("consensus", args, checks, results, lambda: _summarize(trials), ending=ending)


def make_checks(trial: ConsensusTrial) -> list[Check]:
    """Makes the checks of one loss."""
    found = trial.record
    name = f"loss {100.0 * trial.settings.loss:g} %: "
    safe = found["longest_safe_action"]
    exact = SCATTER * found["exact_disagreement"] + 1e-9  # equal clocks differ by rounding alone
    return [
        Check(name + "spread when the first turn begins", found["agreed_spread"], LARGEST_SPREAD),
        Check(name + "disagreement against its exact value", found["disagreement"], exact),
        Check(name + "turns out of order", found["disorder"], 0, "=="),
        Check(name + "actions begun during another", found["overlaps"], 0, "=="),
        Check(name + "longest action that is surely safe", safe, trial.settings.action_time, ">="),
    ]


def _summarize(trials: list[ConsensusTrial]) -> None:
    title = f"{trials[0].settings.n_agents} clocks in consensus (unit: one turn)"
    columns = {
        ">lost": ("loss", "{:.0%}"),
        ">first spread": ("first_spread", "{:.3g}"),
        ">spread, agreed": ("agreed_spread", "{:.2g}"),
        ">disagreement": ("disagreement", "{:.3g}"),
        ">exact": ("exact_disagreement", "{:.3g}"),
        ">turns per unit": ("turns_per_time", "{:.3g}"),
    }
    rows = [[form.format(t.record[key]) for key, form in columns.values()] for t in trials]
    print_table(title, list(columns), rows)
