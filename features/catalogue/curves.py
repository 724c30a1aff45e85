"""Spectra and orbits of a recording as objects that can be read by channel and plotted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from ..response.transfer import Transfer, measured_transfer
from ..rotation.angle_resample import Window
from ..rotation.angle_resample import order_spectrum as order_lines
from ..rotation.orbit import PROBE_ANGLES, displacement, keyphasor_marks
from ..rotation.order import pulse_times
from ..signal.envelope import Band, Kind
from ..signal.envelope import envelope_spectrum as envelope_lines
from ..signal.spectrum import amplitude_spectrum
from .analysis import DISPLACEMENT, FORCE, Analysis
from .row import Recorded, array_signals

Float = NDArray[np.float64]
Data = Recorded | ArrayLike | pd.DataFrame
"""A recording, or signals of shape (n_channels, n_samples) or (n_samples,), or a table of them."""

_WIDTH, _HEIGHT = 8.0, 1.6  # of one axes [inch]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Spectrum:
    """Amplitudes of every channel over frequency or order.

    Attributes
    ----------
    kind : str
        Name for titles.
    lines : ndarray, shape (n_lines,)
        Frequencies [Hz] or orders [-].
    value : ndarray, shape (n_channels, n_lines)
        Peak amplitude in `units`; complex with the phase over order.
    names, units : tuple of str
        One for each channel.
    axis : str
        Name and unit of `lines`.

    Examples
    --------
    >>> found = spectrum(np.sin(np.pi * np.arange(64) / 4), 64.0)
    >>> found, round(float(found["ch_0"][8]), 6)
    (<Spectrum amplitude spectrum, 33 lines to 32 Hz, ch_0>, 1.0)
    """

    kind: str
    lines: Float
    value: NDArray[Any]
    names: tuple[str, ...]
    units: tuple[str, ...]
    axis: str = "frequency [Hz]"

    @property
    def amplitude(self) -> NDArray[Any]:
        """Magnitude of `value` [shape=(n_channels, n_lines)]."""
        return np.asarray(np.abs(self.value))

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Amplitude of a channel [shape=(n_lines,)]; a KeyError lists the channels."""
        if name not in self.names:
            raise KeyError(f"channel {name!r} must be one of {', '.join(self.names)}")
        row: NDArray[Any] = self.amplitude[self.names.index(name)]
        return row

    def plot(self, *, ax: Any = None, high: float | None = None) -> Any:
        """Draw every channel in axes of its own, one below the other.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            One for each channel; a new figure by default.
        high : float, optional
            Last frequency or order shown; all by default.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (n_channels,)
            The axes, for further drawing or for saving through their ``figure``.

        Examples
        --------
        >>> spectrum(np.sin(np.arange(64.0)), 64.0).plot(high=20.0)[0].get_xlabel()
        'frequency [Hz]'
        """
        axes = _axes(len(self.names), ax)
        shown = slice(None) if high is None else slice(0, int(np.sum(self.lines <= high)))
        for each, name, unit, row in zip(axes, self.names, self.units, self.amplitude, strict=True):
            each.plot(self.lines[shown], row[shown], lw=0.7)
            each.set_ylabel(f"{name} [{unit}]" if unit else name)
            each.set_ylim(bottom=0)
            each.margins(x=0)
            each.grid(alpha=0.3)
        axes[0].set_title(self.kind)
        axes[-1].set_xlabel(self.axis)
        return axes

    def __repr__(self) -> str:
        unit = " Hz" if "Hz" in self.axis else ""
        last = f"{self.lines[-1]:.6g}{unit}" if len(self.lines) else "none"
        return f"<Spectrum {self.kind}, {len(self.lines)} lines to {last}, {' '.join(self.names)}>"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Orbit:
    """Path of a shaft between two proximity probes.

    Attributes
    ----------
    path : ndarray, shape (n_samples,)
        ``x + j y`` with its mean [unit of the probes].
    sample_rate : float
        Sample rate [Hz].
    unit : str
        Unit of the path; empty if unknown.
    marks : ndarray, shape (n_pulses,)
        Position of the shaft at each tacho pulse; empty without a tacho.

    Examples
    --------
    >>> t = np.arange(256) / 256
    >>> found = orbit([np.cos(20 * t), np.sin(20 * t)], 256.0)
    >>> found, round(float(abs(found.path[0])), 6)
    (<Orbit 1 s, 256 Hz, 0 tacho pulses>, 1.0)
    """

    path: NDArray[np.complex128]
    sample_rate: float
    unit: str
    marks: NDArray[np.complex128]

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the path with equal scales, and a dot at each tacho pulse.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw into; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
            The axes, for further drawing or for saving through their ``figure``.

        Examples
        --------
        >>> turning = np.exp(0.1j * np.arange(200.0))
        >>> orbit([turning.real, turning.imag], 1000.0).plot().get_aspect()
        1.0
        """
        if ax is None:
            from matplotlib import pyplot as plt

            _, ax = plt.subplots(figsize=(5.0, 5.0), layout="constrained")
        ax.plot(self.path.real, self.path.imag, lw=0.6)
        ax.plot(self.marks.real, self.marks.imag, ".", color="black", ms=5)
        ax.set_aspect("equal")
        ax.set_xlabel(f"x [{self.unit}]" if self.unit else "x")
        ax.set_ylabel(f"y [{self.unit}]" if self.unit else "y")
        ax.grid(alpha=0.3)
        return ax

    def __repr__(self) -> str:
        seconds = len(self.path) / self.sample_rate
        return f"<Orbit {seconds:.4g} s, {self.sample_rate:.6g} Hz, {len(self.marks)} tacho pulses>"


def spectrum(
    data: Data,
    fs: float | None = None,
    *,
    channel_names: Sequence[str] | None = None,
    nperseg: int | None = None,
) -> Spectrum:
    """Amplitude spectrum of every channel but the tacho.

    Parameters
    ----------
    data : Recording, array_like of shape (n_channels, n_samples) or (n_samples,), or DataFrame
        Signals; a table has samples down its rows.
    fs : float, optional
        Sample rate of an array or a table [Hz].
    channel_names : sequence of str, optional
        Names of the rows of an array; ``ch_0``, ``ch_1``, … by default.
    nperseg : int, optional
        Samples in a segment, even; the whole record by default.

    Returns
    -------
    Spectrum
        Peak amplitudes over frequency.

    Raises
    ------
    ValueError
        If rate and names are missing or given twice, or as for
        :func:`wearstate.features.signal.spectrum.amplitude_spectrum`.

    Examples
    --------
    >>> t = np.arange(4096) / 4096
    >>> found = spectrum(3 * np.sin(2 * np.pi * 100 * t), 4096.0)
    >>> float(found.lines[found["ch_0"].argmax()]), round(float(found["ch_0"].max()), 6)
    (100.0, 3.0)
    """
    given = _read(data, fs, channel_names)
    lines, amplitude = amplitude_spectrum(given.signals, given.fs, nperseg=nperseg)
    return Spectrum(
        kind="amplitude spectrum",
        lines=lines,
        value=amplitude,
        names=given.names,
        units=given.units,
    )


def envelope_spectrum(
    data: Data,
    fs: float | None = None,
    *,
    channel_names: Sequence[str] | None = None,
    band: Band | None = None,
    kind: Kind = "squared",
) -> Spectrum:
    """Amplitude spectrum of the envelope of a band, of every channel but the tacho.

    Parameters
    ----------
    data : Recording, array_like of shape (n_channels, n_samples) or (n_samples,), or DataFrame
        Signals; a table has samples down its rows.
    fs : float, optional
        Sample rate of an array or a table [Hz].
    channel_names : sequence of str, optional
        Names of the rows of an array; ``ch_0``, ``ch_1``, … by default.
    band : tuple of float, optional
        Lower and upper edge [Hz]; 0 to fs / 2 by default.
    kind : {"squared", "plain", "log"}
        Form of the envelope that is transformed.

    Returns
    -------
    Spectrum
        Peak amplitudes over frequency, from 0 to the width of the band.

    Raises
    ------
    ValueError
        If rate and names are missing or given twice, or as for
        :func:`wearstate.features.signal.envelope.envelope_spectrum`.

    Examples
    --------
    >>> t = np.arange(2000) / 2000
    >>> beat = 3 * (1 + 0.5 * np.cos(2 * np.pi * 7 * t)) * np.cos(2 * np.pi * 400 * t)
    >>> found = envelope_spectrum(beat, 2000.0, band=(350.0, 450.0))
    >>> float(found.lines[found["ch_0"].argmax()]), found.kind
    (7.0, 'squared envelope spectrum')
    """
    given = _read(data, fs, channel_names)
    lines, amplitude = envelope_lines(given.signals, given.fs, band, kind=kind)
    units = {"squared": "({})²", "plain": "{}", "log": ""}[kind]
    return Spectrum(
        kind=f"{kind} envelope spectrum",
        lines=lines,
        value=amplitude,
        names=given.names,
        units=tuple(units.format(unit) if unit else "" for unit in given.units),
    )


def order_spectrum(
    data: Data,
    fs: float | None = None,
    *,
    tacho: ArrayLike | None = None,
    pulses_per_revolution: int = 1,
    channel_names: Sequence[str] | None = None,
    window: Window = "hann",
) -> Spectrum:
    """Amplitude and phase over shaft order, of every channel but the tacho.

    Parameters
    ----------
    data : Recording, array_like of shape (n_channels, n_samples) or (n_samples,), or DataFrame
        Signals; a table has samples down its rows.
    fs : float, optional
        Sample rate of an array or a table [Hz].
    tacho : array_like, shape (n_samples,), optional
        Pulses that go with an array or a table [V].
    pulses_per_revolution : int
        Pulses of `tacho` in one revolution.
    channel_names : sequence of str, optional
        Names of the rows of an array; ``ch_0``, ``ch_1``, … by default.
    window : {"boxcar", "hann", "flattop"}
        As in :func:`wearstate.features.rotation.angle_resample.order_spectrum`.

    Returns
    -------
    Spectrum
        Complex amplitudes over order; phases count from the pulse.

    Raises
    ------
    ValueError
        If there is no tacho, rate and names are missing or given twice, or the record is shorter
        than a revolution.

    Examples
    --------
    >>> t = np.arange(8192) / 4096
    >>> wave, pulses = np.cos(2 * np.pi * 40 * t), (20 * t % 1 < 0.1) * 5.0
    >>> found = order_spectrum(wave, 4096.0, tacho=pulses)
    >>> float(found.lines[found["ch_0"].argmax()]), round(float(found["ch_0"].max()), 2)
    (2.0, 1.0)
    """
    given = _read(data, fs, channel_names, tacho, pulses_per_revolution)
    if given.tacho is None:
        raise ValueError("tacho = none must be there for orders; record one, or give tacho=")
    analysis = Analysis(
        given.signals,
        given.fs,
        pulses=pulse_times(given.tacho, given.fs),
        pulses_per_revolution=given.pulses_per_revolution,
    )
    lines, vector = order_lines(analysis.angle, window=window)
    return Spectrum(
        kind="order spectrum",
        lines=lines,
        value=vector,
        names=given.names,
        units=given.units,
        axis="order [-]",
    )


def frf(recording: Recorded, *, nperseg: int | None = None) -> Transfer:
    """Transfer functions from every force of a recording to every other channel.

    Parameters
    ----------
    recording : Recording
        Test with a shaker or hammer: one force channel [N] or more, and responses.
    nperseg : int, optional
        Samples in a window; by default as for the features.

    Returns
    -------
    Transfer
        H1 with coherence, the paths by name.

    Raises
    ------
    ValueError
        If there is no force or no response, or as for
        :func:`wearstate.features.response.transfer.measured_transfer`.

    Examples
    --------
    >>> import wearstate
    >>> push = np.random.default_rng(0).standard_normal(8192)
    >>> test = wearstate.Recording.from_array(
    ...     [push, 2 * push], 1024.0, ["push", "acc"], unit={"push": "N", "acc": "m/s^2"}
    ... )
    >>> found = frf(test)
    >>> found.paths, found.value[0, 9].real.round(6).item()
    (('acc / push',), 2.0)
    """
    given = _read(recording, None, None)
    forces = [i for i, quantity in enumerate(given.quantities) if quantity == FORCE]
    others = [i for i in range(len(given.names)) if i not in forces]
    if nperseg is None or not forces or not others:
        found = Analysis(given.signals, given.fs, quantities=given.quantities).transfer_functions
    else:
        signals = given.signals - given.signals.mean(axis=-1, keepdims=True)
        found = measured_transfer(signals[forces], signals[others], given.fs, nperseg=nperseg)
    return replace(
        found,
        paths=tuple(f"{given.names[i]} / {given.names[k]}" for i in others for k in forces),
        units=tuple(f"{given.units[i]}/N" for i in others for _ in forces),
    )


def orbit(
    data: Data,
    fs: float | None = None,
    *,
    tacho: ArrayLike | None = None,
    angles: tuple[float, float] = PROBE_ANGLES,
) -> Orbit:
    """Path of the shaft between two proximity probes.

    Parameters
    ----------
    data : Recording, array_like of shape (2, n_samples), or DataFrame
        Readings of the probes; for a recording, its two displacement channels.
    fs : float, optional
        Sample rate of an array or a table [Hz].
    tacho : array_like, shape (n_samples,), optional
        Pulses that go with an array or a table [V].
    angles : tuple of float
        Directions of the probes, from the x axis in the direction of rotation [rad].

    Returns
    -------
    Orbit
        Path and tacho marks.

    Raises
    ------
    ValueError
        If there are not two probes, rate is missing or given twice, or as for
        :func:`wearstate.features.rotation.orbit.displacement`.

    Examples
    --------
    >>> turning = np.exp(0.1j * np.arange(200.0))
    >>> orbit([turning.real, turning.imag], 1000.0)
    <Orbit 0.2 s, 1000 Hz, 0 tacho pulses>
    """
    given = _read(data, fs, None, tacho)
    quantities = given.quantities
    if not given.from_recording:  # all rows of an array are probes
        quantities = (DISPLACEMENT,) * len(given.signals)
    rows = [i for i, quantity in enumerate(quantities) if quantity == DISPLACEMENT]
    if len(rows) != 2:
        raise ValueError(f"n_probes = {len(rows)} must be 2; give the displacements of one bearing")
    path = displacement(given.signals[rows[0]], given.signals[rows[1]], angles=angles)
    marks = np.empty(0, dtype=np.complex128)
    if given.tacho is not None:
        marks = keyphasor_marks(path, given.fs, pulse_times(given.tacho, given.fs))
    return Orbit(path=path, sample_rate=given.fs, unit=given.units[rows[0]], marks=marks)


@dataclass(frozen=True, kw_only=True)
class _Given:
    """Signals with their known properties, from a recording or as given by the caller."""

    signals: NDArray[Any]
    fs: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    quantities: tuple[str, ...]
    tacho: NDArray[Any] | None = None
    pulses_per_revolution: int = 1
    from_recording: bool = False


def _read(
    data: Data,
    fs: float | None,
    channel_names: Sequence[str] | None,
    tacho: ArrayLike | None = None,
    pulses_per_revolution: int = 1,
) -> _Given:
    if isinstance(data, Recorded):
        arguments = {"fs": fs, "tacho": tacho, "channel_names": channel_names}
        if given := [name for name, value in arguments.items() if value is not None]:
            raise ValueError(f"{', '.join(given)} must be left out; the recording has its own")
        return _Given(
            signals=data.vibration,
            fs=data.sample_rate,
            names=tuple(data.vibration_names),
            units=tuple(data.units[name] for name in data.vibration_names),
            quantities=tuple(data.vibration_quantities),
            tacho=data.tacho_signal,
            pulses_per_revolution=data.pulses_per_revolution,
            from_recording=True,
        )
    if isinstance(data, (str, Path)):
        raise ValueError(
            f"data = '{data}' must be a recording, an array or a table; read a file with "
            "wearstate.read_recording"
        )
    signals, names, fs = array_signals(data, fs, channel_names)
    _refuse_gaps(signals, names)
    if tacho is not None:
        _refuse_gaps(np.atleast_2d(np.asarray(tacho)), ("tacho",))
    return _Given(
        signals=signals,
        fs=fs,
        names=names,
        units=("",) * len(names),
        quantities=("",) * len(names),
        tacho=None if tacho is None else np.asarray(tacho),
        pulses_per_revolution=pulses_per_revolution,
    )


def _refuse_gaps(signals: NDArray[Any], names: Sequence[str]) -> None:
    """Refuse non-finite samples: one spoils every line of a transform."""
    faults = []
    for name, row in zip(names, signals, strict=True):
        bad = np.flatnonzero(~np.isfinite(row))
        if bad.size:
            faults.append(
                f"channel {name} has {bad.size} sample(s) that are not finite, must be 0, first at "
                f"index {bad[0]}; cut or repair the gap"
            )
    if faults:
        raise ValueError("\n".join(faults))


def _axes(n: int, given: Any) -> Any:
    """The given axes, or new ones below each other."""
    if given is None:
        from matplotlib import pyplot as plt

        _, given = plt.subplots(
            n, squeeze=False, sharex=True, figsize=(_WIDTH, 1.2 + _HEIGHT * n), layout="constrained"
        )
    return np.ravel(given)
