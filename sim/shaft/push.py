"""Effect of shakers and hammers on a running shaft line, added to its other vibration.

The response is linear about the equilibrium on the films, as for every other force.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..excitation.forces import Push, exciter_push, half_sine
from ..scene.exciters import ShaftExciter
from ..scene.shaft import ShaftScene
from ..shaft_response.places import Place
from ..shaft_response.reduced import ReducedRotor
from ..shaft_response.time_response import Transient, time_response

Float = NDArray[np.float64]
_SETTLED = math.log(1e4)
"""Time constants after which a motion from rest has settled to 1e-4."""

_BAND_LINES = 512  # frequencies at which the largest motion within a band is searched
_PEAK = 4.0  # of the rms of a Gaussian motion: exceeded once in 16,000 independent values
_HARDEST = 2.33  # standard deviations of the logarithm of a peak: exceeded by one blow in a hundred
_TAIL = 64  # samples after the recording in which a steady force is faded out
_AXES = {"up": "y", "side": "z"}


def pushed_stations(scene: ShaftScene) -> tuple[float, ...]:
    """Stations of the shaft where an exciter acts [m].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> pushed_stations(load_scene("propulsion-shaft"))
    ()
    """
    places = (_place(scene, part) for part in scene.mounted_exciters if part.part == "shaft")
    return tuple(station for station, _ in places if isinstance(station, float))


def _place(scene: ShaftScene, part: ShaftExciter, axis: str = "") -> tuple[float | str, str]:
    """Station on the shaft, or name of the housing's bearing, and the coordinate."""
    axis = axis or _AXES[part.direction]
    if part.part == "housing":
        return part.place, axis
    if part.station is not None:
        return part.station, axis
    named = {bearing.name: bearing.station for bearing in scene.bearings}
    named |= {disc.name: disc.station for disc in scene.discs}
    return named[part.place], axis


def exciter_places(scene: ShaftScene) -> tuple[Place, ...]:
    """Places of the mounted exciters, as named by transfer functions.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of place
        See :mod:`.shaft_response.places`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> exciter_places(load_scene("shaft-rig", {"exciters.0.force": "20 N"}))
    ((4.0, 'y'),)
    """
    return tuple(exciter_place(scene, part) for part in scene.mounted_exciters)


def exciter_place(scene: ShaftScene, part: ShaftExciter) -> Place:
    """Place of an exciter, mounted or not, as named by transfer functions."""
    return _full(part, _place(scene, part))


def _full(part: ShaftExciter, place: tuple[float | str, str]) -> Place:
    return (*place, "housing") if part.part == "housing" else place


def pushes(scene: ShaftScene, seed: int, lead: int = 0) -> tuple[Push, ...]:
    """Forces of the mounted exciters, from `lead` samples before a recording to some after it."""
    return tuple(
        exciter_push(
            part,
            n_samples=round(scene.duration * scene.sample_rate),
            sample_rate=scene.sample_rate,
            seed=seed,
            index=index,
            lead=lead,
            tail=_TAIL,
        )
        for index, part in enumerate(scene.exciters)
        if part.mounted
    )


def lead_samples(scene: ShaftScene, reduced: ReducedRotor) -> int:
    """Samples in which the slowest motion of a line settles, at most the recording's length."""
    longest = round(scene.duration * scene.sample_rate)
    slowest = -float(reduced.poles.real.max())
    return min(longest, math.ceil(_SETTLED / slowest * scene.sample_rate))


def pushed_motion(
    scene: ShaftScene,
    reduced: ReducedRotor,
    found: Sequence[Push],
    responses: Sequence[tuple[Place, str]],
    *,
    lead: int,
) -> Float:
    """Motion under the forces of all exciters.

    Parameters
    ----------
    scene : ShaftScene
    reduced : ReducedRotor
        Rotor of the scene's state.
    found : sequence of Push
        Result of `pushes`, with the same lead.
    responses : sequence of tuple
        Place and quantity of each response.
    lead : int
        Number of initial samples to omit.

    Returns
    -------
    ndarray, shape (n_resp, n_samples)
        Motion in SI.
    """
    transients = [
        transient
        for part, push in zip(scene.mounted_exciters, found, strict=True)
        for transient in _transients(scene, part, push)
    ]
    n_samples = round(scene.duration * scene.sample_rate)
    return time_response(
        reduced,
        [place for place, _ in responses],
        n_samples=lead + n_samples + _TAIL,
        sample_rate=scene.sample_rate,
        quantity=[quantity for _, quantity in responses],
        transients=transients,
    )[:, lead : lead + n_samples]


def _transients(scene: ShaftScene, part: ShaftExciter, push: Push) -> Iterator[Transient]:
    axis = _AXES[part.direction]
    other = "z" if axis == "y" else "y"
    rows = ((push.along, axis), (push.across, other), (push.moment, f"slope_{axis}"))
    for samples, coordinate in rows:
        if samples.any():
            place = _full(part, _place(scene, part, coordinate))
            yield Transient(samples=samples, forces={place: 1.0})


# --- motion of the journals


def peak_push(scene: ShaftScene, reduced: ReducedRotor, places: Sequence[Place]) -> Float:
    """Largest expected displacements from the exciters, summed.

    Parameters
    ----------
    scene : ShaftScene
    reduced : ReducedRotor
    places : sequence of place
        Pairs of places, of which the motion of the second is subtracted from the first: a journal
        up, its housing up, and so on.

    Returns
    -------
    ndarray, shape (n_places / 2,)
        Four times the rms for a random force, the largest steady amplitude for a sweep or
        stepped sine, the peak after the hardest blow of a hundred and its rebound [m].
    """
    total = np.zeros(len(places) // 2)
    for part, place in zip(scene.mounted_exciters, exciter_places(scene), strict=True):
        if part.kind == "hammer":
            total += _peak_of_blow(scene, reduced, part, place, places)
        else:
            total += _peak_of_shaker(reduced, part, place, places)
    return total


def _peak_of_shaker(
    reduced: ReducedRotor, part: ShaftExciter, place: Place, places: Sequence[Place]
) -> Float:
    hertz = np.linspace(part.low, part.high, _BAND_LINES)
    gain = reduced.receptance(hertz, places, [place])[..., 0]
    size = np.abs(gain[:, ::2] - gain[:, 1::2])
    if part.kind in ("random", "burst-random"):
        return np.asarray(_PEAK * part.force * np.sqrt(np.mean(size**2, axis=0)))
    return np.asarray(math.sqrt(2) * part.force * size.max(axis=0))


def _peak_of_blow(
    scene: ShaftScene,
    reduced: ReducedRotor,
    part: ShaftExciter,
    place: Place,
    places: Sequence[Place],
) -> Float:
    n = lead_samples(scene, reduced)
    n = max(n, math.ceil(4 * part.contact_time * scene.sample_rate), 16)
    peak = part.force * math.exp(_HARDEST * part.peak_scatter)
    blow = peak * half_sine(np.arange(n) / scene.sample_rate, part.contact_time)
    motion = time_response(
        reduced,
        places,
        n_samples=n,
        sample_rate=scene.sample_rate,
        quantity="displacement",
        transients=[Transient(samples=blow, forces={place: 1.0})],
    )
    return np.asarray(np.abs(motion[::2] - motion[1::2]).max(axis=1))
