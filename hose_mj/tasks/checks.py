"""Checks of task options: each raises one `InputError` that names option, value and valid set."""

from collections.abc import Collection

from hose_mj.errors import InputError, is_finite


def check_integer(name: str, value: object, low: int, high: int) -> None:
    """Raises unless the value is an integer from `low` to `high`."""
    is_integer = isinstance(value, int) and not isinstance(value, bool)
    if not is_integer or not low <= value <= high:  # type: ignore[operator]
        raise InputError(name, value, f"an integer from {low} to {high}")


def check_finite(name: str, value: object) -> None:
    """Raises unless the value is a finite number."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not is_finite(value):
        raise InputError(name, value, "a finite number")


def check_choice(name: str, value: object, choices: Collection[object]) -> None:
    """Raises unless the value is one of the choices."""
    if not any(type(value) is type(choice) and value == choice for choice in choices):
        raise InputError(name, value, "one of " + ", ".join(map(repr, choices)))


def check_cell(name: str, cell: object, *ranges: tuple[int, int]) -> None:
    """Raises unless the cell is a tuple of integers, each within its range (both ends count)."""
    valid = "a tuple of " + " and ".join(f"an integer from {a} to {b}" for a, b in ranges)
    if not isinstance(cell, tuple) or len(cell) != len(ranges):
        raise InputError(name, cell, valid)
    for value, (low, high) in zip(cell, ranges, strict=True):
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise InputError(name, cell, valid)


def check_cells(name: str, cells: object, number: int, low: int, high: int) -> None:
    """Raises unless `cells` is a tuple of `number` pairs of integers from `low` to `high`."""
    if not isinstance(cells, tuple) or len(cells) != number:
        raise InputError(name, cells, f"a tuple of {number} cells (x, y)")
    for cell in cells:
        check_cell(name, cell, (low, high), (low, high))
