"""Records that compiled code finds at an address: to unpack a hundred arrays costs four steps.

A record, a named tuple of arrays, numbers and records, is laid out in memory as compiled code holds
it, and a kernel is handed its address. Its arrays are those of Python: what either side writes the
other reads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import typeof, types
from numba.core import cgutils, datamodel
from numba.core.imputils import impl_ret_borrowed
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

_intrinsic: Any = intrinsic
_ARRAY = ("meminfo", "parent", "nitems", "itemsize", "data", "shape", "strides")
"""What numba holds of an array, in this order; the first two are for who owns it, and zero here."""


class Address(types.Type):
    """numba's type of the address of a record."""

    def __init__(self, record: Any) -> None:
        self.record = record
        super().__init__(name=f"Address({record})")


@register_model(Address)
class _AddressModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Address) -> None:
        super().__init__(manager, kind, cgutils.intp_t)


@unbox(Address)
def _unbox_address(kind: Address, number: Any, c: Any) -> NativeValue:
    return NativeValue(c.pyapi.long_as_longlong(number))


@_intrinsic
def unpack(typing: Any, address: Any) -> Any:
    """The record at an address."""
    record = address.record

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = context.get_value_type(record).as_pointer()
        value = builder.load(builder.inttoptr(arguments[0], place))
        return impl_ret_borrowed(context, builder, record, value)

    return record(address), generate


def _list_words(value: Any) -> list[int]:
    """A value as words of eight bytes: all that records hold takes whole ones."""
    if isinstance(value, np.ndarray):
        data = value.__array_interface__["data"][0]
        return [0, 0, value.size, value.itemsize, data, *value.shape, *value.strides]
    if isinstance(value, tuple):
        return [word for part in value for word in _list_words(part)]
    if isinstance(value, float):
        return [int(np.float64(value).view(np.int64))]
    return [int(value)]


def _describe(value: Any) -> Any:
    """What numba's type of a record depends on."""
    if isinstance(value, np.ndarray):
        flags = value.flags
        return value.dtype.char, value.ndim, flags.c_contiguous, flags.aligned, flags.writeable
    return (type(value), *map(_describe, value)) if isinstance(value, tuple) else type(value)


_KINDS: dict[Any, Address] = {}
"""By what `_describe` says: to ask numba takes as long as some hundred steps."""


class Packed:
    """A record at an address, for as long as this lives.

    Attributes:
        address: of the record.
        kind: numba's type of the address.

    Args:
        record: a named tuple of arrays, numbers and such tuples; of no two truth values side by
            side, which would share a word.
    """

    def __init__(self, record: Any) -> None:
        self._record = record  # keeps its arrays alive
        self._words = np.array(_list_words(record), dtype=np.int64)
        description = _describe(record)
        if description not in _KINDS:
            _KINDS[description] = Address(typeof(record))
        self.kind, self.address = _KINDS[description], self._words.ctypes.data


def _check_layout() -> None:
    """Raises `ImportError` for a version of numba that lays arrays out otherwise."""
    found = datamodel.registry.default_manager[types.float64[::1]]._fields
    if tuple(found) != _ARRAY:
        raise ImportError(f"numba holds of an array {found}; hose_mj knows {_ARRAY}")


_check_layout()
