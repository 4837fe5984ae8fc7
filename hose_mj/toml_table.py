"""`TomlTable`: a TOML file read key by key; a mistake is one `InputError`: file, key, values.

Nothing is trusted: a key is read with what it may be, and `finish` refuses the keys that nobody
asked for. Quantities are plain numbers in SI units.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hose_mj.errors import InputError

LARGEST_FILE = 1_000_000  # bytes; a description of a hose has some hundred
LARGEST_NUMBER = 1e15
_SHOWN = 80


def read_toml(path: Path) -> TomlTable:
    """Reads a TOML file; `InputError` for a file that cannot be read or is not TOML."""
    try:
        with open(path, "rb") as stream:
            data = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise InputError("file", str(path), f"a file to be read ({error.strerror})") from error
    if len(data) > LARGEST_FILE:
        raise InputError("file", str(path), f"a TOML file of at most {LARGEST_FILE} bytes")
    try:
        values = tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        why = " ".join(str(error).split())
        raise InputError("file", str(path), f"TOML in UTF-8 ({why})") from error
    return TomlTable(values, Path(path).name)


class TomlTable:
    """One table of a file.

    Args:
        values: what TOML gave.
        file: name of the file, for messages.
        place: where the table stands in it ("holds[0]"), "" for the file itself.
    """

    def __init__(self, values: Mapping[str, Any], file: str, place: str = "") -> None:
        self._values, self._file, self._place = values, file, place
        self._asked: dict[str, None] = {}

    def __contains__(self, key: str) -> bool:
        return key in self._values

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that are there."""
        return tuple(self._values)

    def name(self, key: str) -> str:
        """A key with its file and place: "my_hose.toml: holds[0].at"."""
        return f"{self._file}: {self._place}{'.' if self._place else ''}{key}"

    def fail(self, key: str, value: object, valid: str) -> InputError:
        """The error about a key, its value written in a line of its own at most."""
        return InputError(self.name(key), _shorten(value), valid)

    def value(self, key: str) -> Any:
        """Whatever stands at a key; None where there is nothing."""
        self._asked[key] = None
        return self._values.get(key)

    def require(self, key: str, valid: str) -> None:
        """Raises `InputError` unless the key is there."""
        self._asked[key] = None
        if key not in self._values:
            raise self.fail(key, None, valid)

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        least: float = -LARGEST_NUMBER,
        most: float = LARGEST_NUMBER,
        above: float | None = None,
    ) -> float:
        """A number from `least` (or above `above`) to `most`; required without a default."""
        value = self.value(key)
        if value is None and default is not None:
            return default
        return self._check_number(key, value, least, most, above)

    def find_number(
        self, key: str, *, least: float = -LARGEST_NUMBER, above: float | None = None
    ) -> float | None:
        """A number in a range like that of `number`; None where there is none."""
        value = self.value(key)
        return None if value is None else self.number(key, least=least, above=above)

    def vector(self, key: str, default: Sequence[float] | None = None) -> Any:
        """Three numbers as a tuple; the default where there are none."""
        if self.value(key) is None:
            return default
        return self._check_vector(key, self._values[key])

    def points(self, key: str) -> tuple[tuple[float, float, float], ...] | None:
        """Two or more points; None where there are none."""
        rows = self.value(key)
        if rows is None:
            return None
        if not isinstance(rows, list) or len(rows) < 2:
            raise self.fail(key, rows, "two or more points of three numbers each")
        return tuple(self._check_vector(f"{key}[{k}]", row) for k, row in enumerate(rows))

    def numbers(self, key: str, default: tuple[float, ...], *, above: float, most: float) -> Any:
        """One or more numbers as a tuple; the default where there are none."""
        values = self.value(key)
        if values is None:
            return default
        if not isinstance(values, list) or not values:
            raise self.fail(key, values, "a list of numbers")
        return tuple(
            self._check_number(f"{key}[{k}]", value, 0.0, most, above)
            for k, value in enumerate(values)
        )

    def text(self, key: str, default: str = "") -> str:
        """A text of one line; the default where there is none."""
        value = self.value(key)
        if value is None:
            return default
        if not isinstance(value, str) or not value.isprintable() or not value:
            raise self.fail(key, value, "a text of one line")
        return value

    def word(self, key: str, choices: Sequence[str], default: str | None = None) -> Any:
        """One of several words; the default where there is none."""
        value = self.value(key)
        if value is None:
            return default
        if not isinstance(value, str) or value not in choices:
            raise self.fail(key, value, "one of " + ", ".join(choices))
        return value

    def table(self, key: str) -> TomlTable | None:
        """The table below a key; None where there is none."""
        value = self.value(key)
        if value is None:
            return None
        if not isinstance(value, dict):
            raise self.fail(key, value, f"a table, [{key}]")
        return TomlTable(value, self._file, self._below(key))

    def tables(self, key: str) -> tuple[TomlTable, ...]:
        """The tables of an array, or the one table, below a key; none where there is nothing."""
        value = self.value(key)
        if value is None:
            return ()
        rows = [value] if isinstance(value, dict) else value
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise self.fail(key, value, f"tables, [[{self._below(key)}]]")
        return tuple(
            TomlTable(row, self._file, f"{self._below(key)}[{k}]") for k, row in enumerate(rows)
        )

    def finish(self) -> None:
        """Raises `InputError` for a key that nobody asked for."""
        for key in self._values:
            if key not in self._asked:
                valid = "a key among " + ", ".join(self._asked)
                raise InputError(self.name(_shorten(key)), _shorten(self._values[key]), valid)

    def _below(self, key: str) -> str:
        return f"{self._place}.{key}" if self._place else key

    def _check_vector(self, key: str, value: object) -> Any:
        if not isinstance(value, list) or len(value) != 3:
            raise self.fail(key, value, "three numbers")
        most = LARGEST_NUMBER
        return tuple(self._check_number(key, part, -most, most, None) for part in value)

    def _check_number(
        self, key: str, value: object, least: float, most: float, above: float | None
    ) -> float:
        start = f"above {above:g}" if above is not None else f"from {least:g}"
        valid = f"a number {start} to {most:g}"
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.fail(key, value, valid)
        low = value > above if above is not None else value >= least
        if not (low and value <= most):  # also refuses what is not a number
            raise self.fail(key, value, valid)
        return float(value)


def _shorten(value: object) -> Any:
    """A value whose repr is short."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of thousands of digits
        return "a number too long to print"
    return value if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
