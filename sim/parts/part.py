"""Base of scene parts: frozen fields, unknown keys refused; and frozen tables."""

from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict

Value = TypeVar("Value")


class FixedTable(dict[str, Value], Generic[Value]):
    """An immutable table of plain values: hashable, picklable, and dumped as a dict.

    Examples
    --------
    >>> FixedTable({"acc_x": 0.1})["acc_x"]
    0.1
    """

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError("a scene is frozen; load it again with an override by dotted path")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[type["FixedTable[Value]"], tuple[dict[str, Value]]]:
        return FixedTable, (dict(self),)


class Part(BaseModel):
    """Base of every table of a scene: frozen, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


_TWINS = {
    "diametral_clearance": "radial_clearance",
    "radial_clearance": "diametral_clearance",
    "rated_slip": "synchronous_speed",
    "synchronous_speed": "rated_slip",
}


def without_twin(table: dict[str, Any], key: str) -> None:
    """Remove the alternative to a joint's clearance or motor's speed that is about to be given."""
    table.pop(_TWINS.get(key, ""), None)


def merged(base: Any, over: Any) -> Any:
    """Merge table `over` into table `base`, at any depth.

    Examples
    --------
    >>> merged({"pin": {"mass": 1.0, "size": 2.0}}, {"pin": {"size": 3.0}})
    {'pin': {'mass': 1.0, 'size': 3.0}}
    """
    if not isinstance(base, Mapping) or not isinstance(over, Mapping):
        return over
    result = dict(base)
    for key, value in over.items():
        without_twin(result, key)
        result[key] = merged(base[key], value) if key in base else value
    return result
