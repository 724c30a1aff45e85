"""Short texts for results that hold arrays."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Number
from typing import Any

import numpy as np

_FEW = 6
"""Numbers of an array or a tuple up to which all are listed."""
_LONGEST = 40
"""Longest text in characters."""


def brief(*names: str) -> Callable[[Any], str]:
    """``__repr__`` that shows the given attributes in one line; without any, all fields.

    Parameters
    ----------
    *names : str
        Fields or properties of the class.

    Returns
    -------
    callable
        Numbers have four digits; arrays, sequences and other objects are shown by kind and size;
        None and empty values are omitted.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass
    ... class Mode:
    ...     frequency: float
    ...     shape: np.ndarray
    ...     __repr__ = brief()
    >>> Mode(12.3456, np.zeros((2, 60)))
    <Mode frequency=12.35, shape=array(2, 60)>
    """

    def summary(self: Any) -> str:
        chosen = names or [field.name for field in fields(self) if field.repr]
        words = [f"{name}={text}" for name in chosen if (text := short(getattr(self, name)))]
        return f"<{type(self).__name__} {', '.join(words)}>"

    return summary


def short(value: Any) -> str:
    """A value in a few words; empty if it is None or empty.

    Parameters
    ----------
    value : object
        A number, text, array, sequence, mapping or anything else.

    Examples
    --------
    >>> short(12.3456), short(np.zeros((2, 60))), short(())
    ('12.35', 'array(2, 60)', '')
    """
    if value is None or (isinstance(value, Sequence | Mapping) and len(value) == 0):
        return ""
    if isinstance(value, np.ndarray) and value.size == 0:
        return ""
    if isinstance(value, str):
        return repr(value if len(value) <= _LONGEST else f"{value[: _LONGEST - 1]}…")
    if isinstance(value, Enum):
        return value.name.lower().replace("_", " ")
    if isinstance(value, bool | int | np.bool_ | np.integer):
        return str(value)
    if isinstance(value, Number):
        return f"{value:.4g}"
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, Sequence | Mapping):
        return _several(value)
    return type(value).__name__ if is_dataclass(value) else _named(value)


def _array(value: np.ndarray[Any, Any]) -> str:
    if value.ndim == 1 and len(value) <= _FEW:
        return f"[{', '.join(short(each) for each in value.tolist())}]"
    return f"array({', '.join(map(str, value.shape))})"


def _several(value: Sequence[Any] | Mapping[Any, Any]) -> str:
    each = list(value.values()) if isinstance(value, Mapping) else list(value)
    plain = not isinstance(value, Mapping) and all(isinstance(one, Number | str) for one in each)
    if plain and len(each) <= _FEW:
        return f"({', '.join(map(short, each))})"
    return f"{len(each)} of {type(each[0]).__name__}"


def _named(value: Any) -> str:
    name = getattr(value, "name", None)
    return f"{type(value).__name__}({name})" if isinstance(name, str) else type(value).__name__
