"""Tuples whose fields lie in one column of a table of lanes: read and written at once, in kernels.

Each is equivalent to one subscript per row. A slice or a loop over the rows would give the same
numbers at half the speed: the compiler does not resolve them before it vectorises.
"""

import operator
from collections.abc import Callable
from typing import Any

from numba.core.types import intp, none
from numba.core.types.containers import NamedUniTuple, UniTuple
from numba.core.typing import signature
from numba.extending import intrinsic

_PLACE = UniTuple(intp, 2)


def _fields_of(_context: Any, kind: Any, rows: Any, lane: Any) -> tuple[Any, Callable[..., Any]]:
    named = kind.instance_class
    found = NamedUniTuple(rows.dtype, len(named._fields), named)

    def generate(context: Any, builder: Any, _: Any, args: Any) -> Any:
        take = context.get_function(operator.getitem, signature(rows.dtype, rows, _PLACE))
        places = _places(context, builder, found.count, args[2])
        values = [take(builder, (args[1], place)) for place in places]
        return context.make_tuple(builder, found, values)

    return signature(found, kind, rows, lane), generate


def _put_fields(_context: Any, rows: Any, lane: Any, values: Any) -> tuple[Any, Callable[..., Any]]:
    def generate(context: Any, builder: Any, _: Any, args: Any) -> Any:
        sort = signature(none, rows, _PLACE, rows.dtype)
        put = context.get_function(operator.setitem, sort)
        for row, place in enumerate(_places(context, builder, len(values), args[1])):
            put(builder, (args[0], place, builder.extract_value(args[2], row)))
        return context.get_dummy_value()

    return signature(none, rows, lane, values), generate


def _places(context: Any, builder: Any, count: int, lane: Any) -> list[Any]:
    """Subscripts (0, lane), (1, lane), ..."""
    rows = [context.get_constant(intp, row) for row in range(count)]
    return [context.make_tuple(builder, _PLACE, [row, lane]) for row in rows]


fields_of: Any = intrinsic(_fields_of)
"""``fields_of(kind, rows, lane)``: named tuple ``kind(rows[0, lane], rows[1, lane], ...)``."""

put_fields: Any = intrinsic(_put_fields)
"""``put_fields(rows, lane, values)``: statement ``rows[0, lane], rows[1, lane], ... = values``."""
