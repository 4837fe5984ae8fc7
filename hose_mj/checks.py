"""`Check`: a measured number against its limit, as commands print it and reports show it."""

import operator
from dataclasses import dataclass
from typing import Any

from hose_mj.errors import InputError, check_choice, is_finite

_COMPARISONS = {"<=": operator.le, "<": operator.lt, ">=": operator.ge, ">": operator.gt}
_COMPARISONS |= {"==": operator.eq}


@dataclass(frozen=True)
class Check:
    """A measured number against its limit.

    Raises:
        InputError: an unknown comparison or a limit that is not finite.
    """

    name: str  # what was measured
    value: float  # the number measured; one that is not finite never passes
    limit: float  # the bound it is held against
    comparison: str = "<="  # how value and limit must stand: `<=`, `<`, `>=`, `>` or `==`

    def __post_init__(self) -> None:
        check_choice("comparison", self.comparison, _COMPARISONS)
        if not is_finite(self.limit):
            raise InputError(f"limit of {self.name}", self.limit, "a finite number")

    @property
    def ok(self) -> bool:
        """Whether the value keeps to the limit."""
        compare = _COMPARISONS[self.comparison]
        return is_finite(self.value) and bool(compare(self.value, self.limit))

    def as_record(self) -> dict[str, Any]:
        """Returns the check as it stands in a document; a value that is not finite becomes null."""
        value = float(self.value) if is_finite(self.value) else None
        held = {"limit": float(self.limit), "comparison": self.comparison, "ok": self.ok}
        return {"name": self.name, "value": value, **held}
