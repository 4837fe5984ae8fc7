"""Records that compiled code finds at an address: to unpack a hundred arrays costs four steps.

`pack` stores a record, a named tuple of arrays, numbers and records, as compiled code holds it, and
`Packed.call` hands its address to a kernel. The record's arrays are those of Python: what either
side writes the other reads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import typeof, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import (
    NativeValue,
    intrinsic,
    models,
    register_model,
    unbox,
)

from hose_mj.jit import compiled

_intrinsic: Any = intrinsic


class Address(types.Type):
    """numba's type of the address of a packed record."""

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


def _disown(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The value with no owner for any of its arrays: compiled code never frees them."""
    if isinstance(kind, types.Array):
        array = cgutils.create_struct_proxy(kind)(context, builder, value)
        for owner in ("meminfo", "parent"):
            setattr(array, owner, cgutils.get_null_value(getattr(array, owner).type))
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        for k, part in enumerate(parts):
            own = _disown(context, builder, part, builder.extract_value(value, k))
            value = builder.insert_value(value, own, k)
    return value


@_intrinsic
def _measure(typing: Any, record: Any) -> Any:
    """Bytes that a record takes."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.get_constant(
            types.int64, context.get_abi_sizeof(context.get_value_type(record))
        )

    return types.int64(record), generate


@_intrinsic
def _store(typing: Any, record: Any, address: Any) -> Any:
    """Writes a record to an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = context.get_value_type(record).as_pointer()
        own = _disown(context, builder, record, arguments[0])
        builder.store(own, builder.inttoptr(arguments[1], place))
        return context.get_dummy_value()

    return types.void(record, types.int64), generate


@_intrinsic
def unpack(typing: Any, address: Any) -> Any:
    """The record at an address."""
    record = address.record

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = context.get_value_type(record).as_pointer()
        value = builder.load(builder.inttoptr(arguments[0], place))
        return impl_ret_borrowed(context, builder, record, value)

    return record(address), generate


@compiled
def _pack(record, address):
    """Writes a record to an address, unless that is 0; returns how many bytes it takes."""
    if address != 0:
        _store(record, address)
    return _measure(record)


class Packed:
    """A record at an address, for as long as this lives.

    Args:
        record: a named tuple of arrays, numbers and such tuples.
    """

    def __init__(self, record: Any) -> None:
        self._record = record  # keeps its arrays alive
        self.kind = Address(typeof(record))
        self._room = np.zeros(_pack(record, 0) // 8 + 1, dtype=np.int64)
        self.address = self._room.ctypes.data
        _pack(record, self.address)
