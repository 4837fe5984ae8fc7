"""All settings of a learner as data: what a run is identified by."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from hose_learning.mediators import MEDIATORS
from hose_learning.modules import Kind, Module
from hose_mj.errors import InputError, check_choice

POLICIES = ("epsilon-greedy", "soft-max")
FALLBACKS = ("none", "any")


@dataclass(frozen=True, kw_only=True)
class Exploration:
    """How much is left to chance, and how that falls.

    Raises:
        InputError: a value outside its range.
    """

    epsilon: float = 1.0  # at the start
    least: float = 0.0  # what it does not fall below
    per_episode: float = 0.0  # what it falls by after each episode
    per_success: float = 0.0  # what it falls by after each episode that reached the goal
    # "epsilon-greedy" (eq. 3.6) or "soft-max" (eq. 3.5) at a temperature of `temperature_factor`
    # times epsilon.
    policy: str = "epsilon-greedy"
    temperature_factor: float = 10.0  # see there

    def __post_init__(self) -> None:
        check_range("epsilon", self.epsilon, 0.0, 1.0)
        check_range("least", self.least, 0.0, self.epsilon)
        check_range("per_episode", self.per_episode, 0.0, 1.0)
        check_range("per_success", self.per_success, 0.0, 1.0)
        check_range("temperature_factor", self.temperature_factor, 0.0, 1e9)
        check_choice("policy", self.policy, POLICIES)


@dataclass(frozen=True, kw_only=True)
class LearnerSettings:
    """A learner as data; `InputError` for a value outside its range."""

    modules: tuple[Module, ...]  # what it sees and learns from; at least one value module
    discount: float = 0.9  # gamma
    learning_rate: float = 0.25  # alpha at the start
    learning_rate_decay: float = 0.0  # alpha / (1 + decay moves)
    exploration: Exploration = field(default_factory=Exploration)  # epsilon and how it falls
    # How several value modules agree, a key of `mediators.MEDIATORS`.
    mediator: str = "greatest-mass"
    # Whether a broken constraint vetoes the last move of every agent of the cycle, and not of the
    # mover alone.
    share_vetoes: bool = False
    # What is done where everything is vetoed: the action "none" where there is one, or "any".
    fallback: str = "none"
    hashed: bool | None = None  # whether tables are hashed; None for what fits
    # What only this learner's rule knows (see its file).
    options: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_range("discount", self.discount, 0.0, 1.0)
        check_range("learning_rate", self.learning_rate, 0.0, 1.0)
        check_range("learning_rate_decay", self.learning_rate_decay, 0.0, 1e9)
        check_choice("mediator", self.mediator, MEDIATORS)
        check_choice("fallback", self.fallback, FALLBACKS)
        if not self.select("value"):
            names = [module.name for module in self.modules]
            raise InputError("modules", names, "at least one value module")

    def select(self, kind: Kind) -> list[Module]:
        """Returns the modules of a kind, in their order."""
        return [module for module in self.modules if module.kind == kind]


def check_range(name: str, value: object, low: float, high: float) -> None:
    """Raises `InputError` unless the value is a number from `low` to `high`."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not low <= value <= high:  # type: ignore[operator]
        raise InputError(name, value, f"a number from {low:g} to {high:g}")


def get_options(
    settings: LearnerSettings, defaults: Mapping[str, float | str]
) -> dict[str, float | str]:
    """Returns a rule's own options, the defaults where none are given.

    Raises:
        InputError: an unknown option, or text where a number belongs or the other way round.
    """
    for name, value in settings.options.items():
        if name not in defaults:
            known = ", ".join(defaults) or "none: this learner has no options of its own"
            raise InputError("learner's option", name, f"one of {known}")
        if isinstance(value, str) != isinstance(defaults[name], str):
            kind = "a word" if isinstance(defaults[name], str) else "a number"
            raise InputError(name, value, kind)
    return {**defaults, **settings.options}
