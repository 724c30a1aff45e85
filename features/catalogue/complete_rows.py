"""Rows that the complete set adds to the core one: the slowest to compute."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..response import response_change, transfer
from ..signal.spectrum import decibel
from .analysis import Analysis, Settings
from .feature import EWINS, ROLLING_BEARING, Feature, fault_labels, scores, stacked

Float = NDArray[np.float64]


def _kurtogram(analysis: Analysis) -> Float:
    return np.array([(k.centre, k.bandwidth, k.highest, k.score) for k in analysis.kurtograms])


def _mode_labels(*parts: str) -> Callable[[Settings, float], tuple[str, ...]]:
    """One label for every part of every mode."""
    return lambda settings, _fs: tuple(
        f"mode_{k}.{part}" for k in range(1, settings.n_modes + 1) for part in parts
    )


def _of_modes(*parts: str) -> Callable[[Analysis], Float]:
    """Parts of the modes in order of frequency; zeros if there are fewer."""

    def values(analysis: Analysis) -> Float:
        table = np.zeros((analysis.settings.n_modes, len(parts)))
        found = analysis.modes
        if found is not None:
            table[: found.frequency.size] = stacked(*(getattr(found, part) for part in parts))
        return table

    return values


def _mode_shapes(analysis: Analysis) -> Float:
    """Shape and its standard deviation for every path and mode; zeros if there is none."""
    paths = len(analysis.transfer_functions.value)
    table = np.zeros((paths, analysis.settings.n_modes, 2))
    if analysis.modes is not None:
        shape = stacked(*transfer.mode_shapes(analysis.modes))
        table[analysis.modal_paths, : shape.shape[1]] = shape
    return table


def _static_stiffness(analysis: Analysis) -> Float:
    """Static stiffness, and that of the modes above the band; 200 dB if nothing moves."""
    table = np.full((len(analysis.transfer_functions.value), 2), -decibel(0.0))
    if analysis.modes is not None:
        flexibility = stacked(*transfer.static_flexibility(analysis.modes))
        table[analysis.modal_paths] = -decibel(flexibility**2)
    return table


def _mode_changes(analysis: Analysis) -> Float:
    count = analysis.settings.n_modes
    return transfer.mode_changes(analysis.modes, analysis.reference_modes, count)


def _resonance_shift(analysis: Analysis) -> Float:
    """Mean relative shift of the modes found again, and the share of such modes."""
    known, found = analysis.reference_modes, analysis.modes
    if found is None or found.residue.shape[0] != known.residue.shape[0]:
        return np.zeros(2)  # a dead sensor: no mode is found again
    shift = response_change.resonance_shift(found, known)
    count = len(shift.frequency)
    mean = float(shift.frequency.mean()) if count else 0.0
    return np.array([mean, count / max(known.frequency.size, 1)])


_FIT = "Guillaume et al., IMAC XXI (2003)"

COMPLETE_ROWS: tuple[Feature, ...] = (
    Feature(
        name="kurtogram",
        unit="Hz, Hz, -, -",
        needs=("frames",),
        uses=("tacho",),
        labels=(
            "kurtogram.centre_hz",
            "kurtogram.bandwidth_hz",
            "kurtogram.kurtosis",
            "kurtogram.score",
        ),
        function=_kurtogram,
        reference="kurtogram.kurtogram; Antoni, Mech. Syst. Signal Process. 21 (2007) 108-124",
    ),
    Feature(
        name="kurtogram_bearing_lines",
        unit="-",
        needs=("frames", "bearing", "speed"),
        labels=fault_labels("kurtogram_bearing", "score"),
        function=lambda a: scores(a.kurtogram_fault_lines),
        reference=f"kurtogram.kurtogram, envelope.fault_line; {ROLLING_BEARING}",
    ),
    Feature(
        name="cyclic_coherence",
        unit="-",
        needs=("cycles", "envelope", "bearing", "speed"),
        labels=fault_labels("cyclic", "coherence"),
        function=lambda a: a.cyclic_coherences,
        reference="cyclic_coherence.cyclic_coherence; "
        "Antoni, Mech. Syst. Signal Process. 21 (2007) 597",
    ),
    Feature(
        name="modes",
        unit="Hz, -",
        needs=("force",),
        scope="frf",
        labels=_mode_labels("frequency_hz", "damping_ratio"),
        function=_of_modes("frequency", "damping_ratio"),
        reference=f"modal.modal_fit; {_FIT}",
    ),
    Feature(
        name="mode_deviations",
        unit="Hz, -",
        needs=("force",),
        scope="frf",
        labels=_mode_labels("frequency_deviation_hz", "damping_deviation"),
        function=_of_modes("frequency_deviation", "damping_deviation"),
        reference=f"modal.modal_fit; {_FIT}",
    ),
    Feature(
        name="mode_shapes",
        unit="-",
        needs=("force",),
        scope="path",
        labels=_mode_labels("shape", "shape_deviation"),
        function=_mode_shapes,
        reference=f"transfer.mode_shapes; {EWINS}",
    ),
    Feature(
        name="static_stiffness",
        unit="dB re 1 N/(x in m)",
        needs=("force",),
        scope="path",
        labels=("static.stiffness_db", "static.residual_stiffness_db"),
        function=_static_stiffness,
        reference=f"transfer.static_flexibility; {EWINS}",
    ),
    Feature(
        name="resonance_shift",
        unit="-",
        needs=("force", "reference", "reference modes"),
        scope="frf",
        labels=("resonance_shift.mean", "resonance_shift.found"),
        function=_resonance_shift,
        reference="response_change.resonance_shift",
    ),
    Feature(
        name="mode_changes",
        unit="-, -, -, dB, -",
        needs=("force", "reference", "reference modes"),
        scope="frf",
        labels=_mode_labels(
            "frequency_shift", "shift_deviation", "damping_change", "level_change_db", "mac"
        ),
        function=_mode_changes,
        reference="transfer.mode_changes, response_change.resonance_shift; "
        "Allemang, IMAC I (1982) 110-116",
    ),
)
"""Rows that `complete` adds to `core`: the slowest to compute."""
