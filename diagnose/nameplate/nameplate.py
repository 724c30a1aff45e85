"""Known data of a machine: its scene, the conditions of the day and their uncertainties.

The scene gives the design and the usual operation of the machine, the manifest row of a recording
the operation on the day. Values set by the user take precedence over both.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...datasets.draws.draws import has_value
from ...datasets.file.attributes import Attributes
from ...datasets.file.record import DataSet
from ...datasets.recipe.load import recorded_scene
from ...datasets.recipe.recipe import condition_of
from ...sim.output.recording import DataError
from ...sim.parts.oil import Oil
from ...sim.parts.units import to_si
from ...sim.scene.load import (
    load_scene,
    numbered,
    override,
    scene_from_table,
    scene_names,
    scene_table,
    scene_text,
)
from ...sim.scene.scene import Scene, SceneError
from ..feature_rows.noted import NOTED
from ..film_clearance.clearance import Doubts

_OIL = "oil.dynamic_viscosity"
_SPEED = "drive.speed"
_WARMING = "bearings.0.film_warming"
_MEASURED = ("speed_hz", "start_angle_rad", "unbalance_kg_m")  # from the signals, or irrelevant


@dataclass(frozen=True, kw_only=True)
class Nameplate:
    """Known data of a machine.

    Attributes
    ----------
    scene : Scene
        Geometry, load, oil.
    set_paths : frozenset of str
        Dotted paths set by the user, entries of lists by number; they take precedence over the
        manifest.
    doubts : Doubts
        Standard uncertainties of these data.
    source : str
        Origin of the nameplate, for the report.
    assumed : bool
        No scene was given: values not set are those of the scene that a model was trained on.
    given : bool
        The user gave the scene, including the errors of this machine's sensors.
    """

    scene: Scene
    set_paths: frozenset[str] = field(default_factory=frozenset)
    doubts: Doubts = field(default_factory=Doubts)
    source: str = ""
    assumed: bool = False
    given: bool = False

    def on_the_day(self, row: Mapping[str, Any], speed_hz: float | None) -> Scene:
        """The scene with a recording's conditions.

        Parameters
        ----------
        row : mapping
            Manifest values; columns of the machine's operating conditions are read.
        speed_hz : float or None
            Measured speed [Hz].

        Examples
        --------
        >>> plate = Nameplate(scene=load_scene("journal-bearing"))
        >>> plate.on_the_day({"static_load_n": 4000.0}, 48.0).load.static
        4000.0
        """
        noted = {
            each.path: float(row[each.column])
            for each in self.scene.condition_places
            if isinstance(row.get(each.column), float | int) and math.isfinite(row[each.column])
        }
        scene = self.scene
        for path, value in noted.items():
            if path != _SPEED and not self.is_set(path) and _has_place(scene, path):
                scene = _replaced(scene, path, value)
        return scene if speed_hz is None else _replaced(scene, _SPEED, speed_hz)

    def conditions(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Known conditions of a recording: set by the user, noted with it, or usual.

        Parameters
        ----------
        row : mapping
            Conditions noted with the recording.

        Returns
        -------
        dict
            The row, completed by the columns of :data:`~.feature_rows.noted.NOTED` for which the
            scene was given a value.

        Examples
        --------
        >>> plate = Nameplate(scene=load_scene("journal-bearing"))
        >>> plate.conditions({"static_load_n": 4000.0})["static_load_n"]
        4000.0
        """
        day = self.on_the_day(row, None)
        places = {each.column: each.path for each in day.condition_places}
        known = {
            column: condition_of(day, column)
            for column in NOTED
            if (place := places.get(column)) is not None and has_value(day, place)
            if self.is_set(place) or not (self.assumed or _left_out(day, column, place))
        }
        return {**row, **known}

    def is_set(self, path: str) -> bool:
        """Whether the user set this value, or one that determines it."""
        if path == _OIL:
            return any(each.startswith("oil.") for each in self.set_paths)
        return path in self.set_paths


def _has_place(scene: Any, path: str) -> bool:
    """False for the warming of a film if the oil is unknown at other temperatures."""
    return path != _WARMING or scene.oil.temperature is not None


def _left_out(scene: Scene, column: str, path: str) -> bool:
    """Whether the value in the scene only means that the number was not given.

    A default is no reading: a scene without ``pressure.discharge`` has 0 Pa, the pump has not.
    """
    left_out = NOTED[column].left_out
    if left_out is not None and condition_of(scene, column) == left_out:
        return True
    above, _, name = path.rpartition(".")
    part: Any = scene
    for each in above.split("."):
        part = part[int(each)] if each.isdigit() else getattr(part, each)
    return name in type(part).model_fields and name not in part.model_fields_set


def _replaced(scene: Any, path: str, value: float) -> Any:
    """Replace one value of a scene; a part that the scene lacks stays absent."""
    if path == _OIL:
        oil: Oil = scene.oil
        return scene.model_copy(update={"oil": oil.thickened(value / oil.dynamic_viscosity)})
    name, _, rest = path.partition(".")
    if isinstance(scene, tuple):
        place = int(name)
        return (*scene[:place], _replaced(scene[place], rest, value), *scene[place + 1 :])
    inner = getattr(scene, name, None)
    if inner is None:
        return scene
    return scene.model_copy(update={name: _replaced(inner, rest, value) if rest else value})


def nameplate_of(
    source: Path | None,
    scene: str | None,
    values: Mapping[str, Any],
    *,
    usual: str = "",
) -> Nameplate | None:
    """Nameplate of the machine in a recording.

    Parameters
    ----------
    source : Path, optional
        File of the recording: a data set may hold its scene.
    scene : str, optional
        Built-in scene or file; it takes precedence over that of the data set.
    values : mapping
        Dotted path -> value that replaces the scene's. A text may add ``+-`` and a standard
        uncertainty, in per cent or in the unit of the value, that replaces the usual one.
    usual : str
        Scene that a model was trained on; used if values are set and no scene is known.

    Returns
    -------
    Nameplate or None
        None if nothing is known.

    Raises
    ------
    SceneError
        The scene is invalid, or does not accept a value.
    DataError
        An uncertainty is invalid.

    Examples
    --------
    >>> plate = nameplate_of(None, "journal-bearing", {"oil.viscosity": "28 mPa s +- 20 %"})
    >>> plate.scene.oil.viscosity, plate.doubts.viscosity
    (0.028, 0.2)
    """
    plain, spreads = _parted(values)
    head = None if scene is not None or source is None else _head_of(source)
    if scene is not None:
        found, name = load_scene(scene, plain), scene
    elif head is not None:
        try:
            found, name = _scene_in(head, plain), str(source)
        except SceneError:
            if plain:
                raise
            return None  # a file of another version, whose scene nobody requested
    elif plain and usual in scene_names():
        found = scene_from_table(override(scene_table(scene_text(usual)), plain))
        name = f"scene {usual}, which the model was trained on"
    else:
        return None
    assumed = scene is None and head is None
    doubts = replace(_usual_doubts(found), **_doubts(spreads, found, plain))
    table = found.model_dump(mode="json")
    set_paths = frozenset(numbered(table, path) for path in plain)
    return Nameplate(
        scene=found,
        set_paths=set_paths,
        doubts=doubts,
        source=name,
        assumed=assumed,
        given=scene is not None,
    )


def day_of(plate: Nameplate | None, row: Mapping[str, Any]) -> Mapping[str, Any]:
    """Known conditions of a recording.

    Parameters
    ----------
    plate : Nameplate or None
    row : mapping
        Conditions noted with the recording.
    """
    return row if plate is None else plate.conditions(row)


def condition_origin(plate: Nameplate | None, row: Mapping[str, Any], column: str) -> str:
    """Where the value of a known condition comes from, in words.

    Parameters
    ----------
    plate : Nameplate or None
    row : mapping
        Conditions noted with the recording.
    column : str
        Key of :data:`~.feature_rows.noted.NOTED`.

    Examples
    --------
    >>> plate = nameplate_of(None, "journal-bearing", {"load.static": "4 kN"})
    >>> [condition_origin(plate, {}, each) for each in ("static_load_n", "viscosity_pa_s")]
    ['set', 'journal-bearing']
    >>> condition_origin(plate, {"viscosity_pa_s": 0.03}, "viscosity_pa_s")
    'noted with the recording'
    """
    places = () if plate is None else plate.scene.condition_places
    path = next((each.path for each in places if each.column == column), "")
    if plate is not None and path and plate.is_set(path):
        return "set"
    if isinstance(row.get(column), float | int) and math.isfinite(row[column]):
        return "noted with the recording"
    return "" if plate is None else plate.source


def _head_of(source: Path) -> Attributes | None:
    """Attributes of a data set that holds a scene; else None."""
    if source.suffix.lower() not in (".h5", ".hdf5"):
        return None
    try:
        with DataSet(source) as data:
            return data.attributes if data.attributes.scene else None
    except DataError:
        return None  # written by another program: it has no scene


def _scene_in(head: Attributes, values: Mapping[str, Any]) -> Scene:
    """Scene of a data set from a recipe (TOML) or of one recording (JSON), with values replaced."""
    if head.scene.lstrip().startswith("{"):
        return scene_from_table(override(json.loads(head.scene), values))
    overrides = {**json.loads(head.overrides or "{}"), **values}
    return recorded_scene(head.scene, head.recipe, json.dumps(overrides))


def _parted(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Values, and the texts after their ``+-``."""
    plain: dict[str, Any] = {}
    spreads: dict[str, str] = {}
    for path, value in values.items():
        text, sign, spread = str(value).replace("±", "+-").partition("+-")
        plain[path] = text.strip() if sign else value
        if sign:
            spreads[path] = spread.strip()
    return plain, spreads


_OFFSET_SHARE = 0.005  # of a probe's range: uncertainty of the reading at a centred shaft


def _usual_doubts(scene: Any) -> Doubts:
    """Usual uncertainties of the scene's probes."""
    probes = [*getattr(scene, "probes", ()), *getattr(scene, "sensors", ())]
    ranges = [probe.range for probe in probes if hasattr(probe, "offset")]
    return Doubts(offset=_OFFSET_SHARE * max(ranges)) if ranges else Doubts()


def _doubts(
    spreads: Mapping[str, str], scene: Scene, values: Mapping[str, Any]
) -> dict[str, float]:
    found: dict[str, float] = {}
    for path, text in spreads.items():
        kind = _kind_of(path)
        if kind is None:
            raise DataError(
                f"{path} = {values[path]} takes no uncertainty, must be a load, oil, or a probe's "
                "offset or gain; leave the +- out"
            )
        found[kind] = max(found.get(kind, 0.0), _spread(path, text, kind, scene))
    return found


def _kind_of(path: str) -> str | None:
    """Field of :class:`Doubts` that the uncertainty of a value belongs to."""
    table, *_, name = path.split(".")
    if table == "load":
        return "load"
    if table == "oil":
        return "viscosity"
    return name if table in ("sensors", "probes") and name in ("offset", "gain") else None


def _spread(path: str, text: str, kind: str, scene: Scene) -> float:
    """Uncertainty as in :class:`Doubts`: relative to the value, for an offset in metres."""
    if text.endswith("%") and kind != "offset":
        share = _number(path, text[:-1]) / 100
    elif kind == "offset":
        share = to_si(text, "length")
    elif path == "oil.temperature":
        share = _warmer(scene, _number(path, text.removesuffix("K")))
    else:
        raise DataError(f"{path}: uncertainty '{text}' must be in per cent; write '+- 10 %'")
    if not 0 < share < 1:
        most = "1 m" if kind == "offset" else "100 %"
        raise DataError(f"{path}: uncertainty '{text}' must be > 0 and < {most}; correct it")
    return share


def _number(path: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise DataError(f"{path}: uncertainty '{text}' must be a number; correct it") from None


def _warmer(scene: Any, kelvin: float) -> float:
    """Relative change of the viscosity over a temperature difference."""
    oil: Oil = scene.oil
    assert oil.temperature is not None  # the user set it
    warm = oil.model_copy(update={"temperature": oil.temperature + kelvin})
    return abs(math.log(warm.dynamic_viscosity / oil.dynamic_viscosity))


def known_conditions(plate: Nameplate, row: Mapping[str, Any]) -> Sequence[str]:
    """Manifest columns of the loads and oil conditions that were noted or set."""
    return [
        each.column
        for each in plate.scene.condition_places
        if each.column not in _MEASURED
        if plate.is_set(each.path)
        or (isinstance(row.get(each.column), float | int) and math.isfinite(row[each.column]))
    ]
