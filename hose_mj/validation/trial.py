"""What a trial is: something that GEDS alone goes through and keeps limits in, with pictures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hose_mj.checks import Check
from hose_mj.hoses.obstacles import Obstacle
from hose_mj.hoses.protocol import Array
from hose_mj.validation.case import read_texts


@dataclass(frozen=True)
class LinePlot:
    """Numbers over numbers, with limits across."""

    title: str
    ylabel: str
    lines: Mapping[str, tuple[ArrayLike, ArrayLike]]  # by label
    limits: Mapping[str, float]  # by name
    xlabel: str = "time (s)"
    is_log: bool = False  # both axes


@dataclass(frozen=True)
class ShapePlot:
    """Hoses seen from the side, among obstacles."""

    title: str
    shapes: Mapping[str, Array]  # places (k, m, 3), m, the earlier the paler, by label
    obstacles: tuple[Obstacle, ...]


@dataclass(frozen=True)
class Findings:
    """What a trial found."""

    checks: list[Check]
    plots: Mapping[str, LinePlot | ShapePlot]  # by file name


@dataclass(frozen=True)
class Trial:
    """One trial; its words stand in cases.toml."""

    id: str  # stable
    # Goes through it, the small grid if the first is true; chance comes from the second.
    measure: Callable[[bool, np.random.Generator], Findings]

    @property
    def title(self) -> str:
        """One line."""
        return read_texts()[self.id]["title"]

    @property
    def about(self) -> str:
        """What is done and what is checked."""
        return read_texts()[self.id]["about"]
