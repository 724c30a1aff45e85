"""Mean positions of the shaft that no training machine had."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from .fault import QualityFault

Float = NDArray[np.float64]

_GAP, _RADIUS, _PAIR = "displacement", "centreline.radius_db", 2
_ALONG, _ACROSS = "centreline.x", "centreline.y"
_NO_MEAN = 0.03  # of the vibration's rms: residual mean of a few revolutions
_MARGIN = 0.05  # of the trained width: a machine slightly beyond the extremes of a thousand

_AWAY = (
    "with the opposite sign it would be; gaps grow where the shaft moves away from a probe, a "
    "model reads the motion towards it: multiply them by -1, or check the direction of the load"
)
_ELSEWHERE = "check names, angles and zeros of the probes, and the direction of the load"


def coupling_faults(
    recording: Recording, names: Sequence[str], row: Float, least: Float
) -> tuple[QualityFault, ...]:
    """Find probes whose mean position is lost, though the model uses it.

    Parameters
    ----------
    recording : Recording
    names : sequence of str
        Feature names.
    row : numpy.ndarray [shape=(n_features,)]
    least : numpy.ndarray [shape=(n_features,)]
        Least value of each feature in training.

    Returns
    -------
    tuple of QualityFault
        One if the shaft is nearer the centre than any in training and the mean of every probe is
        negligible against its vibration. A centred journal alone does not cause this, since no
        probe is zeroed that well.

    Examples
    --------
    >>> from wearstate.sim.output.sensor import Channel
    >>> wave = np.sin(np.arange(1000.0)) * 1e-5
    >>> probes = [Channel(name=f"p{i}", unit="m", quantity="displacement") for i in (1, 2)]
    >>> recording = Recording(
    ...     signal=np.stack([wave, wave]), sample_rate=1e3, channels=tuple(probes))
    >>> names, row = ["orbit.centreline.radius_db"], np.array([-150.0])
    >>> coupling_faults(recording, names, row, np.array([-90.0]))[0].text[:36]
    'p1, p2 show no mean position, which '

    A model trained on probes without a mean does not use it:

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


def place_faults(
    recording: Recording, names: Sequence[str], row: Float, least: Float, most: Float
) -> tuple[QualityFault, ...]:
    """Find a shaft that runs in a part of its bearing where none did in training.

    Parameters
    ----------
    recording : Recording
    names : sequence of str
        Feature names.
    row : numpy.ndarray [shape=(n_features,)]
    least, most : numpy.ndarray [shape=(n_features,)]
        Range of each feature in training.

    Returns
    -------
    tuple of QualityFault
        One for each pair of probes whose mean position is outside the trained range by more than
        a twentieth of its width. It bars a verdict if the opposite position is inside: a gap grows
        as the shaft moves away from its probe, and a model expects the motion towards it.

    Examples
    --------
    >>> from wearstate.sim.output.sensor import Channel
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
    beyond = np.maximum(low - place, place - high) > _MARGIN * (high - low)
    return not beyond.any()
