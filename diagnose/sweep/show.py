"""Quantities shown by a sweep: features of the sensors, and quantities of the simulator."""

import difflib
import fnmatch
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from ...datasets.generation.machines import Truth
from ...features.catalogue.row import catalogue, feature_names
from ...sim.output.recording import Recording
from .axes import SweepError

MOST_SHOWN = 200
"""Largest number of quantities of a sweep."""


@dataclass(frozen=True, kw_only=True)
class Shown:
    """One quantity.

    Attributes
    ----------
    name : str
        Name of a value of the feature catalogue, or from
        :func:`wearstate.datasets.generation.truths.truths_of`.
    words : str
        Full description, with the frequencies of bands.
    unit : str
    seen : bool
        Computed from the sensors' signals; otherwise known only in simulation.
    feature : bool
        From the catalogue.
    """

    name: str
    words: str
    unit: str
    seen: bool
    feature: bool

    @property
    def label(self) -> str:
        """Name, with the description if there is one."""
        return f"{self.name} ({self.words})" if self.words else self.name


def _feature_rows(solution: Recording) -> Iterator[tuple[str, str, Shown]]:
    """Row of the catalogue, name of a value, and its description."""
    units = solution.units
    for row in catalogue("complete"):
        try:
            names = feature_names(
                solution.vibration_names,
                solution.sample_rate,
                tacho=solution.tacho is not None,
                quantities=solution.vibration_quantities,
                n_samples=solution.signal.shape[-1],
                only=[row["name"]],
            )
        except ValueError:  # not available for this recording
            continue
        for name in names:
            unit = _unit(row["unit"], units.get(name.partition(".")[0], ""))
            yield row["name"], name, Shown(name=name, words="", unit=unit, seen=True, feature=True)


def _unit(unit: str, channel: str) -> str:
    """Unit of a row of the catalogue for a channel.

    Examples
    --------
    >>> _unit("x", "m/s^2"), _unit("dB re 1 x^2", "m/s^2"), _unit("-", "m")
    ('m/s^2', 'dB', '')
    """
    if unit.startswith("dB"):
        return "dB"
    return {"x": channel, "-": ""}.get(unit, unit)


def truths_shown(truths: Mapping[str, Truth]) -> dict[str, Shown]:
    """Descriptions of the quantities known of a run.

    Parameters
    ----------
    truths : mapping of str to Truth
    """
    return {
        name: Shown(name=name, words=each.words, unit=each.unit, seen=each.seen, feature=False)
        for name, each in truths.items()
    }


def choose(
    patterns: Sequence[str], solution: Recording, truths: Mapping[str, Truth]
) -> tuple[Shown, ...]:
    """Quantities that match any of the patterns, in their order.

    Parameters
    ----------
    patterns : sequence of str
        Names with ``*``, ``?`` and ``[…]`` as in a shell. Dots and underscores are equivalent; the
        channel, the ending ``.level_db`` and leading zeros may be omitted; the name of a row of the
        catalogue stands for all its values. Empty: levels of the channels, and the quantities of
        interest of the machine.
    solution : Recording
        Recording of the swept scene.
    truths : mapping of str to Truth
        Truths of the same run.

    Raises
    ------
    SweepError
        A pattern matches nothing (similar names are suggested), or there are too many matches.
    """
    rows = list(_feature_rows(solution))
    known = truths_shown(truths)
    forms: dict[str, list[Shown]] = {}
    for name, each in known.items():
        forms.setdefault(_plain(name), []).append(each)
    for row, name, each in rows:
        for form in dict.fromkeys((_plain(row), *_forms(name))):
            forms.setdefault(form, []).append(each)
    found: dict[str, Shown] = {}
    faults = []
    levels = [name for row, name, _ in rows if row == "rms"]
    for pattern in patterns or (*_usual(known), *levels):
        hits = [each for form in _matching(pattern, forms) for each in forms[form]]
        found |= {each.name: each for each in hits}
        if not hits:
            faults.append(f"quantity '{pattern}' is unknown{_near(pattern, forms)}")
    if len(found) > MOST_SHOWN:
        faults.append(f"{len(found)} quantities are selected, must be <= {MOST_SHOWN}; name fewer")
    if faults:
        raise SweepError(faults)
    return tuple(found.values())


def _usual(known: Mapping[str, Shown]) -> list[str]:
    """Bands, orders, and other quantities except the wear itself and guards of the run."""
    return [name for name, each in known.items() if each.seen or not re.search(_COLUMN, name)]


_COLUMN = r"_(m|n|hz|pa|share|ratio|samples|margin)$"  # endings of manifest columns


def _forms(name: str) -> Iterator[str]:
    """Ways to write the name of a value: with or without its channel and ending."""
    whole = name.removesuffix(".level_db")
    label = whole.partition(".")[2]
    for form in (name, whole, label, name.partition(".")[2]):
        if form:
            yield _plain(form)


def _plain(name: str) -> str:
    """Normalised spelling of a name.

    Examples
    --------
    >>> _plain("acc_x.order_02"), _plain("pin.peak")
    ('acc_x_order_2', 'pin_peak')
    """
    return re.sub(r"(?<![0-9.])0+(?=[0-9])", "", name.replace(".", "_"))


def _matching(pattern: str, forms: Iterable[str]) -> list[str]:
    wanted = _plain(pattern.strip())
    if wanted in forms:
        return [wanted]
    return fnmatch.filter(forms, wanted)


def _near(pattern: str, forms: Iterable[str]) -> str:
    near = difflib.get_close_matches(_plain(pattern), list(forms), n=3, cutoff=0.5)
    if near:
        return f"; did you mean {' or '.join(map(repr, near))}?"
    return "; see wearstate features --list, and wearstate simulate --json for what is known"
