"""`hose-mj rollout`: one episode of a policy in a scene, recorded if wanted, and why it ended."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hose_mj.cli.results import check_counts
from hose_mj.errors import InputError, check_choice
from hose_mj.extras import require
from hose_mj.recording.document import make_document, print_document
from hose_mj.world.registry import WORLDS, make_world

if TYPE_CHECKING:
    from hose_mj.constraints.monitor import Monitor
    from hose_mj.recording.sinks import Sink
    from hose_mj.rollout.capture import Capture
    from hose_mj.rollout.episode import EpisodeResult, Observer, Policy
    from hose_mj.scenes.mjcf.scene import Scene
    from hose_mj.world.world import World

ENDINGS = {"save": ".rrd", "mp4": ".mp4", "csv": ".csv"}
EXTRAS_OF_ENDINGS = {"save": "viewer", "mp4": "video", "csv": "pyarrow"}


@dataclass(frozen=True)
class Args:
    """Run one episode in a scene with a hose, and say why it ended.

    An episode ends with the first constraint that breaks, with the tip at the goal, or after
    --duration. Recorded to files and to a live viewer at once, if you like.
    """

    scene: Annotated[str, tyro.conf.Positional]
    """A shipped scene (floor_1 to floor_6, corridor, deck, lift), or your own MJCF file."""
    model: str = "geds"  # The hose's model: geds, cable or flex.
    models: tuple[str, ...] = ()
    """Two models instead of one: both episodes run and are shown overlaid."""
    policy: str = "to-goal"
    """random, to-goal, break-stretch, break-run-over, break-collision, break-obstacle,
    break-bounds, or the run folder of a learner (hose-mj train line)."""
    duration: float = 5.0  # Simulated time after which the episode ends (s).
    save: Path | None = None  # Write a Rerun recording, F.rrd; open it with hose-mj view.
    spawn: bool = False  # Open Rerun's viewer and show the episode while it runs.
    connect: str | None = None
    """Show it in a viewer that listens at this URL, as rerun+http://127.0.0.1:9876/proxy."""
    mp4: Path | None = None  # Write a film.
    csv: Path | None = None  # Write a table: a row for each sample.
    strict: bool = False
    """Stop with one line and exit status 2 where the health of a geds hose gives a warning."""
    json: bool = False  # Print one JSON document on stdout; messages go to stderr.
    seed: int = 0  # Seed of everything that is left to chance.


@dataclass(frozen=True)
class Rollout:
    """One episode as the document and the terminal show it."""

    world: World  # in which it was
    outcome: EpisodeResult  # how it ended
    wall_s: float  # of planning and the episode (s)
    overhead: float  # time that recording took over that of the rest, see `_Timed`

    def to_record(self, args: Args) -> dict[str, Any]:
        """The document's fields."""
        outcome = self.outcome
        return {
            "model": self.world.hose_model,
            "scene": args.scene,
            "steps": outcome.steps,
            "sim_time": outcome.sim_time,
            "ended_by": outcome.ended_by,
            "break": outcome.broken.to_record() if outcome.broken else None,
            "stalled": outcome.stalled,
            "recording": str(args.save) if args.save else None,
            "health": self.world.health and self.world.health.summarize(),
            "wall_s": self.wall_s,
            "recording_overhead": self.overhead,
        }

    def describe(self) -> str:
        """One line."""
        outcome = self.outcome
        took = f"{outcome.steps:,} steps in {self.wall_s:.1f} s"
        head = f"{self.world.hose_model}: {outcome.ended_by}"
        if outcome.broken is not None:
            return f"{head} ({outcome.broken.kind}), {took}; {outcome.broken.describe()}"
        end = "the tip is at the goal" if outcome.ended_by == "goal" else "nothing broke"
        return f"{head} after {outcome.sim_time:.3f} s, {took}; {end}"


class _Timed:
    """Observers, and a clock for what they take of the run.

    Planning, the observers' start (which compiles) and their end (which completes files) are left
    out: what counts is every sample, over the policy, the steps and the checks in between.

    Args:
        observers: all that watch.
    """

    def __init__(self, observers: Sequence[Observer]) -> None:
        self._observers = tuple(observers)
        self._begun = self._spent = 0.0
        self.overhead = 0.0

    def start(self, world: World, monitor: Monitor, settings: Mapping[str, str]) -> None:
        for observer in self._observers:
            observer.start(world, monitor, settings)
        self._begun = time.perf_counter()

    def sample(self, world: World, monitor: Monitor, info: Mapping[str, Any]) -> None:
        begun = time.perf_counter()
        for observer in self._observers:
            observer.sample(world, monitor, info)
        self._spent += time.perf_counter() - begun

    def finish(self, outcome: EpisodeResult) -> None:
        self.overhead = self._spent / (time.perf_counter() - self._begun - self._spent)
        for observer in self._observers:
            observer.finish(outcome)


class Recording:
    """Records the episodes of one command; a context that ends what is open.

    A single episode goes to its .rrd and to a live viewer while it runs; films, tables and two
    episodes overlaid are written when all have ended.

    Args:
        wishes: what is to be recorded.
        scene: in which the episodes are.
        n_episodes: how many there will be.

    Raises:
        InputError: a file whose name does not end as it should or whose folder is not there, or a
            film, a table or a live view of two episodes.
        MissingExtra: what writes one of these is not installed.
    """

    def __init__(self, wishes: Args, scene: Scene, n_episodes: int) -> None:
        self._wishes, self._scene, self._overlays = wishes, scene, n_episodes > 1
        self._captures: list[Capture] = []
        for name, ending in ENDINGS.items():
            path = getattr(wishes, name)
            if path is None:
                continue
            if path.suffix != ending:
                raise InputError(name, str(path), f"a file name that ends in {ending}")
            if not path.resolve().parent.is_dir():
                raise InputError(name, str(path), "a file in a folder that is there")
            require(EXTRAS_OF_ENDINGS[name], f"--{name}")
        if wishes.spawn or wishes.connect:
            require("viewer", "a live viewer")
        if self._overlays and (wishes.spawn or wishes.connect or wishes.mp4 or wishes.csv):
            raise InputError("number of models", n_episodes, "1, or --save alone")

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        for capture in self._captures:
            capture.finish()
        if kind is None and self._captures:
            self._write()

    def make_observers(self) -> list[Observer]:
        """What is to watch the next episode; nothing where nothing is recorded."""
        from hose_mj.rollout.capture import Capture

        wishes = self._wishes
        sinks: list[Sink] = []
        if not self._overlays and (wishes.save or wishes.connect or wishes.spawn):
            from hose_mj.recording.rerun.episodes import open_sinks

            sinks = open_sinks(wishes.save, wishes.connect, wishes.spawn)
        keeps = bool(wishes.mp4 or wishes.csv or (self._overlays and wishes.save))
        captures = [Capture(sinks, keep=keeps)] if sinks or keeps else []
        self._captures += captures
        return list(captures)

    def describe(self) -> list[str]:
        """A line for each file."""
        paths = {name: getattr(self._wishes, name) for name in ENDINGS}
        return [f"{name}: {path}" for name, path in paths.items() if path is not None]

    def _write(self) -> None:
        """Writes what needs whole episodes."""
        wishes = self._wishes
        if self._overlays and wishes.save is not None:
            from hose_mj.recording.rerun.episodes import write_world_recording

            write_world_recording(wishes.save, [one.episode() for one in self._captures])
        if wishes.csv is not None:
            from hose_mj.recording.world_table import write_csv

            write_csv(wishes.csv, self._captures[0].episode())
        if wishes.mp4 is not None:
            from hose_mj.rollout.video import write_mp4

            write_mp4(wishes.mp4, self._captures[0].episode(), self._scene)


def run(args: Args) -> int:
    """Runs the episodes; 0 when done."""
    from hose_mj.scenes.mjcf.scene import find_scene, read_scene

    models = _check(args)
    scene = read_scene(find_scene(args.scene))
    with Recording(args, scene, len(models)) as recording:
        rollouts = [_roll_out(args, scene, model, recording) for model in models]
    records = [rollout.to_record(args) for rollout in rollouts]
    if args.json:
        results = {**records[0], "rollouts": records}
        print_document(make_document("rollout", args, results=results))
    else:
        lines = [rollout.describe() for rollout in rollouts] + recording.describe()
        print("\n".join(lines))
    return 0


def _check(args: Args) -> tuple[str, ...]:
    """Returns the models to run; raises `InputError` for a value outside its valid set."""
    for model in args.models:
        check_choice("models", model, WORLDS)
    if args.models and (len(args.models) != 2 or len(set(args.models)) != 2):
        valid = f"two different ones of {', '.join(WORLDS)}"
        raise InputError("models", " ".join(args.models), valid)
    check_choice("model", args.model, WORLDS)
    if args.strict and "geds" not in (args.models or (args.model,)):
        raise InputError("strict", args.strict, "false where no hose is geds, which has a health")
    check_counts(args, seed=0)
    if not 0.0 < args.duration <= 3600.0:
        raise InputError("duration", args.duration, "above 0, at most 3600 (s)")
    return args.models or (args.model,)


def _choose_policy(name: str) -> Policy:
    """Makes a policy by its name; raises `InputError` for what is neither one nor a folder."""
    from hose_mj.rollout.policies import POLICIES, make_policy

    if name in POLICIES:
        return make_policy(name)
    if Path(name).is_dir():
        from hose_mj.cli.saved_learner import SavedLearner

        return SavedLearner(Path(name))
    raise InputError("policy", name, f"{', '.join(POLICIES)}, or the run folder of a learner")


def _roll_out(args: Args, scene: Scene, model: str, recording: Recording) -> Rollout:
    import numpy as np

    from hose_mj.constraints.monitor import Monitor
    from hose_mj.rollout.episode import run_episode

    policy = _choose_policy(args.policy)
    world = make_world(scene, model, **({"strict": args.strict} if model == "geds" else {}))
    monitor = Monitor(world)
    timed = _Timed(recording.make_observers())
    settings = {"scene": args.scene, "model": model, "policy": args.policy, "seed": str(args.seed)}
    begun = time.perf_counter()
    outcome = run_episode(
        *(world, monitor, policy),
        duration=args.duration,
        observers=[timed],
        generator=np.random.default_rng(args.seed),
        settings=settings,
    )
    return Rollout(world, outcome, time.perf_counter() - begun, timed.overhead)
