"""What is wrong with a recording before anything is said of the machine.

Faults that the samples show (saturated, dead, a tacho without pulses), and those that show in how
a model sees the recording: a wrong unit, swapped channels, a wrong sample rate. Of the latter each
suspicion is tried: the recording is mended as suspected, and must then look familiar.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.views import MARK
from ...features.rotation.order import check_pulses, pulse_times
from ...sim.output.lost import LostSamples, lost_samples
from ...sim.output.recording import Recording
from ...sim.output.sensor import Channel
from .model_card import LayoutCard, ModelCard
from .physical import level_channels, level_rows, shape_rows
from .resampling import resampled

Float = NDArray[np.float64]
Kind = Literal[
    "saturated",
    "gap",
    "dead",
    "swapped",
    "unit",
    "rate",
    "tacho",
    "layout",
    "hum",
    "tone",
    "knocks",
    "coupling",
    "place",
]

FACTORS = (9.80665, 1000.0)
"""Ratios of units that are mixed up: g for m/s^2, and milli or micro for the next unit."""

RATES = (2.0, 2.56, 4.0, 5.12, 10.0)
"""Ratios of sample rates that are mixed up: decimation, and rate for bandwidth."""

RATE_TOLERANCE = 1e-3
"""Of the sample rate that a model needs [-]: band edges move as much."""

_FEWEST_AT_END = 4  # samples that equal the extreme: chance makes one or two
_END_SHARE = 0.02  # of the swing, next to the extreme
_PILE = 4  # a tone has at most 1 / (sqrt(2) - 1) = 2.4 times as many at its last code as before it
_MOST_CLIPPED = 0.1
"""Share of saturated samples beyond which no verdict is given. They moved estimates of journals by
0.9 % of the limit (4 % at most) at this share, by 3 % (21 %) at 0.15, by 15 % (91 %) at 0.3."""

_MOST_LOST = 0.2
"""Share of lost samples beyond which no verdict is given. They moved the mean error of pumps from
4.1 % of the limit to 4.3 at a tenth, 4.6 at this share and 5.5 at 0.3 (48 recordings, filled up
with zeros or the last value), that of journals by 0.1."""

_TRIED = 2  # factors of units
_NEARER = (
    0.5  # of the excess: one of 11 dB is no factor of 20 dB, though 9 dB the other way is less
)
_FREE = 0.75  # of the limit: familiar recordings are within half of it in what hangs on no rate
_QUIET = 1 / 30  # of the least level ever trained: wear and speed do not make a channel so quiet
_OFF_DB = 10.0  # half-way to 9.81 [dB]
_SPEED_MARGIN = 0.05  # of the trained speeds


@dataclass(frozen=True, kw_only=True)
class QualityFault:
    """One thing wrong with a recording.

    Attributes
    ----------
    kind : str
        ``saturated``, ``gap``, ``dead``, ``swapped``, ``unit``, ``rate``, ``tacho``, ``layout``,
        ``hum``, ``tone``, ``knocks``, ``coupling`` or ``place``.
    channel : str
        Where; empty for the whole recording.
    text : str
        Quantity, value, bound and cure.
    bars : bool
        No verdict is given with it.
    factor : float or None
        Of a unit: what the samples must be multiplied by. Of a rate: true over stated one.
    """

    kind: Kind
    channel: str
    text: str
    bars: bool = True
    factor: float | None = None


# --- what the samples and the header show


def recording_faults(recording: Recording, card: ModelCard) -> tuple[QualityFault, ...]:
    """What is wrong with a recording and its views as inputs of a model, all of it.

    Parameters
    ----------
    recording : Recording
    card : ModelCard
        Of the model.

    Returns
    -------
    tuple of QualityFault
        Of layout where that does not fit, else of the samples; a view that is missing is one.
    """
    faults = [*(layout_faults(recording, card) or sample_faults(recording))]
    views = card.views
    for view, layout in views.items():
        if view not in recording.joined:
            text = f"view {view} is missing, which the model needs; give --join {view}=FILE"
            faults.append(QualityFault(kind="layout", channel="", text=text))
            continue
        other = recording.joined[view]
        found = layout_faults(other, layout) or sample_faults(other)
        faults += [replace(fault, text=f"view {view}: {fault.text}") for fault in found]
    strange = sorted(set(recording.joined) - set(views))
    if strange:
        known = ", ".join(views) or "none"
        text = f"views {', '.join(strange)} are joined, the model knows {known}: leave them out"
        faults.append(QualityFault(kind="layout", channel="", text=text))
    return tuple(faults)


def coupling_faults(
    recording: Recording, names: Sequence[str], row: Float, least: Float
) -> tuple[QualityFault, ...]:
    """That probes do not show where the shaft is, which a model reads.

    Parameters
    ----------
    recording : Recording
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]
    least : numpy.ndarray [shape=(n_features,)]
        Least value of each feature in training.

    Returns
    -------
    tuple of QualityFault
        One where the shaft is nearer the middle than any in training, and the mean of every probe
        is next to nothing beside its vibration: of a journal in the middle of its bearing no two
        would be, as no probe is zeroed so well.

    Examples
    --------
    >>> wave = np.sin(np.arange(1000.0)) * 1e-5
    >>> probes = [Channel(name=f"p{i}", unit="m", quantity="displacement") for i in (1, 2)]
    >>> recording = Recording(
    ...     signal=np.stack([wave, wave]), sample_rate=1e3, channels=tuple(probes))
    >>> names, row = ["orbit.centreline.radius_db"], np.array([-150.0])
    >>> coupling_faults(recording, names, row, np.array([-90.0]))[0].text[:36]
    'p1, p2 show no mean position, which '

    A model of probes that never had one reads none:

    >>> coupling_faults(recording, names, row, np.array([-160.0]))
    ()
    """
    rows = [i for i, each in enumerate(recording.channels) if each.quantity == _GAP]
    radii = [i for i, name in enumerate(names) if name.endswith(_RADIUS)]
    if len(rows) < _PAIR or not (row[radii] < least[radii]).any():
        return ()
    probes = recording.signal[rows].astype(np.float64)
    if (np.abs(probes.mean(axis=1)) > _NO_MEAN * probes.std(axis=1)).any():
        return ()
    names = ", ".join(recording.names[i] for i in rows)
    text = (
        f"{names} show no mean position, which the model reads: they are coupled for AC, or their "
        "mean was taken away; record the gap with it"
    )
    return (QualityFault(kind="coupling", channel=names, text=text),)


_GAP, _RADIUS, _PAIR = "displacement", "centreline.radius_db", 2
_NO_MEAN = 0.03  # of the vibration's rms: what is left of a mean in a few revolutions


def place_faults(
    recording: Recording, names: Sequence[str], row: Float, least: Float, most: Float
) -> tuple[QualityFault, ...]:
    """That a shaft runs on a side of its bearing where none did in training.

    Parameters
    ----------
    recording : Recording
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]
    least, most : numpy.ndarray [shape=(n_features,)]
        Range of each feature in training.

    Returns
    -------
    tuple of QualityFault
        One for every pair of probes whose mean position is outside the trained range, by more than
        a twentieth of its width. It bars a verdict where the opposite place is inside: a gap grows
        where the shaft moves away from its probe, and a model reads the motion towards it.

    Examples
    --------
    >>> probes = [Channel(name=f"p{i}", unit="m", quantity="displacement") for i in (1, 2)]
    >>> recording = Recording(signal=np.ones((2, 8)), sample_rate=1e3, channels=tuple(probes))
    >>> names = ["orbit.centreline.x", "orbit.centreline.y"]
    >>> least, most = np.array([-1.4e-4, -8e-5]), np.array([5e-6, 2e-6])
    >>> [fault] = place_faults(recording, names, np.array([4e-5, 5e-5]), least, most)
    >>> fault.bars, fault.text[:47]
    (True, 'p1, p2 put the shaft at (0.040, 0.050) mm, whic')
    >>> [fault] = place_faults(recording, names, np.array([5e-5, -4e-5]), least, most)
    >>> fault.bars
    False
    >>> place_faults(recording, names, np.array([-4e-5, -5e-5]), least, most)
    ()
    """
    probes = ", ".join(each.name for each in recording.channels if each.quantity == _GAP)
    found = []
    columns = {name: i for i, name in enumerate(names)}
    for along, i in columns.items():
        j = columns.get(along.removesuffix(_ALONG) + _ACROSS)
        if not along.endswith(_ALONG) or j is None:
            continue
        place, low, high = row[[i, j]], least[[i, j]], most[[i, j]]
        if _inside(place, low, high):
            continue
        opposite = _inside(-place, low, high)
        x, y = 1e3 * place
        spans = [f"{1e3 * a:.3f} to {1e3 * b:.3f}" for a, b in zip(low, high, strict=True)]
        text = (
            f"{probes} put the shaft at ({x:.3f}, {y:.3f}) mm, which must be within "
            f"({', '.join(spans)}) mm, as in training: "
        )
        text += _AWAY if opposite else _ELSEWHERE
        found.append(QualityFault(kind="place", channel=probes, text=text, bars=opposite))
    return tuple(found)


def _inside(place: Float, low: Float, high: Float) -> bool:
    beyond = np.maximum(low - place, place - high) > _BESIDE * (high - low)
    return not beyond.any()


_ALONG, _ACROSS = "centreline.x", "centreline.y"
_AWAY = (
    "with the opposite sign it would be; gaps grow where the shaft moves away from a probe, a "
    "model reads the motion towards it: multiply them by -1, or check the direction of the load"
)
_ELSEWHERE = "check names, angles and zeros of the probes, and the direction of the load"
_BESIDE = 0.05  # of the trained width: a machine a little beyond the extremes of a thousand


def mark_faults(recording: Recording, late_deg: float | None) -> tuple[QualityFault, ...]:
    """That the tacho's mark is not at the dead centre where a model has it.

    Parameters
    ----------
    recording : Recording
    late_deg : float or None
        By how much it comes late [deg]; None where it does not.

    Examples
    --------
    >>> recording = Recording(signal=np.ones((1, 8)), sample_rate=1e3, tacho="key", channels=(
    ...     Channel(name="key", unit="V", quantity="tacho"),))
    >>> mark_faults(recording, 30.0)[0].text[:61]
    'tacho key: its mark comes about 30 degrees late, but for whic'
    >>> mark_faults(recording, None)
    ()
    """
    if late_deg is None:
        return ()
    side = "late" if late_deg > 0 else "early"
    upright = "" if not _upside_down(recording, late_deg) else "multiply the channel by -1: "
    if upright:
        upright += "its pulses point down and end as late as that; or "
    text = (
        f"tacho {recording.tacho}: its mark comes about {abs(late_deg):.0f} degrees {side}, but "
        f"for which the recording is familiar; must be at the top dead centre: {upright}move the "
        "mark, shift the channel by as much, or look for a valve that does not close"
    )
    return (QualityFault(kind="tacho", channel=str(recording.tacho), text=text),)


def _upside_down(recording: Recording, late_deg: float) -> bool:
    """Whether pulses point down, so that their end is taken for the mark, and are so long."""
    tacho = recording.tacho_signal
    if tacho is None:
        return False
    below = float(np.mean(tacho < (float(tacho.min()) + float(tacho.max())) / 2))
    width_deg = 360.0 * below / recording.pulses_per_revolution
    return below < _HALF and abs(width_deg - late_deg) <= _MARK_BIN_DEG


_HALF = 0.5
_MARK_BIN_DEG = 10.0  # in steps of which a mark is moved to try it


def layout_faults(recording: Recording, card: LayoutCard) -> tuple[QualityFault, ...]:
    """What a recording lacks of a model's inputs; empty where it fits.

    Parameters
    ----------
    recording : Recording
    card : LayoutCard
        What the model needs.

    Returns
    -------
    tuple of QualityFault
        All of them.
    """
    unnamed = _unnamed_tacho(recording, card)
    vibration = [c for c in recording.vibration_channels if c.name != unnamed]
    return (
        *_channel_faults(vibration, card),
        *_tacho_layout_faults(recording, card),
        *_rate_faults(recording.sample_rate, card.sample_rate_hz),
    )


def _unnamed_tacho(recording: Recording, card: LayoutCard) -> str | None:
    """Channel of the model's tacho in a recording that names none."""
    there = recording.tacho is None and card.tacho in recording.names
    return card.tacho if there else None


def _channel_faults(found: Sequence[Channel], card: LayoutCard) -> list[QualityFault]:
    wanted = [c for c in card.channels if c.name != card.tacho]
    units = {c.name: c.unit for c in wanted}
    names = ", ".join(c.name for c in wanted)
    faults = []
    if len(found) != len(wanted):
        text = f"it has {len(found)} vibration channel(s), the model needs {len(wanted)}: {names}"
        text += _mapping([c.name for c in found], [c.name for c in wanted])
        faults.append(QualityFault(kind="layout", channel="", text=text))
    elif [c.name for c in found] != [c.name for c in wanted]:
        here = ", ".join(c.name for c in found)
        text = f"its channels are {here}, the model needs {names}, in this order"
        text += _mapping([c.name for c in found], [c.name for c in wanted])
        faults.append(QualityFault(kind="layout", channel="", text=text))
    for c in found:
        # under a name that the model does not know, any unit of the model's may be right
        unit = units.get(c.name, c.unit if c.unit in units.values() else next(iter(units.values())))
        if c.unit != unit:
            text = f"channel {c.name} is in {c.unit or 'an unknown unit'}, the model needs {unit}"
            faults.append(QualityFault(kind="unit", channel=c.name, text=text))
    return faults


def _mapping(found: Sequence[str], wanted: Sequence[str]) -> str:
    """What is missing, and how channels of other names can stand for it.

    Examples
    --------
    >>> _mapping(["ch1", "ch2", "z"], ["x", "y", "z"])
    '; missing x, y: if ch1, ch2 are these, give --channels x=ch1,y=ch2,z'
    >>> _mapping(["x"], ["x", "y"])
    '; missing y'
    """
    missing = [name for name in wanted if name not in found]
    spare = [name for name in found if name not in wanted]
    if not missing:
        return f": give --channels {','.join(wanted)}"
    told = f"; missing {', '.join(missing)}"
    if len(spare) < len(missing):
        return told
    stand = dict(zip(missing, spare, strict=False))
    names = ",".join(f"{name}={stand[name]}" if name in stand else name for name in wanted)
    return f"{told}: if {', '.join(stand.values())} are these, give --channels {names}"


def _tacho_layout_faults(recording: Recording, card: LayoutCard) -> list[QualityFault]:
    if (recording.tacho is None) != (card.tacho is None):
        needs = "it has no tacho, the model needs one; record one, or name it: --tacho CHANNEL"
        if unnamed := _unnamed_tacho(recording, card):
            needs = f"its channel {unnamed} is not named as its tacho; give --tacho {unnamed}"
        text = needs if card.tacho else "it has a tacho, the model was trained without"
        return [QualityFault(kind="tacho" if card.tacho else "layout", channel="", text=text)]
    if recording.pulses_per_revolution != card.pulses_per_revolution:
        text = (
            f"its tacho gives {recording.pulses_per_revolution} pulses per revolution, the model "
            f"needs {card.pulses_per_revolution}"
        )
        return [QualityFault(kind="layout", channel=recording.tacho or "", text=text)]
    return []


def _rate_faults(found: float, wanted: float) -> list[QualityFault]:
    if abs(found / wanted - 1) <= RATE_TOLERANCE:
        return []
    cure = "resample" if found > wanted else "record faster, or train a model on such recordings"
    text = f"it is sampled at {found:g} Hz, the model needs {wanted:g} Hz: {cure}"
    return [QualityFault(kind="rate", channel="", text=text)]


def sample_faults(recording: Recording) -> tuple[QualityFault, ...]:
    """Faults that the samples alone show: flat tops, gaps, silence, a tacho that does not pulse.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of QualityFault
        All of them. Saturated samples bar a verdict from a tenth of a channel's on, lost ones
        from a fifth, the others do in any case.

    Notes
    -----
    A channel is saturated where four samples or more equal its extreme, and more than four times
    as many as equal any other value within two per cent of the swing beside it: samples of a fine
    converter hardly ever agree, of a coarse one they agree everywhere. A square wave, and a tone of
    five bits with no other code so near, look the same as saturation.

    Examples
    --------
    >>> wave = np.sin(np.arange(1000.0))
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> recording = Recording(signal=wave[np.newaxis], sample_rate=10.0, channels=(channel,))
    >>> sample_faults(recording)
    ()
    >>> sample_faults(replace(recording, signal=recording.signal.clip(-0.8, 0.8)))[0].kind
    'saturated'
    """
    faults: list[QualityFault] = []
    for channel, row in zip(recording.vibration_channels, recording.vibration, strict=True):
        faults += _channel_sample_faults(channel, row, recording.sample_rate)
    return (*faults, *_tacho_faults(recording))


def _channel_sample_faults(
    channel: Channel, row: NDArray[np.float32], sample_rate: float
) -> list[QualityFault]:
    low, high, name, unit = float(row.min()), float(row.max()), channel.name, channel.unit
    if low == high:
        text = f"channel {name} is {low:g} {unit} throughout: it is dead; check sensor and cable"
        return [QualityFault(kind="dead", channel=name, text=text)]
    # forces and pressures may stand still
    lost = lost_samples(row) if channel.quantity in _NEVER_STILL else None
    faults = [] if lost is None else [_gap_fault(channel, lost, row.size, sample_rate)]
    rails = [end for end in (low, high) if lost is None or end != lost.value]
    ends = {end: count for end in rails if (count := _piled(row, end, high - low))}
    if ends:
        text = (
            f"channel {name} is at exactly {' and '.join(f'{end:g}' for end in ends)} {unit} "
            f"{' and '.join(str(n) for n in ends.values())} times, more often than just beside it: "
            "it is saturated; raise the range"
        )
        bars = sum(ends.values()) > _MOST_CLIPPED * row.size
        faults.append(QualityFault(kind="saturated", channel=name, text=text, bars=bars))
    return faults


_NEVER_STILL = ("acceleration", "velocity", "displacement")


def _gap_fault(channel: Channel, lost: LostSamples, size: int, sample_rate: float) -> QualityFault:
    share = lost.count / size
    text = (
        f"channel {channel.name} stands still for {lost.count / sample_rate:.3g} s, {share:.2g} of "
        f"the recording, at {lost.value:g} {channel.unit} from {lost.start / sample_rate:.4g} s "
        f"on{f' and {lost.stretches - 1} times more' if lost.stretches > 1 else ''}: samples were "
        "lost; record without gaps"
    )
    return QualityFault(kind="gap", channel=channel.name, text=text, bars=share > _MOST_LOST)


def _piled(row: NDArray[np.float32], end: float, swing: float) -> int:
    """Samples at an extreme, where they are too many for an end that nothing cut off; else 0."""
    apart = np.abs(row - end)
    at = int(np.count_nonzero(apart == 0))
    beside = row[(apart > 0) & (apart <= _END_SHARE * swing)]
    alike = int(np.unique(beside, return_counts=True)[1].max(initial=0))
    return at if at >= _FEWEST_AT_END and at > _PILE * alike else 0


def _tacho_faults(recording: Recording) -> list[QualityFault]:
    tacho = recording.tacho_signal
    if tacho is None:
        return []
    try:
        pulses = pulse_times(tacho, recording.sample_rate)
        check_pulses(pulses, tacho.size, recording.sample_rate, recording.pulses_per_revolution)
    except ValueError as error:
        text = f"tacho {recording.tacho}: {error}"
        return [QualityFault(kind="tacho", channel=str(recording.tacho), text=text)]
    turns = (len(pulses) - 1) / recording.pulses_per_revolution
    if turns >= 1:
        return []
    text = f"tacho {recording.tacho} gives {turns:.2g} revolutions, must be >= 1; record longer"
    return [QualityFault(kind="tacho", channel=str(recording.tacho), text=text)]


# --- the level that is to be expected


@dataclass(frozen=True, kw_only=True)
class Levels:
    """Level of each channel as the shape of its signal and the speed let expect it.

    Attributes
    ----------
    centre, spread : numpy.ndarray [shape=(n_shapes,)]
        Of the coordinates of :func:`wearstate.diagnose.feature_rows.physical.shape_rows`.
    weight : numpy.ndarray [shape=(n_channels, n_shapes)]
        [dB]
    offset : numpy.ndarray [shape=(n_channels,)]
        [dB re 1 x]
    size : numpy.ndarray [shape=(n_channels,)]
        Standard deviation of what is left, on machines that had no part in the fit [dB].
    least : numpy.ndarray [shape=(n_channels,)]
        Lowest level of the training recordings [dB re 1 x].
    """

    centre: Float
    spread: Float
    weight: Float
    offset: Float
    size: Float
    least: Float

    def excess(self, names: Sequence[str], rows: Float) -> Float:
        """Level above the expected one [dB, shape=(n, n_channels)]."""
        standard = np.clip((shape_rows(names, rows) - self.centre) / self.spread, -3.0, 3.0)
        return level_rows(names, rows) - (standard @ self.weight.T + self.offset)


def fit_levels(
    names: Sequence[str], rows: Float, folds: Sequence[tuple[NDArray[np.intp], NDArray[np.intp]]]
) -> Levels:
    """Learn the levels of training recordings.

    Parameters
    ----------
    names : sequence of str
        Of the features.
    rows : numpy.ndarray [shape=(n, n_features)]
    folds : sequence of (numpy.ndarray, numpy.ndarray)
        Records to fit on and to judge on.

    Returns
    -------
    Levels
    """
    size = np.zeros((len(rows), len(level_channels(names))))
    for train, test in folds:
        size[test] = _levels(names, rows[train]).excess(names, rows[test])
    return replace(_levels(names, rows), size=np.sqrt((size**2).mean(axis=0)))


def _levels(names: Sequence[str], rows: Float) -> Levels:
    from sklearn.linear_model import Ridge

    inputs, level = shape_rows(names, rows), level_rows(names, rows)
    if not level.size or not inputs.size:  # features that hold no level, or nothing that tells it
        return _plain_levels(inputs, level)
    centre, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread = np.where(spread > 0, spread, 1.0)
    ridge = Ridge(_LEVEL_PENALTY).fit((inputs - centre) / spread, level)
    return Levels(
        centre=centre,
        spread=spread,
        weight=np.atleast_2d(ridge.coef_),
        offset=np.atleast_1d(ridge.intercept_),
        size=np.zeros(level.shape[1]),
        least=level.min(axis=0),
    )


def _plain_levels(inputs: Float, level: Float) -> Levels:
    """Mean levels, where no shape tells more."""
    shapes = inputs.shape[1]
    return Levels(
        centre=np.zeros(shapes),
        spread=np.ones(shapes),
        weight=np.zeros((level.shape[1], shapes)),
        offset=level.mean(axis=0),
        size=np.zeros(level.shape[1]),
        least=level.min(axis=0),
    )


_LEVEL_PENALTY = 30.0  # of a ridge on about a hundred standardised coordinates


# --- what shows only in how the recording looks


@dataclass(frozen=True, kw_only=True)
class Observation:
    """How a recording strikes a model.

    Attributes
    ----------
    distance, limit : float
        From the familiar, and where the unfamiliar begins.
    free_distance : float
        By what hangs on no sample rate; NaN where there is nothing.
    excess_db : mapping
        Level above the expected one [dB] of each channel.
    speed_hz : float or None
        From the tacho.
    """

    distance: float
    limit: float
    free_distance: float
    excess_db: Mapping[str, float]
    speed_hz: float | None

    @property
    def familiar(self) -> bool:
        """Nearer than the limit, with the levels to be expected."""
        return self.distance < self.limit and self.level

    @property
    def level(self) -> bool:
        """Every channel has about the level to be expected."""
        return all(abs(excess) < _OFF_DB for excess in self.excess_db.values())


Observe = Callable[[Recording], Observation]


def suspicions(
    recording: Recording,
    look: Observation,
    see: Observe,
    speeds: tuple[float, float] | None,
    stated: float | None = None,
) -> tuple[QualityFault, ...]:
    """Faults that explain why a recording looks strange, each tried out.

    Parameters
    ----------
    recording : Recording
        With the model's inputs.
    look : Observation
        How it looks as it is.
    see : callable
        How a mended recording looks.
    speeds : tuple of float, optional
        Trained range [Hz].
    stated : float, optional
        Sample rate that it came with [Hz]; its own unless given.

    Returns
    -------
    tuple of QualityFault
        The first explanation that makes the recording familiar, in the order unit (where a level
        is off), channels (where the shape is strange), rate (where shape or speed is); empty where
        none does or nothing is strange.
    """
    paced = speeds is None or look.speed_hz is None or _within(look.speed_hz, speeds)
    near = look.distance < look.limit
    found: tuple[QualityFault, ...] = ()
    if not look.level:
        found = _wrong_unit(recording, look, see)
    if not found and not near and paced:  # no cable changes the speed
        found = _swapped(recording, see)
    if not found and not (near and paced) and speeds is not None:
        rate = recording.sample_rate if stated is None else stated
        found = _wrong_rate(recording, look, see, speeds, rate)
    return found


def _within(speed: float, speeds: tuple[float, float]) -> bool:
    low, high = speeds
    return low * (1 - _SPEED_MARGIN) <= speed <= high * (1 + _SPEED_MARGIN)


def _wrong_unit(recording: Recording, look: Observation, see: Observe) -> tuple[QualityFault, ...]:
    off = {name: db for name, db in look.excess_db.items() if abs(db) >= _OFF_DB}
    for rank in range(_TRIED):
        factors = {name: _near_factors(excess)[rank] for name, excess in off.items()}
        mended = see(_amplified(recording, factors))
        nearer = all(abs(mended.excess_db[n]) < _NEARER * abs(db) for n, db in off.items())
        if mended.familiar and nearer:
            return tuple(
                QualityFault(
                    kind="unit",
                    channel=name,
                    text=f"channel {name} is {off[name]:+.0f} dB off what its shape lets expect; "
                    f"{_times(factor)} it is familiar: its unit is wrong, check it",
                    factor=factor,
                )
                for name, factor in factors.items()
            )
    return ()


def _amplified(recording: Recording, factors: Mapping[str, float], view: str = "") -> Recording:
    """A recording and its views with channels multiplied; those of a view go by its name."""
    names = [f"{view}{MARK}{name}" if view else name for name in recording.names]
    gain = np.array([factors.get(name, 1.0) for name in names], dtype=np.float32)
    joined = {name: _amplified(each, factors, name) for name, each in recording.joined.items()}
    return replace(recording, signal=recording.signal * gain[:, None], joined=joined)


def _near_factors(excess_db: float) -> list[float]:
    """Factors in the order in which they bring a level near the one to be expected.

    The nearest need not be the one: what is too quiet for the decibels of the features has another
    shape. Mending will tell.
    """
    known = [value for factor in FACTORS for value in (factor, 1 / factor)]
    return sorted(known, key=lambda factor: abs(excess_db + 20 * math.log10(factor)))


def _times(factor: float) -> str:
    return f"multiplied by {factor:.4g}" if factor > 1 else f"divided by {1 / factor:.4g}"


def _swapped(recording: Recording, see: Observe) -> tuple[QualityFault, ...]:
    channels = [c for c in recording.channels if c.name != recording.tacho]
    for a, b in combinations(channels, 2):
        if a.quantity != b.quantity or a.unit != b.unit:
            continue
        first, second = recording.names.index(a.name), recording.names.index(b.name)
        order = np.arange(len(recording.names))
        order[[first, second]] = second, first
        mended = see(replace(recording, signal=recording.signal[order]))
        if mended.familiar:
            text = f"channels {a.name} and {b.name} look swapped; swap their cables or names"
            return (QualityFault(kind="swapped", channel=f"{a.name}, {b.name}", text=text),)
    return ()


def _wrong_rate(
    recording: Recording,
    look: Observation,
    see: Observe,
    speeds: tuple[float, float],
    stated: float,
) -> tuple[QualityFault, ...]:
    if look.speed_hz is None:
        return ()
    for ratio in (*RATES, *(1 / rate for rate in RATES)):
        if not _within(look.speed_hz * ratio, speeds):
            continue
        mended = see(resampled(recording, ratio))
        # true samples that are slower than stated hold no high bands to compare
        lacking = ratio < 1 and mended.free_distance < _FREE * mended.limit and mended.level
        if mended.familiar or lacking:
            text = (
                f"speed and spectrum fit a sample rate of {stated * ratio:g} Hz, {ratio:.3g} times "
                f"the stated {stated:g} Hz; correct the rate, or, if it is right, run the machine "
                f"within {speeds[0]:.4g} to {speeds[1]:.4g} Hz"
            )
            return (QualityFault(kind="rate", channel="", text=text, factor=ratio),)
    return ()


def quiet_faults(
    recording: Recording, names: Sequence[str], row: Float, levels: Levels
) -> tuple[QualityFault, ...]:
    """Channels so quiet that nothing but noise can be on them.

    Parameters
    ----------
    recording : Recording
    names : sequence of str
        Of the features.
    row : numpy.ndarray [shape=(n_features,)]
    levels : Levels

    Returns
    -------
    tuple of QualityFault
    """
    found = level_rows(names, row[None, :])[0]
    units = recording.units
    for view, each in recording.joined.items():
        units |= {f"{view}{MARK}{name}": unit for name, unit in each.units.items()}
    return tuple(
        QualityFault(
            kind="dead",
            channel=channel,
            text=f"channel {channel} has an rms of {10 ** (level / 20):.3g} {units[channel]}, must "
            f"be >= {10 ** (least / 20) * _QUIET:.3g} {units[channel]}: it is dead; check sensor "
            "and cable",
        )
        for channel, level, least in zip(level_channels(names), found, levels.least, strict=True)
        if level < least + 20 * np.log10(_QUIET)
    )
