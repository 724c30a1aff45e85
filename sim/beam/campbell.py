"""Natural frequencies over the speed: Campbell diagram and critical speeds."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg
from scipy.optimize import brentq, linear_sum_assignment

from ..brief import brief
from .beam_matrices import Sparse
from .modes import EQUAL, Vibrations, direction_of, modes
from .rotor import Rotor, RotorLaw

Vector = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MOST_BISECTIONS = 12  # of a step over which a mode's shape changes too much
_NARROWEST = 8  # the same if two modes exchange places
_SPARE = 4  # additional modes that may enter from above between two speeds
_LEAST_MAC = 0.8  # between neighbouring speeds; below, the step is halved


@dataclass(frozen=True, kw_only=True, eq=False)
class Campbell(Vibrations):
    """Modes of a rotor tracked over its speed.

    Attributes
    ----------
    speeds : numpy.ndarray [shape=(n_speeds,)]
        Speeds [rad/s].
    eigenvalues : numpy.ndarray [shape=(n_speeds, n_modes)]
        One mode per column [rad/s]; NaN from the speed where the mode was lost.
    shapes : numpy.ndarray [shape=(n_speeds, n_dof, n_modes)]
        As in :class:`RotorModes`; NaN likewise.
    axis_ratio : numpy.ndarray [shape=(n_speeds, n_nodes, n_modes)]
        Axis ratios of the orbits, as in :class:`RotorModes`; NaN likewise.
    mac : numpy.ndarray [shape=(n_speeds, n_modes)]
        Least MAC with the shape of the last step, 1 for the same; the first row is 1.
    lost_at : numpy.ndarray [shape=(n_modes,)]
        Speed from which a mode no longer oscillates, or cannot be distinguished from others
        [rad/s]; inf if it was tracked to the end.
    """

    speeds: Vector
    eigenvalues: Complex
    shapes: Complex
    axis_ratio: Vector
    mac: Vector
    lost_at: Vector

    __repr__ = brief("speeds", "frequency_hz")

    @property
    def direction(self) -> tuple[tuple[str, ...], ...]:
        """Direction of each mode at each speed, as in :class:`RotorModes`; "lost" once lost."""
        return tuple(
            tuple("lost" if np.isnan(mode).any() else direction_of(mode) for mode in nodes.T)
            for nodes in self.axis_ratio
        )


def campbell(
    rotor: Rotor | RotorLaw, speeds: ArrayLike, count: int = 6, *, most_damping: float = 1.0
) -> Campbell:
    """Natural frequencies and damping over the speed, with each mode tracked by its shape.

    Parameters
    ----------
    rotor : Rotor or callable
        A function of the speed [rad/s] returns a rotor, if films make stiffness and damping depend
        on the speed; all rotors have the same coordinates.
    speeds : array_like [shape=(n_speeds,)]
        Speeds [rad/s], rising or falling throughout.
    count : int
        Number of modes to track, the lowest at the first speed.
    most_damping : float
        In (0, 1]: for the modes at the first speed, as in :func:`modes`; afterwards a mode is
        tracked up to half-way from there to 1.

    Returns
    -------
    Campbell
        Every mode at every speed.

    Raises
    ------
    ValueError
        The speeds do not rise or fall throughout, or there are fewer modes.

    Notes
    -----
    Shapes at neighbouring speeds are paired to maximise the sum of their MAC
    ``|a* M b|^2 / (a* M a  b* M b)``. If one falls below 0.8, or two modes have
    exchanged places, the step is halved: so a mode is tracked across a crossing, where it keeps
    its shape, and through a veering, where it takes on the other's. A veering narrower than 1/256
    of a step counts as a crossing; a mode with a MAC below 0.5 at 1/4096 of a step ends there.

    Examples
    --------
    >>> from wearstate.sim.beam.rotor import Support
    >>> from wearstate.sim.beam.beam import assemble_beam
    >>> from wearstate.sim.beam.beam_parts import Disc, Section
    >>> steel = dict(young=211e9, shear_modulus=81.2e9, density=7810.0)
    >>> beam = assemble_beam([Section(length=1.5, outer_diameter=0.05, **steel)],
    ...                      longest_element=0.25, shear_coefficient="cowper",
    ...                      discs=[Disc(station=1.0, mass=50.0, polar_inertia=0.8,
    ...                                  diametral_inertia=0.42)])
    >>> ends = [Support(name=str(s), station=s, stiffness=1e6 * np.eye(2)) for s in (0.0, 1.5)]
    >>> found = campbell(Rotor(beam=beam, supports=tuple(ends)), [0.0, 200.0, 400.0], count=2)
    >>> bool(np.diff(np.sort(found.frequency_hz[-1])) > np.diff(np.sort(found.frequency_hz[0])))
    True
    """
    omega = np.atleast_1d(np.asarray(speeds, dtype=float))
    steps = np.diff(omega)
    if omega.ndim != 1 or not np.isfinite(omega).all() or not (all(steps > 0) or all(steps < 0)):
        raise ValueError("speeds must be finite and rise or fall throughout; sort them")
    law = rotor if callable(rotor) else lambda _: rotor
    track = _Track(law, float(omega[0]), count, most_damping)
    rows = [track.row()]
    for before, speed in pairwise(omega):
        track.least[:] = 1.0
        track.follow(float(before), float(speed), 0)
        rows.append(track.row())
    return Campbell(
        speeds=omega,
        eigenvalues=np.array([row[0] for row in rows]),
        shapes=np.array([row[1] for row in rows]),
        axis_ratio=np.array([row[2] for row in rows]),
        mac=np.array([row[3] for row in rows]),
        lost_at=track.lost_at,
    )


class _Track:
    """Modes tracked from speed to speed."""

    def __init__(self, law: RotorLaw, speed: float, count: int, most_damping: float) -> None:
        self.law = law
        self.most_damping = (1 + most_damping) / 2
        found = modes(law(speed), speed, count, most_damping=most_damping)
        if found.eigenvalues.size < count:
            raise ValueError(
                f"count = {count} must be <= {found.eigenvalues.size}, of modes that oscillate at "
                f"{speed:g} rad/s; ask for fewer"
            )
        self.values, self.shapes, self.ratios = found.eigenvalues, found.shapes, found.axis_ratio
        self.least = np.ones(count)
        self.lost_at = np.full(count, math.inf)

    def row(self) -> tuple[Complex, Complex, Vector, Vector]:
        lost = np.isfinite(self.lost_at)
        return (
            np.where(lost, np.nan, self.values),
            np.where(lost, np.nan, self.shapes),
            np.where(lost, np.nan, self.ratios),
            np.where(lost, np.nan, self.least),
        )

    def follow(self, before: float, speed: float, depth: int) -> None:
        rotor, alive = self.law(speed), np.flatnonzero(np.isinf(self.lost_at))
        wanted = self.values.size + _SPARE
        found = modes(rotor, speed, wanted, most_damping=self.most_damping)
        likeness = _likeness(rotor.mass, self.shapes[:, alive], self.values[alive], found.shapes)
        rows, columns = linear_sum_assignment(-likeness)
        matched, kept = likeness[rows, columns], alive[rows]
        unlike = rows.size < alive.size or matched.min(initial=1.0) < _LEAST_MAC
        swapped = _swapped(self.values[kept], found.eigenvalues[columns])
        if depth < _MOST_BISECTIONS * unlike or depth < _NARROWEST * swapped:
            middle = (before + speed) / 2
            self.follow(before, middle, depth + 1)
            self.follow(middle, speed, depth + 1)
            return
        self.lost_at[np.setdiff1d(alive, kept)] = speed
        self.lost_at[kept[matched < 0.5]] = speed
        self.values[kept] = found.eigenvalues[columns]
        self.shapes[:, kept] = found.shapes[:, columns]
        self.ratios[:, kept] = found.axis_ratio[:, columns]
        self.least[kept] = np.minimum(self.least[kept], matched)


def _swapped(old: Complex, new: Complex) -> bool:
    """Whether two modes have exchanged places, by a crossing or by an unresolved veering.

    Their eigenvalues must have been close in between: modes of different damping do not mix.
    """
    before, after = (np.subtract.outer(values, values) for values in (old, new))
    change = after - before
    slack = EQUAL * np.abs(old).max(initial=0.0)
    turned = (before.imag > slack) & (after.imag < 0)
    nearest = np.abs((before.conj() * change).imag)  # distance of the chord from zero, times change
    return bool((turned & (nearest < 0.1 * np.abs(change) ** 2)).any())


def _likeness(mass: Sparse, old: Complex, values: Complex, new: Complex) -> Vector:
    """MAC of old with new shapes; modes of equal frequency are taken as the space they span."""
    weighted = mass @ new
    size = np.sum(new.conj() * weighted, axis=0).real
    result = np.empty((old.shape[1], new.shape[1]))
    for i in range(old.shape[1]):
        same = np.abs(values - values[i]) <= 1e-6 * np.abs(values[i])
        group = old[:, same]
        gram = group.conj().T @ (mass @ group)
        overlap = group.conj().T @ weighted
        result[i] = np.sum(overlap.conj() * linalg.solve(gram, overlap), axis=0).real / size
    return result


@dataclass(frozen=True, kw_only=True, eq=False)
class CriticalSpeeds:
    """Intersections of a mode with an order of the speed.

    Attributes
    ----------
    speeds : numpy.ndarray [shape=(n,)]
        Rising [rad/s].
    damping_ratio : numpy.ndarray [shape=(n,)]
        Damping ratio of the mode there.
    direction : tuple of str
        Direction of its whirl. An unbalance on symmetric supports excites forward modes only.
    """

    speeds: Vector
    damping_ratio: Vector
    direction: tuple[str, ...]

    __repr__ = brief()


def critical_speeds(
    rotor: Rotor | RotorLaw,
    speeds: ArrayLike,
    *,
    count: int = 6,
    order: float = 1.0,
    most_damping: float = 1.0,
) -> CriticalSpeeds:
    """Speeds at which a damped natural frequency equals an order of the speed.

    Parameters
    ----------
    rotor : Rotor or callable
        As in :func:`campbell`.
    speeds : array_like
        Rising from zero [rad/s]: intersections below the first speed are not found, nor two
        between neighbouring speeds.
    count : int
        Number of modes tracked.
    order : float
        Order of the excitation, > 0: 1 for unbalance, the number of blades for a propeller.
    most_damping : float
        In (0, 1], as in :func:`campbell`.

    Returns
    -------
    CriticalSpeeds
        Within 1e-10 of the speed; by the chord of the step if a mode's shape changes too much
        to be found in between: then choose closer speeds.

    Raises
    ------
    ValueError
        The order is not above zero, or as in :func:`campbell`.

    Examples
    --------
    >>> from wearstate.sim.beam.rotor import Support
    >>> from wearstate.sim.beam.beam import assemble_beam
    >>> from wearstate.sim.beam.beam_parts import Disc, Section
    >>> bar = Section(length=1.0, outer_diameter=0.01, young=2e11, shear_modulus=8e10,
    ...               density=7800.0)
    >>> beam = assemble_beam([bar], discs=[Disc(station=0.5, mass=100.0)], shear_coefficient=1.0)
    >>> ends = [Support(name=str(s), station=s, stiffness=1e12 * np.eye(2)) for s in (0.0, 1.0)]
    >>> found = critical_speeds(Rotor(beam=beam, supports=tuple(ends)), [0.0, 50.0], count=2)
    >>> round(math.sqrt(48 * bar.bending_stiffness / 100), 1), found.speeds.round(1)
    (6.9, array([6.9, 6.9]))
    """
    if not 0 < order < math.inf:
        raise ValueError(f"order = {order} must be > 0 and finite; unbalance has 1")
    law = rotor if callable(rotor) else lambda _: rotor
    table = campbell(law, speeds, count, most_damping=most_damping)
    excess = table.eigenvalues.imag - order * table.speeds[:, None]
    known = np.isfinite(excess) & (table.eigenvalues != 0)  # rigid motions meet any order at rest
    turns = known[:-1] & known[1:] & ((excess[:-1] < 0) != (excess[1:] < 0))
    places = zip(*np.nonzero(turns), strict=True)
    found = [
        _meet(law, table, int(step), int(mode), order, (1 + most_damping) / 2)
        for step, mode in places
    ]
    found.sort(key=lambda entry: entry[0])
    return CriticalSpeeds(
        speeds=np.array([entry[0] for entry in found]),
        damping_ratio=np.array([entry[1] for entry in found]),
        direction=tuple(entry[2] for entry in found),
    )


def _meet(
    law: RotorLaw, table: Campbell, step: int, mode: int, order: float, most_damping: float
) -> tuple[float, float, str]:
    """Speed, damping ratio and direction where a mode meets the order within a step."""
    ends = table.shapes[step : step + 2, :, mode].T
    last: dict[str, Any] = {}

    def excess(speed: float) -> float:
        rotor = law(speed)
        wanted = table.eigenvalues.shape[1] + _SPARE
        found = modes(rotor, speed, wanted, most_damping=most_damping)
        alone = np.array([1.0, 2.0]) * found.eigenvalues[0]  # each end by itself, not as a group
        at = int(_likeness(rotor.mass, ends, alone, found.shapes).sum(axis=0).argmax())
        last["damping"], last["direction"] = found.damping_ratio[at], found.direction[at]
        return float(found.eigenvalues[at].imag) - order * speed

    low, high = float(table.speeds[step]), float(table.speeds[step + 1])
    if excess(low) * excess(high) > 0:  # shapes too different to be tracked: the chord's root
        ends_of = (
            table.eigenvalues[step : step + 2, mode].imag - order * table.speeds[[step, step + 1]]
        )
        speed = low + (high - low) * float(ends_of[0] / (ends_of[0] - ends_of[1]))
    else:
        speed = float(brentq(excess, low, high, xtol=1e-10 * high, rtol=1e-12))
    excess(speed)
    return speed, float(last["damping"]), str(last["direction"])
