"""JSON schemas of scenes for editors: keys, units, ranges."""

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from ...sim.scene.scene import Scene


def scene_schema(machine: type[Scene]) -> dict[str, Any]:
    """JSON schema of a machine's scenes, for editors of TOML.

    Numbers with a dimension also accept a text with a unit. Relations between keys (one of two
    clearances, a rung that needs a table) are left to ``scene check``.

    Parameters
    ----------
    machine : type
        Scene type.

    Returns
    -------
    dict

    Examples
    --------
    >>> from wearstate.sim.scene.pump import PumpScene
    >>> scene_schema(PumpScene)["$defs"]["Crank"]["properties"]["radius"]["description"]
    'half the stroke [m]'
    """
    schema = _tidy(machine.model_json_schema(schema_generator=_Generator))
    inside = schema["$defs"]
    partial = {
        name: _renamed({k: v for k, v in table.items() if k != "required"})
        for name, table in inside.items()
    }
    inside |= {f"{name}{_PARTIAL}": table for name, table in partial.items()}
    for table in inside.values():
        for name, field in table.get("properties", {}).items():
            if field.pop("partial", False):
                table["properties"][name] = _renamed(field)
    title = f"Scene of a {machine.__doc__ or ''}".partition("\n")[0]
    return {"$schema": "http://json-schema.org/draft-07/schema#", **schema, "title": title}


class _Generator(GenerateJsonSchema):
    """Silently omits a default that is a frozen table."""

    def emit_warning(self, kind: Any, detail: str) -> None:
        """As in pydantic, except for that warning."""
        if kind != "non-serializable-default":
            super().emit_warning(kind, detail)


_PARTIAL = "Partial"  # ends the names of tables without required keys
_SIGNS = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def _renamed(node: Any) -> Any:
    """References to tables, changed to their partial twins."""
    if isinstance(node, Mapping):
        return {
            key: f"{value}{_PARTIAL}" if key == "$ref" else _renamed(value)
            for key, value in node.items()
        }
    return [_renamed(each) for each in node] if isinstance(node, list) else node


def _tidy(node: Any) -> Any:
    """A schema without nulls, which TOML lacks, with named bounds and units in descriptions."""
    if isinstance(node, list):
        return [_tidy(each) for each in node]
    if not isinstance(node, Mapping):
        return node
    found = {_SIGNS.get(str(key), str(key)): _tidy(value) for key, value in node.items()}
    if found.get("default", 0) is None or isinstance(found.get("default"), dict):
        del found["default"]
    if isinstance(found.get("anyOf"), list):
        found["anyOf"] = [each for each in found["anyOf"] if each != {"type": "null"}]
    return _with_unit(found) if "description" in found else found


def _with_unit(field: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(field["description"], str):
        return field  # a key of that name
    unit = next(_units(field), "")
    return {**field, "description": f"{field['description']} [{unit}]"} if unit else field


def _units(node: Any) -> Iterator[str]:
    if isinstance(node, Mapping):
        if isinstance(node.get("unit"), str) and node["unit"]:
            yield node["unit"]
        for value in node.values():
            yield from _units(value)
    elif isinstance(node, list):
        for each in node:
            yield from _units(each)
