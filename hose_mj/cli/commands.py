"""The sub-commands of `hose-mj`: where each lives, and what its help says beside its arguments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Renamed:
    """What became of an option; its old spelling works on for one release."""

    new: str | None  # how it is called now; None if it had no effect and is gone
    prefix: str = ""  # goes before each of its values
    # Words that the option took; if there are some, it is only with several of these that it has
    # another name now.
    several: tuple[str, ...] = ()


@dataclass(frozen=True)
class Command:
    """A sub-command."""

    module: str  # has `Args`, a frozen dataclass whose docstrings are the help, and `run(args)`
    summary: str  # its line in `hose-mj --help`
    examples: tuple[str, ...] = ()  # command lines that its own help ends with
    needs: tuple[str, ...] = ()  # extras without which it can do nothing, see `hose_mj.extras`
    # Its options that were called otherwise.
    renamed: Mapping[str, Renamed] = field(default_factory=dict)


_NO_SEED = {"--seed": Renamed(None)}

GROUPS: dict[str, dict[str, Command]] = {
    "hose": {
        "compare": Command(
            "hose_mj.cli.compare",
            "measure the hose models against closed forms, or on your own hose",
            ("hose-mj compare --quick", "hose-mj compare garden_hose --models geds cable"),
        ),
        "check-breaks": Command(
            "hose_mj.cli.check_breaks",
            "check that hose models break alike under the same moves",
            ("hose-mj check-breaks floor_2 --quick --models geds flex",),
        ),
    },
    "robots": {
        "rollout": Command(
            "hose_mj.cli.rollout",
            "run an episode of a policy in a scene with a hose",
            (
                "hose-mj rollout deck --policy break-obstacle --save deck.rrd",
                "hose-mj rollout floor_2 --models geds flex --save both.rrd",
            ),
            renamed={"--model": Renamed("--models", several=("geds", "cable", "flex"))},
        ),
        "drive": Command(
            "hose_mj.cli.drive",
            "drive the robots of a scene with the keyboard",
            ("hose-mj drive floor_2",),
            renamed=_NO_SEED,
        ),
        "view": Command(
            "hose_mj.cli.view",
            "open a recording at the moment of the break",
            ("hose-mj view deck.rrd", "hose-mj view deck.rrd --screenshot deck.png"),
            needs=("viewer",),
            renamed=_NO_SEED,
        ),
    },
    "learn": {
        "train": Command(
            "hose_mj.cli.train",
            "train a learner on a task, test it and keep what it learned",
            (
                "hose-mj train taxi --learner d-rr-ql --seed 3",
                "hose-mj train line --set n_robots=3 --episodes 5000",
            ),
        ),
        "curves": Command(
            "hose_mj.cli.learning_curves",
            "draw how learners get better as they train",
            ("hose-mj curves taxi --learners q-learning d-rr-ql --save curves.png",),
            needs=("report",),
            renamed={"--out": Renamed("--save")},
        ),
    },
    "the thesis's parts": {
        "reproduce": Command(
            "hose_mj.cli.reproduce",
            "repeat the thesis's experiments over seeds, beside its numbers",
            ("hose-mj reproduce fig-4.2 --quick",),
        ),
        "relevance": Command(
            "hose_mj.cli.relevance",
            "find the state variables that matter for each constraint",
            ("hose-mj relevance taxi --moves 20000",),
        ),
        "joint-policy": Command(
            "hose_mj.cli.joint_policy",
            "compose what agents learned in turns into joint moves",
            ("hose-mj joint-policy corridor",),
        ),
        "transfer": Command(
            "hose_mj.cli.transfer",
            "start on a task from what was learned on a simpler one",
            ("hose-mj transfer line line --set n_robots=2 source.collision=robots",),
            renamed={
                "--source-set": Renamed("--set", "source."),
                "--target-set": Renamed("--set", "target."),
            },
        ),
        "consensus": Command(
            "hose_mj.cli.consensus",
            "let agents agree on whose turn it is, by messages",
            ("hose-mj consensus --loss 0.3",),
            needs=("report",),
        ),
        "classifiers": Command(
            "hose_mj.cli.classifiers",
            "measure which classifiers predict undesired moves (chapter 8)",
            ("hose-mj classifiers taxi --logs 2 --repeats 2",),
            needs=("classifiers",),
        ),
        "check-pcm": Command(
            "hose_mj.cli.check_pcm",
            "check that one task is a partially constrained model of another",
            ("hose-mj check-pcm --list", "hose-mj check-pcm --example hose-passes"),
        ),
        "check-sequential": Command(
            "hose_mj.cli.check_sequential",
            "check that moves in turn are joint moves of one agent",
            ("hose-mj check-sequential corridor",),
        ),
    },
    "maintenance": {
        "list": Command(
            "hose_mj.cli.listing",
            "list scenes, hoses, materials, models, policies, tasks, learners, environments",
            ("hose-mj list scenes", "hose-mj list learners --json"),
        ),
        "doctor": Command(
            "hose_mj.cli.doctor",
            "check that this installation has what hose_mj needs",
            ("hose-mj doctor",),
            renamed=_NO_SEED,
        ),
        "warm": Command(
            "hose_mj.cli.warm",
            "compile every kernel once, so that nothing has to wait for it later",
            ("hose-mj warm", "hose-mj warm hose world"),
        ),
        "bench": Command(
            "hose_mj.cli.bench",
            "measure speed beside peers that people know",
            ("hose-mj bench hose --quick",),
        ),
        "completion": Command(
            "hose_mj.cli.completion",
            "print what lets bash, zsh or fish complete commands and options",
            ('eval "$(hose-mj completion bash)"', "hose-mj completion fish"),
        ),
    },
}

COMMANDS: dict[str, Command] = {
    name: command for group in GROUPS.values() for name, command in group.items()
}
