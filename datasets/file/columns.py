"""Meanings and units of the columns of a manifest."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from ...sim.scene.load import all_condition_places, all_wear_places


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a manifest.

    Attributes
    ----------
    name : str
        Name in the file.
    unit : str
        SI unit, by the ending of the name; empty if it has none.
    meaning : str
        Meaning in words.
    role : str
        ``identity``, ``label``, ``condition``, ``numerics`` or ``other``.
    """

    name: str
    unit: str
    meaning: str
    role: str


_UNITS = {
    "m": "m",
    "hz": "Hz",
    "n": "N",
    "pa": "Pa",
    "rad": "rad",
    "s": "s",
    "h": "h",
    "k": "K",
    "pa_s": "Pa s",
    "kg_m": "kg m",
    "hours": "h",
    "m2_per_n": "m^2/N",
}
"""Unit by the ending of a name."""

MEANINGS = (
    # identity
    ("record_id", "identity", "name of the record, unique in the file"),
    ("group", "identity", "machine: every split keeps its records on one side"),
    ("group_name", "identity", "machine, as named in the labels of a measured file"),
    ("file", "identity", "measured file of the record"),
    ("start_s", "identity", "start of the record in that file"),
    ("view", "identity", "test of its machine state that the record belongs to"),
    ("state", "identity", "machine state: records of one machine and state can be joined"),
    ("seed", "identity", "seed of the record's sensor noise"),
    ("done", "identity", "the record is written; true in every finished file"),
    ("status", "identity", "ok, or why the record must not be used"),
    ("signal_crc32", "identity", "checksum of the record's signal"),
    # labels
    ("grade", "label", "wear grade of the first severity, 0 as new to 3 condemned; -1 unknown"),
    ("grade_(.+)", "label", "the same for a further severity: {0}"),
    ("choice_(.+)", "numerics", "option of the recipe that the machine or record took: {0}"),
    ("confounder_(.+)", "label", "whether this fault other than wear is present: {0}"),
    ("(.+)_value", "label", "scene value of that fault [SI], 0 if it is absent: {0}"),
    ("operating_hours", "label", "operating hours of the machine at the record"),
    ("remaining_life_h", "label", "operating hours to the condemning limit, 0 beyond; NaN: never"),
    ("life_share", "label", "age of the surface over the age at which it is renewed"),
    ("maintenance", "label", "maintenance events so far"),
    ("wear_rate_m2_per_n", "label", "specific wear rate of the machine"),
    # conditions
    ("mean_speed_hz", "condition", "shaft speed, mean over the record"),
    # numerics
    ("rung_(.+)", "numerics", "model used for this effect: {0}"),
    ("contact_law", "numerics", "law of the contact in the joint"),
    ("frf_sha256", "numerics", "hash of the measured transfer functions of the casing"),
    ("step_s", "numerics", "time step"),
    ("steps", "numerics", "time steps taken"),
    ("step_per_contact_time", "numerics", "time step over the time constant of the contact"),
    ("contact_changes", "numerics", "number of times that contact was made or lost"),
    ("cuts_refused", "numerics", "changes of contact that were not located in time"),
    ("peak_normal_force_n", "numerics", "largest force of the contact"),
    ("min_film_m", "numerics", "smallest thickness of the oil film"),
    ("film_temperature_k", "numerics", "temperature of the warmest film, by its heat balance"),
    ("rubbing_share", "numerics", "share of the steps in which rough surfaces touch in their oil"),
    ("peak_eccentricity", "numerics", "largest eccentricity ratio of the journal"),
    ("least_reaction_n", "numerics", "smallest vertical reaction of a bearing"),
    ("motion_share", "numerics", "largest motion of a journal over the limit of its linear film"),
    ("cavitating_share", "numerics", "share of the steps with vapour in a cylinder"),
    ("lift_left", "numerics", "lift of a valve when it should be closed, over its largest"),
    ("tension_share", "numerics", "share of the steps in which a massless link was pulled"),
    ("floored_share", "numerics", "share of the contacts with a floored speed of impact"),
    ("residual", "numerics", "residual of the film's solution"),
    ("estimated_error", "numerics", "relative error of the features, as far as it is known"),
    ("stability_margin", "numerics", "distance from instability, 0 at the limit"),
    ("least_damping_ratio", "numerics", "damping ratio of the least damped mode"),
    ("least_damped_hz", "numerics", "frequency of the least damped mode"),
    ("clipped_samples", "numerics", "samples at the end of the converter's range"),
)
"""Name (a pattern), role, meaning. The first match counts; a new column is one row.

Wear and operating conditions are named by the machines, see :mod:`wearstate.sim.scene.load`.
"""


def meanings() -> list[tuple[str, str, str]]:
    """Name (a pattern), role and meaning of every column, including those named by machines."""
    kinds = {each.kind: each.words for each in all_wear_places().values()}
    worn = [(f"{kind}_(.+)_m", "label", f"{words}: {{0}}") for kind, words in kinds.items()]
    places = all_condition_places()
    return [
        *((column, "condition", each.words) for column, each in places.items()),
        *worn,
        *MEANINGS,
    ]


def describe_columns(names: Iterable[str]) -> list[Column]:
    """Unit and meaning of manifest columns.

    Parameters
    ----------
    names : iterable of str

    Returns
    -------
    list of Column
        Columns in the same order. An unknown column is described as given on import.

    Examples
    --------
    >>> [clearance, own] = describe_columns(["diametral_clearance_crankpin_1_m", "oil_k"])
    >>> clearance.meaning, clearance.unit
    ('diametral clearance: crankpin 1', 'm')
    >>> own.role, own.unit
    ('other', 'K')
    """
    known = meanings()
    return [_column(name, known) for name in names]


def _column(name: str, known: Iterable[tuple[str, str, str]]) -> Column:
    for pattern, role, meaning in known:
        match = re.fullmatch(pattern, name)
        if match:
            words = meaning.format(*(part.replace("_", " ") for part in match.groups()))
            return Column(name=name, unit=_unit(name), meaning=words, role=role)
    return Column(name=name, unit=_unit(name), meaning="given on import", role="other")


def _unit(name: str) -> str:
    if name.startswith("confounder_"):
        return ""  # a flag, whatever the ending of its name
    ending = max((end for end in _UNITS if name.endswith(f"_{end}")), key=len, default="")
    return _UNITS.get(ending, "")
