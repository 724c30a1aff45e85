"""Faults of a table of fields in words: place, value, bound, cure."""

import difflib
import reprlib
from typing import Any

from pydantic import BaseModel

from .dimensions import Dimension
from .units import to_si, unit_symbol


def nearest(word: str, choices: Any) -> str:
    """End of an error message: the most similar choice, or all of them."""
    whole = [choice for choice in choices if word in choice.split("_")]
    if len(whole) > 1:  # "clearance" matches both of the two clearances
        return f"; did you mean {' or '.join(map(repr, sorted(whole)))}?"
    matches = difflib.get_close_matches(word, list(choices), n=1, cutoff=0.5)
    if matches:
        return f"; did you mean '{matches[0]}'?"
    return f"; choose one of {', '.join(choices)}"


def fault_lines(model: type[BaseModel], entry: Any) -> list[str]:
    """Convert a pydantic error into lines with path, value, bound and cure."""
    location = entry["loc"]
    if location[-1:] == ("float",):  # the member of a union, not a part of the path
        location = location[:-1]
    path = ".".join(str(part) for part in location)
    kind, context = entry["type"], entry.get("ctx", {})
    owner, field = _find_field(model, location)
    if kind == "extra_forbidden":
        known = owner.model_fields if owner else ()
        return [f"{path} is an unknown key{nearest(str(location[-1]), known)}"]
    about = f" ({field.description})" if field is not None and field.description else ""
    if kind == "missing":
        return [f"{path} is missing{about}; add it"]
    if kind == "value_error":
        text = str(context["error"])
        if text.startswith(("has ", "is not ")):  # from to_si, about this value
            return [f"{path} = {_short(entry['input'])} {text}"]
        return [f"{path}: {line}" if path else line for line in text.splitlines()]
    return [f"{path} = {_shown(entry['input'], field)} {_bound(entry)}{about}{_cure(entry, field)}"]


def _cure(entry: Any, field: Any) -> str:
    """Cure for a number out of bounds, which has a wrong exponent or unit."""
    out = entry["type"].startswith(("greater_", "less_"))
    return "; check value and unit" if out and _dimension_of(field) not in (None, "ratio") else ""


_KINDS = {
    "finite_number": "must be finite",
    "float_": "must be a number or a text with a unit",
    "int_": "must be a whole number",
    "string_too_short": "must have >= {min_length} character(s)",
    "string_too_long": "must have <= {max_length} characters",
    "string_": "must be a text",
    "bool_": "must be true or false",
    "too_short": "must have >= {min_length} entries",
    "too_long": "must have <= {max_length} entries",
    "tuple_": "must be a list",
    "list_": "must be a list",
    "model_": "must be a table",
    "dict_": "must be a table",
    "mapping_": "must be a table",
}
"""Requirement on a value, by the beginning of pydantic's error type."""


def _bound(entry: Any) -> str:
    context = entry.get("ctx", {})
    for key, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
        if key in context:
            return f"must be {sign} {context[key]:g}"
    if entry["type"] == "literal_error":
        return f"must be {context['expected']}"
    for beginning, text in _KINDS.items():
        if entry["type"].startswith(beginning):
            return text.format_map(context)
    return "must be of another kind; see a built-in one"  # no kind that any scene has at present


def _shown(value: Any, field: Any) -> str:
    dimension = _dimension_of(field)
    if dimension is None or _holds_many(field):
        return _short(value)
    try:
        return f"{to_si(value, dimension):g} {unit_symbol(dimension)}".rstrip()
    except ValueError:
        return _short(value)


def _holds_many(field: Any) -> bool:
    origin = getattr(field.annotation, "__origin__", None)
    return origin in (dict, tuple)


def _dimension_of(field: Any) -> str | None:
    return next((m.name for m in metadata_of(field) if isinstance(m, Dimension)), None)


def _short(value: Any) -> str:
    """A value for a message, shortened if it is long."""
    text = reprlib.repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


_SHOWN = 60  # characters


def metadata_of(field: Any) -> list[Any]:
    """Metadata of a field, also of ``Annotated[...] | None``."""
    if field is None:
        return []
    arguments = getattr(field.annotation, "__args__", ())
    inner = [m for argument in arguments for m in getattr(argument, "__metadata__", ())]
    return [*field.metadata, *inner]


def _find_field(model: type[BaseModel], location: tuple[Any, ...]) -> tuple[Any, Any]:
    """Model class that owns the last name of a location, and the field if there is one."""
    owner: Any = model
    field = None
    for part in location:
        if isinstance(part, int) or owner is None:
            continue
        field = owner.model_fields.get(part)
        if part != location[-1]:
            owner = model_inside(field.annotation) if field is not None else None
    return owner, field


def si_unit(model: type[BaseModel], path: str) -> str:
    """SI unit of a number of a scene at a dotted path; empty if it has none.

    Examples
    --------
    >>> from wearstate.sim.scene.pump import PumpScene
    >>> si_unit(PumpScene, "joint.crankpin.diametral_clearance"), si_unit(PumpScene, "drive.speed")
    ('m', 'rev/s')
    """
    location = tuple(int(key) if key.isdecimal() else key for key in path.split("."))
    dimension = _dimension_of(_find_field(model, location)[1])
    return "" if dimension is None else unit_symbol(dimension)


def model_inside(annotation: Any) -> type[BaseModel] | None:
    """Model in an annotation, also in a list or union with None; None if there is none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (model_inside(inner) for inner in getattr(annotation, "__args__", ()))
    return next((model for model in found if model is not None), None)
