"""Strict JSON of results: numpy types as Python types, non-finite numbers as null."""

import json
import math
from collections.abc import Mapping
from typing import Any


def json_text(value: Mapping[str, Any], *, indent: int | None = None) -> str:
    """Strict JSON: non-finite numbers become null; a value without JSON form is a defect.

    Examples
    --------
    >>> json_text({"a": float("nan"), "b": (1.5,)})
    '{"a": null, "b": [1.5]}'
    """
    return json.dumps(_plain(value), indent=indent, allow_nan=False)


def _plain(value: Any) -> Any:
    """Python types from numpy types and tuples; null for a number that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if hasattr(value, "tolist"):  # numpy
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
