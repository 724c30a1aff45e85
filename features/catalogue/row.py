"""The feature row of one recording: which features it has, their names and values."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations
from typing import Any, Protocol, get_args, runtime_checkable

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ..response.modal_model import Modes
from ..response.transfer import FrfReference
from ..rotation import order
from ..signal.rate import check_rate
from ..signal.statistics import Real
from .analysis import ACCELERATION, FORCE, STANDARD, Analysis, Settings
from .catalogue import SETS, SetName, smallest_set
from .feature import Feature, Scope
from .needs import NEEDS, Layout, shortcomings, struck

Float = NDArray[np.float64]

LARGEST_SAMPLE = 1e9
"""Largest plausible sample [unit of x]: above it, squares leave the range of float32."""

FEWEST_SAMPLES = 64
"""Shortest record for which a spectrum is computed."""

# --- the catalogue


def catalogue(feature_set: SetName = "complete") -> tuple[dict[str, str], ...]:
    """The catalogue as text.

    Parameters
    ----------
    feature_set : {"standard", "core", "complete"}
        Rows to return.

    Returns
    -------
    tuple of dict
        ``name``, ``unit``, ``needs``, ``scope``, ``set`` (the smallest one that has it) and
        ``reference`` of every feature, in the order of the row.

    Raises
    ------
    ValueError
        If there is no such set.

    Examples
    --------
    >>> row = catalogue()[0]
    >>> row["name"], row["unit"], row["needs"], row["set"]
    ('rms', 'x', 'vibration', 'standard')
    """
    return tuple(
        {
            "name": row.name,
            "unit": row.unit,
            "needs": ", ".join(NEEDS[need].text for need in row.needs) or "vibration",
            "scope": row.scope,
            "set": smallest_set(row),
            "reference": row.reference,
        }
        for row in _rows_of(feature_set)
    )


def _rows_of(feature_set: SetName) -> tuple[Feature, ...]:
    if feature_set not in SETS:
        raise ValueError(f"feature_set = {feature_set!r} must be one of {', '.join(SETS)}")
    return SETS[feature_set]


# --- which features a recording has


@dataclass(frozen=True, kw_only=True)
class _Plan:
    """Features to compute, and the values of them to keep."""

    features: tuple[Feature, ...]
    names: tuple[str, ...]
    picks: tuple[NDArray[np.intp] | None, ...]  # for each feature; None for all


def feature_names(
    channel_names: Sequence[str],
    fs: float,
    *,
    tacho: bool = True,
    pulses_per_revolution: int = 1,
    quantities: Sequence[str] | None = None,
    n_samples: int | None = None,
    impact: bool = False,
    settings: Settings = STANDARD,
    feature_set: SetName = "standard",
    only: Sequence[str] | None = None,
) -> tuple[str, ...]:
    """Names of the values of `feature_row`, without a recording.

    Parameters
    ----------
    channel_names : sequence of str
        Names of the vibration channels, unique.
    fs : float
        Sample rate [Hz]; it determines the bands, whose edges are part of the name.
    tacho : bool
        Whether there is a tacho.
    pulses_per_revolution : int
        Pulses of the tacho in one revolution.
    quantities : sequence of str, optional
        Quantity of every channel; all ``acceleration`` by default.
    n_samples : int, optional
        Length of the record; by default long enough for every feature.
    impact : bool
        Whether the force is that of a hammer; its blocks follow the record, however short.
    settings : Settings
        Bands, bins and orders.
    feature_set : {"standard", "core", "complete"}
        As in `feature_row`.
    only : sequence of str, optional
        As in `feature_row`.

    Returns
    -------
    tuple of str
        ``channel.label``, ``first_over_second.label``, ``shaft.label``, ``orbit.label``,
        ``frf.label``, and with several forces ``response_per_force.label``; pressures come last.

    Raises
    ------
    ValueError
        If a channel name is empty or repeated, the numbers of names and quantities differ, a band
        does not fit below fs / 2, or as for `feature_row` regarding `feature_set` and `only`.

    Examples
    --------
    >>> names = feature_names(["acc_x"], 25_600.0)
    >>> names[0], names[8], names[18 + 20]
    ('acc_x.rms', 'acc_x.band_50_66.level_db', 'acc_x.angle_000_010.band_150_250.level_db')
    >>> feature_names(["acc_x"], 25_600.0, only=["velocity_rms", "acc_x.order_02.level_db"])
    ('acc_x.order_02.level_db', 'acc_x.velocity_rms')
    """
    check_rate(fs)
    layout = Layout(
        channels=tuple(channel_names),
        quantities=_quantities(quantities, len(channel_names)),
        fs=float(fs),
        tacho=tacho,
        pulses_per_revolution=pulses_per_revolution,
        n_samples=n_samples,
        impact=impact,
        settings=settings,
    )
    return layout_names(layout, feature_set, only)


def layout_names(
    layout: Layout, feature_set: SetName = "complete", only: Sequence[str] | None = None
) -> tuple[str, ...]:
    """As :func:`feature_names`, for a recording's layout."""
    return _plan(layout, feature_set, _wanted(only)).names


def absent_features(layout: Layout, feature_set: SetName = "complete") -> dict[str, str]:
    """Features of a set that a recording cannot have, with the reasons.

    Parameters
    ----------
    layout : Layout
        Properties of the recording.
    feature_set : {"standard", "core", "complete"}
        Rows to consider.

    Returns
    -------
    dict
        Every unmet requirement with its bound and cure, by feature name.

    Raises
    ------
    ValueError
        If there is no such set, or no such kind of machine.

    Examples
    --------
    >>> plain = Layout(channels=("a",), quantities=("acceleration",), fs=25_600.0)
    >>> absent_features(plain)["speed"]
    'tacho = none must be there; record one'
    """
    return {
        row.name: fault
        for row in _rows_of(feature_set)
        for fault in [shortcomings(row.needs, layout)]
        if fault
    }


def _quantities(given: Sequence[str] | None, n_channels: int) -> tuple[str, ...]:
    if given is None:
        return (ACCELERATION,) * n_channels
    if len(given) != n_channels:
        raise ValueError(
            f"quantities has {len(given)} entries, must have {n_channels}; give one of each channel"
        )
    return tuple(given)


@lru_cache(maxsize=64)
def _plan(layout: Layout, feature_set: SetName, only: tuple[str, ...] | None) -> _Plan:
    _check_channels(layout.channels)
    rows = _rows_of(feature_set)
    if only is not None:
        return _chosen(layout, only)
    features = tuple(row for row in rows if not shortcomings(row.needs, layout))
    names = tuple(name for row in features for name in _names_of(row, layout))
    if len(set(names)) < len(names):
        raise ValueError(
            f"fs = {layout.fs} Hz makes {len(names) - len(set(names))} feature names equal, must "
            "be 0: bands or bins are equal, or closer than 1 Hz or 1 deg; leave some out"
        )
    return _Plan(features=features, names=names, picks=(None,) * len(features))


def _check_channels(channels: tuple[str, ...]) -> None:
    if not channels or not all(channels) or len(set(channels)) < len(channels):
        raise ValueError(f"channel_names = {list(channels)} must be non-empty and unique; rename")


def _names_of(row: Feature, layout: Layout) -> tuple[str, ...]:
    """Names of all values of a feature."""
    labels = row.labels_for(layout.settings, layout.fs)
    return tuple(f"{owner}.{label}" for owner in _owners(row.scope, layout) for label in labels)


def _owners(scope: Scope, layout: Layout) -> tuple[str, ...]:
    """Names of the channels, pairs, paths or other objects that a feature exists for."""
    channels = layout.vibrations
    forces = [channels[i] for i in layout.rows_of(FORCE)]
    responses = [name for name in channels if name not in forces]
    owners: Mapping[Scope, tuple[str, ...]] = {
        "channel": channels,
        "housing": tuple(channels[i] for i in layout.rows_of(ACCELERATION)),
        "path": tuple(
            name if len(forces) == 1 else f"{name}_per_{force}"
            for name in responses
            for force in forces
        ),
        "pair": tuple(f"{a}_over_{b}" for a, b in combinations(channels, 2)),
        "cylinder": layout.pressures,
    }
    return owners.get(scope, (scope,))


def _chosen(layout: Layout, only: tuple[str, ...]) -> _Plan:
    """Features and single values by name, in the order of the catalogue."""
    rows = {row.name: row for row in SETS[_LARGEST]}
    faults = {name: shortcomings(row.needs, layout) for name, row in rows.items()}
    names = {name: _names_of(row, layout) for name, row in rows.items() if not faults[name]}
    known = {value for values in names.values() for value in values}
    _check_wanted(only, faults, known)
    kept = {}
    for name, values in names.items():
        picks = [i for i, value in enumerate(values) if name in only or value in only]
        if picks:
            kept[name] = np.array(picks, dtype=np.intp)
    return _Plan(
        features=tuple(rows[name] for name in kept),
        names=tuple(names[name][i] for name, picks in kept.items() for i in picks),
        picks=tuple(picks if len(picks) < len(names[n]) else None for n, picks in kept.items()),
    )


def _wanted(only: Sequence[str] | None) -> tuple[str, ...] | None:
    if isinstance(only, str):
        raise ValueError(f"only = {only!r} must be a list of names; put it into brackets")
    return None if only is None else tuple(only)


def _check_wanted(only: tuple[str, ...], faults: Mapping[str, str], known: set[str]) -> None:
    """Refuse names that do not exist or are not available for this recording; all at once."""
    complaints = [
        f"feature {name} is not available: {faults[name]}" for name in only if faults.get(name)
    ]
    for name in only:
        if name not in faults and name not in known:
            near = difflib.get_close_matches(name, [*faults, *sorted(known)], n=1)
            hint = f"did you mean {near[0]}?" if near else "see wearstate features --list"
            complaints.append(f"feature {name!r} is unknown; {hint}")
    if not only:
        complaints.append("only = () must name one feature or more; name some, or leave it out")
    if complaints:
        raise ValueError("\n".join(complaints))


_LARGEST: SetName = get_args(SetName)[-1]


# --- the row


@runtime_checkable
class Recorded(Protocol):
    """A recording that knows its rate, channels and tacho."""

    @property
    def vibration(self) -> NDArray[np.float32]:
        """All channels but the tacho [shape=(n_channels, n_samples)]."""

    @property
    def vibration_names(self) -> tuple[str, ...]:
        """Name of each channel."""

    @property
    def vibration_quantities(self) -> tuple[str, ...]:
        """Quantity of each channel."""

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of every channel, by name."""

    @property
    def sample_rate(self) -> float:
        """Sample rate [Hz]."""

    @property
    def tacho_signal(self) -> NDArray[np.float32] | None:
        """Pulses; None without a tacho."""

    @property
    def pulses_per_revolution(self) -> int:
        """Pulses of the tacho in one revolution."""


def feature_row(
    vibration: Recorded | ArrayLike | pd.DataFrame,
    fs: float | None = None,
    *,
    tacho: ArrayLike | None = None,
    pulses_per_revolution: int = 1,
    channel_names: Sequence[str] | None = None,
    quantities: Sequence[str] | None = None,
    settings: Settings = STANDARD,
    feature_set: SetName = "standard",
    only: Sequence[str] | None = None,
) -> tuple[tuple[str, ...], Float]:
    """Features of one recording.

    Parameters
    ----------
    vibration : Recording, array_like of shape (n_channels, n_samples) or (n_samples,), or DataFrame
        Accelerations [m/s^2, or one other unit for all channels], displacements with their mean
        [m]. float32 stays float32 in the transforms. For a recording, `fs` to `quantities` are its
        own; a table has samples down its rows, and its columns name the channels.
    fs : float, optional
        Sample rate of an array or a table [Hz].
    tacho : array_like, shape (n_samples,), optional
        Pulses [V], whose rising edge is angle 0; without it the features that need it are absent.
    pulses_per_revolution : int
        Pulses in one revolution. Above 1, angle 0 is at any one of them, and crank angles of two
        records are not comparable.
    channel_names : sequence of str, optional
        Names of the channels; ``ch_0``, ``ch_1``, … by default.
    quantities : sequence of str, optional
        Quantity of every channel; all ``acceleration`` by default. With exactly two of
        ``displacement`` the features of their orbit are added, with one or more of ``force`` those
        of the transfer functions from them. A ``pressure`` next to another quantity, with a tacho
        of one pulse, is a cylinder pressure: it has only features of its own.
    settings : Settings
        Bands, bins and orders; the kind of machine, the geometry of a bearing.
    feature_set : {"standard", "core", "complete"}
        Default for training; all but kurtogram, cyclic coherence and modal fit; everything.
        Features whose requirements are not met are absent; `absent_features` gives the reasons.
    only : sequence of str, optional
        Names of features, or of single values, from any set; nothing else is computed. An unmet
        requirement is then an error.

    Returns
    -------
    names : tuple of str
        As `feature_names`.
    values : ndarray, shape (n_features,)
        Values in the order of the names, float64; finite, except that coherence and random error of
        a single blow are NaN. A constant channel (dead sensor) has rms, frequencies, scores and
        ratios 0, levels of -200 dB, spectral kurtosis and kurtogram -1, and as their positions the
        lowest line and the whole band.

    Raises
    ------
    ValueError
        If a sample is not finite or exceeds 1e9, the record is shorter than 64 samples or (with a
        tacho) one revolution, the lengths or the number of names disagree, `only` names a feature
        that does not exist or is not available, or as for `pulse_times` and `shaft_phase`. All
        faults of the vibration are named at once.

    Notes
    -----
    Valid for stationary running. See `order.crank_angle_map` for the speeds at which the angle bins
    are resolved. A bearing's score is 0 if the record cannot show its line: the frequency is too
    low for the duration, or beyond the band. If no harmonics stand out, `tacholess_speed` is 0 and
    its flag ``found`` 0; missing modes have frequency 0.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.sin(2 * np.pi * 1000 * np.arange(25_600) / 25_600)
    >>> names, values = feature_row(wave, 25_600.0, channel_names=["acc_x"])
    >>> row = dict(zip(names, values.round(2).tolist()))
    >>> row["acc_x.kurtosis"], row["acc_x.band_995_1306.level_db"]
    (1.5, -3.01)
    >>> feature_row(wave, 25_600.0, only=["strongest_tone"])[1].round(2).tolist()
    [1000.0, -3.01]
    """
    if isinstance(vibration, Recorded):
        arguments = {
            "fs": fs,
            "tacho": tacho,
            "channel_names": channel_names,
            "quantities": quantities,
        }
        if given := [name for name, value in arguments.items() if value is not None]:
            raise ValueError(f"{', '.join(given)} must be left out; the recording has its own")
        return feature_row(
            vibration.vibration,
            vibration.sample_rate,
            tacho=vibration.tacho_signal,
            pulses_per_revolution=vibration.pulses_per_revolution,
            channel_names=vibration.vibration_names,
            quantities=vibration.vibration_quantities,
            settings=settings,
            feature_set=feature_set,
            only=only,
        )
    signals, channels, fs = array_signals(vibration, fs, channel_names)
    if not np.issubdtype(signals.dtype, np.floating) or signals.dtype == np.float16:
        signals = signals.astype(np.float64)
    _check_vibration(signals, channels)
    layout = Layout(
        channels=channels,
        quantities=_quantities(quantities, len(signals)),
        fs=fs,
        tacho=tacho is not None,
        pulses_per_revolution=pulses_per_revolution,
        n_samples=signals.shape[-1],
        settings=_planned(settings),
    )
    aside = layout.cylinders
    pressures, signals = signals[aside], signals[~aside] if aside.any() else signals
    layout = replace(layout, impact=struck(signals, layout.kinds))
    plan = _plan(layout, feature_set, _wanted(only))
    pulses = None
    if tacho is not None and any(_turns(feature) for feature in plan.features):
        pulses = _pulses(tacho, fs, signals.shape[-1])
    analysis = Analysis(
        signals,
        fs,
        pulses=pulses,
        pulses_per_revolution=pulses_per_revolution,
        probes=layout.probes,
        quantities=layout.kinds,
        pressures=pressures,
        settings=settings,
    )
    return plan.names, _values(plan, analysis)


def _planned(settings: Settings) -> Settings:
    """Settings for planning names: they depend only on whether there is a reference, with modes."""
    known = settings.reference
    if known is None:
        return settings
    return replace(settings, reference=_ANY_MODES if known.modes is not None else _ANY)


_LINE = np.ones(1)
_ANY = FrfReference(_LINE, _LINE[np.newaxis].astype(np.complex128))
_ANY_MODES = replace(
    _ANY,
    modes=Modes(
        frequency=_LINE,
        damping_ratio=_LINE,
        residue=_ANY.value,
        lower=_ANY.value[0],
        upper=_ANY.value[0],
        quantity="receptance",
        frequency_deviation=_LINE,
        damping_deviation=_LINE,
        residue_deviation=_LINE[np.newaxis],
        fit_error=_LINE,
    ),
)


def _turns(feature: Feature) -> bool:
    """Whether a feature reads the tacho's pulses."""
    return not {"tacho", "speed"}.isdisjoint((*feature.needs, *feature.uses))


def _values(plan: _Plan, analysis: Analysis) -> Float:
    parts = []
    for feature, picks in zip(plan.features, plan.picks, strict=True):
        values = np.ravel(feature.function(analysis))
        parts.append(values if picks is None else values[picks])
    return np.concatenate(parts, dtype=np.float64)


def array_signals(
    data: ArrayLike | pd.DataFrame, fs: float | None, channel_names: Sequence[str] | None
) -> tuple[NDArray[Any], tuple[str, ...], float]:
    """Signals [shape=(n_channels, n_samples)] of an array or a table, their names and rate [Hz]."""
    if fs is None:
        raise ValueError("fs = None must be given with an array; give the sample rate in Hz")
    check_rate(fs)
    if isinstance(data, pd.DataFrame):
        channel_names = channel_names or [str(name) for name in data.columns]
        data = data.to_numpy().T
    signals = np.atleast_2d(np.asarray(data))
    numbered = (f"ch_{i}" for i in range(len(signals)))
    names = tuple(numbered if channel_names is None else channel_names)
    if len(names) != len(signals):
        raise ValueError(
            f"channel_names has {len(names)} names, must have {len(signals)}; name every channel"
        )
    return signals, names, float(fs)


def _pulses(tacho: ArrayLike, fs: float, n_samples: int) -> Float:
    volts = np.asarray(tacho)
    if volts.shape != (n_samples,):
        raise ValueError(
            f"tacho has shape {volts.shape}, must be ({n_samples},) as the vibration; use one clock"
        )
    return order.pulse_times(volts, fs)


def _check_vibration(signals: Real, channels: tuple[str, ...]) -> None:
    if signals.ndim != 2 or signals.shape[-1] < FEWEST_SAMPLES:
        raise ValueError(
            f"vibration has shape {signals.shape}, must be (n_channels, n_samples >= "
            f"{FEWEST_SAMPLES}); give a longer record"
        )
    # One pass for the usual, faultless record: NaN and infinity survive max and min.
    highest, lowest = signals.max(axis=-1), signals.min(axis=-1)
    sound = (highest <= LARGEST_SAMPLE) & (lowest >= -LARGEST_SAMPLE)
    faults = [_fault(signals[i], channels[i]) for i in np.flatnonzero(~sound)]
    if faults:
        raise ValueError("; ".join(faults))


def _fault(signal: Real, channel: str) -> str:
    wrong = np.flatnonzero(~np.isfinite(signal))
    if wrong.size:
        return (
            f"{channel} has {wrong.size} non-finite samples, the first at {wrong[0]}, must have 0; "
            "cut or repair the recording"
        )
    large = np.flatnonzero(np.abs(signal) > LARGEST_SAMPLE)
    return (
        f"{channel} has {large.size} samples beyond {LARGEST_SAMPLE:g}, the first at {large[0]}, "
        "must have 0; check the scale of the recording"
    )
