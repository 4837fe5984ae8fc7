"""Sequences of moves that end in breaks: drawn, played with a hose model, kept in a file."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hose_mj.constraints.limits import Limits
from hose_mj.constraints.monitor import Monitor
from hose_mj.errors import InputError, StepError
from hose_mj.recording.files import write_atomically
from hose_mj.world.actions import Actions
from hose_mj.world.driving import Driver
from hose_mj.world.world import World

MOVES = ("up", "down", "left", "right")
KEEP = 0.7  # how likely a robot that moves again goes on as before: random walks would stay at home
Move = tuple[int, str]


@dataclass(frozen=True)
class Ending:
    """How a sequence ended in one model."""

    kind: str  # of the break; "none" without one, "error" where the model could not go on
    turn: int  # number of the last move, from 0
    robot: int | None  # that made it; None for the kind "none"
    cell: tuple[int, int] | None  # that the robot set out from in it; None for the kind "none"
    text: str  # what happened, in words
    # Per move the least margin of each kind, N for stretch and m for the others.
    least: tuple[dict[str, float], ...]
    warnings: tuple[str, ...] = ()  # of the hose's health

    def agrees(self, other: Ending) -> bool:
        """Says whether both ended alike: the same kind, the same robot out of the same cell."""
        return (self.kind, self.robot, self.cell) == (other.kind, other.robot, other.cell)

    @classmethod
    def from_record(cls, record: dict[str, Any]) -> Ending:
        """The ending whose `asdict` went through JSON."""
        cell = None if record["cell"] is None else tuple(record["cell"])
        lists = {name: tuple(record.get(name, ())) for name in ("least", "warnings")}
        return cls(**{**record, "cell": cell, **lists})


def draw_sequences(seed: int, sequences: int, moves: int, n_robots: int) -> list[list[Move]]:
    """Random moves, the same for all models; each robot tends to go on as before."""
    generator = np.random.default_rng(seed)
    drawn = []
    for _ in range(sequences):
        habits = [MOVES[k] for k in generator.integers(len(MOVES), size=n_robots)]
        sequence = []
        for _ in range(moves):
            robot = int(generator.integers(n_robots))
            if generator.random() >= KEEP:
                habits[robot] = MOVES[int(generator.integers(len(MOVES)))]
            sequence.append((robot, habits[robot]))
        drawn.append(sequence)
    return drawn


def play_sequence(monitor: Monitor, moves: Sequence[Move]) -> Ending:
    """Plays moves from the start of the monitor's world until something breaks."""
    world = monitor.world
    world.reset()
    monitor.reset()
    actions = Actions(Driver(world))
    kinds = {kind: np.array(monitor.kinds) == kind for kind in dict.fromkeys(monitor.kinds)}
    least: list[dict[str, float]] = []
    for turn, (robot, action) in enumerate(moves):
        x, y = actions.compute_cells()[robot, :2].tolist()
        lowest = monitor.measure()
        actions.begin(robot, action)
        kind, text = None, ""
        while kind is None and not actions.is_done():
            actions.update()
            try:
                world.step()
            except StepError as error:
                kind, text = "error", str(error)
                break
            found = monitor.check()
            lowest = np.minimum(lowest, monitor.margins)
            if found:
                kind, text = found.kind, found.describe()
        least.append({name: round(float(lowest[own].min()), 6) for name, own in kinds.items()})
        if kind is not None:
            return Ending(kind, turn, robot, (x, y), text, tuple(least))
    return Ending("none", len(moves) - 1, None, None, "nothing broke", tuple(least))


def play_all(
    make_world: Callable[[], World],
    sequences: Sequence[Sequence[Move]],
    limits: Limits,
    kept: EndingsFile,
    advance: Callable[[int], None],
) -> list[Ending]:
    """Plays all sequences of moves that are not kept yet, and keeps each.

    The world is made if it is needed; `advance` is called with 1 after each sequence.
    """
    endings = kept.read()[: len(sequences)]
    advance(len(endings))
    if len(endings) == len(sequences):
        return endings
    monitor = Monitor(make_world(), limits)
    for moves in sequences[len(endings) :]:
        ending, health = play_sequence(monitor, moves), monitor.world.health
        endings.append(replace(ending, warnings=health.warnings if health else ()))
        kept.write(endings)
        advance(1)
    return endings


@dataclass(frozen=True)
class EndingsFile:
    """Endings of one model in a file, so that a command that was stopped goes on."""

    path: Path | None  # of the file; None to keep nothing
    settings: dict[str, Any]  # what the endings depend on, of plain JSON values

    def read(self) -> list[Ending]:
        """The endings kept so far; `InputError` where they are of other settings."""
        if self.path is None or not self.path.exists():
            return []
        document = json.loads(self.path.read_bytes())
        if document["settings"] != self.settings:
            raise InputError(
                str(self.path), document["settings"], f"of the same settings, {self.settings}"
            )
        return [Ending.from_record(record) for record in document["endings"]]

    def write(self, endings: Sequence[Ending]) -> None:
        """Keeps endings, whole or not at all."""
        if self.path is not None:
            records = [asdict(ending) for ending in endings]
            document = {"settings": self.settings, "endings": records}
            write_atomically(self.path, json.dumps(document).encode())
