"""Forces that excite a line: unbalance, blade rate, coupling, turbulence, and the hull's."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import Coupling, Turbulence
from ..shaft_response.places import Place
from ..shaft_response.time_response import Broadband, Harmonic
from .hull import hull_forces
from .line_beam import disc_of

Float = NDArray[np.float64]

_DENSITY_LINES = 200  # lines of a turbulence spectrum up to half the sample rate


class OrderForce(NamedTuple):
    """A force or moment periodic with the shaft: ``Re(amplitude exp(j order angle))``."""

    order: int
    place: tuple[float, str]
    amplitude: complex


def harmonic_forces(scene: ShaftScene) -> tuple[Harmonic, ...]:
    """Forces of unbalance, blade rate, coupling and hull, with phases at the first sample.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of Harmonic
        One for every order of the speed, in rising order; then those of
        :func:`~wearstate.sim.shaft.hull.hull_forces`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> forces = harmonic_forces(load_scene("propulsion-shaft"))
    >>> [round(force.frequency, 6) for force in forces]
    [5.0, 10.0, 20.0, 40.0]
    >>> round(abs(forces[0].forces[0.35, "y"]))  # unbalance of the propeller: 0.34 kg m at 300 rpm
    336
    """
    orders: dict[int, dict[Place, complex]] = {}
    for order, place, amplitude in order_forces(scene):
        turned = amplitude * np.exp(1j * order * scene.drive.start_angle)
        at = orders.setdefault(order, {})
        at[place] = at.get(place, 0.0) + complex(turned)
    of_the_shaft = tuple(
        Harmonic(frequency=order * scene.drive.speed, forces=orders[order])
        for order in sorted(orders)
    )
    return of_the_shaft + hull_forces(scene)


def order_forces(scene: ShaftScene) -> list[OrderForce]:
    """Forces of unbalance, blades and coupling at the start angle zero; zero amplitudes omitted."""
    forces = _unbalances(scene)
    if scene.propeller is not None:
        forces += _blade_rates(scene)
    if scene.coupling is not None:
        forces += coupling_forces(scene.coupling)
    return [force for force in forces if force.amplitude != 0]


def _forward(
    order: int, station: float, amplitude: complex, coordinates: tuple[str, str] = ("y", "z")
) -> list[OrderForce]:
    """A vector that rotates with the shaft: ``A (cos, sin)(order angle + phase)``."""
    return [
        OrderForce(order, (station, coordinate), amplitude * turn)
        for coordinate, turn in zip(coordinates, (1.0, -1j), strict=True)
    ]


def _unbalances(scene: ShaftScene) -> list[OrderForce]:
    square = (math.tau * scene.drive.speed) ** 2
    return [
        force
        for disc in scene.discs
        for force in _forward(
            1, disc.station, disc.unbalance * square * np.exp(1j * disc.unbalance_angle)
        )
    ]


def _blade_rates(scene: ShaftScene) -> list[OrderForce]:
    part = scene.propeller
    assert part is not None
    station = disc_of(scene, part.disc).station
    forces = []
    for rate in part.blade_rate:
        up, side = (part.thrust * np.exp(1j * p) for p in (rate.up_phase, rate.side_phase))
        amplitudes = {
            "y": rate.up * up,
            "z": rate.side * side,
            "slope_y": rate.moment_up * part.diameter * up,
            "slope_z": rate.moment_side * part.diameter * side,
        }
        forces += [
            OrderForce(rate.harmonic * part.blades, (station, coordinate), complex(amplitude))
            for coordinate, amplitude in amplitudes.items()
        ]
    return forces


def coupling_forces(coupling: Coupling) -> list[OrderForce]:
    """Forces of a coupling with unequal elements at once and twice the speed.

    Parameters
    ----------
    coupling : Coupling

    Returns
    -------
    list of OrderForce

    Notes
    -----
    The elements are on a ring at the angle ``psi = phi + theta``; their stiffness along it is
    ``1 + a cos phi + b cos 2 phi`` over its mean, phi from the stiffest, theta the shaft's angle.
    An offset delta, fixed in space, moves the element at psi by ``delta . t`` along the ring,
    ``t = (-sin psi, cos psi)``. The mean over the ring of ``2 k (1 + b cos 2 phi) (delta . t) t``
    is the steady force ``k delta`` and a force of ``k b delta / 2`` at twice the speed; an angle
    acts in the same way with its moments, of opposite sign, as it moves the elements along the
    shaft. The torque T deforms all elements equally, so that the stiffer side carries more of it
    and a force of ``a T / 2 r`` rotates with the shaft. An offset adds nothing at once the speed:
    apart from unbalance, only the torque acts there.

    Derived here. Measurements of misaligned couplings show mainly twice the speed, as here;
    Sekhar, Prabhu (1995), Effects of coupling misalignment on vibrations of rotating machinery,
    Journal of Sound and Vibration 185(4), 655-671, doi:10.1006/jsvi.1995.0407, take both.

    Examples
    --------
    >>> part = Coupling(
    ...     station=1.0, stiffness=1e6, ring_radius=0.1, parallel_offset=1e-3, uneven_twice=0.2
    ... )
    >>> [(f.order, f.place[1], round(float(abs(f.amplitude)))) for f in coupling_forces(part)[2:4]]
    [(2, 'y', 100), (2, 'z', 100)]
    """
    station = coupling.station
    turned = np.exp(1j * coupling.uneven_phase)
    torque = coupling.torque * coupling.uneven_once / (2 * coupling.ring_radius)
    pull = coupling.stiffness * coupling.parallel_offset * coupling.uneven_twice / 2
    bend = coupling.bending_stiffness * coupling.angle * coupling.uneven_twice / 2
    return [
        *_forward(1, station, 1j * torque * turned),
        *_forward(2, station, -pull * turned**2 * np.exp(-1j * coupling.offset_angle)),
        *_forward(2, station, bend * turned**2, ("slope_y", "slope_z")),
    ]


def random_forces(scene: ShaftScene) -> tuple[Broadband, ...]:
    """Turbulence of a scene: for every entry, two independent forces, up and to the side.

    Parameters
    ----------
    scene : ShaftScene

    Returns
    -------
    tuple of Broadband
        Densities reach up to half the sample rate.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> len(random_forces(load_scene("propulsion-shaft")))
    12
    """
    return tuple(
        Broadband(
            frequencies=hertz, density=density, forces={_pushed(scene, entry.place, axis): 1.0}
        )
        for entry in scene.turbulence
        if entry.force > 0
        for hertz, density in (turbulence_density(entry, scene.sample_rate / 2),)
        for axis in "yz"
    )


def _pushed(scene: ShaftScene, name: str, axis: str) -> Place:
    """Place of a random force: the housing of a bearing, or the shaft at a disc."""
    if name in [bearing.name for bearing in scene.bearings]:
        return name, axis, "housing"
    return disc_of(scene, name).station, axis


def turbulence_density(part: Turbulence, highest: float) -> tuple[Float, Float]:
    """One-sided power spectral density of a random force.

    Parameters
    ----------
    part : Turbulence
    highest : float
        Last frequency [Hz].

    Returns
    -------
    frequencies : numpy.ndarray [shape=(n,)]
        From zero, linearly spaced below the corner and logarithmically above it [Hz].
    density : numpy.ndarray [shape=(n,)]
        ``2 F^2 / (pi f_c) / (1 + (f / f_c)^2)`` [N^2/Hz], whose integral to infinity is F^2.

    Examples
    --------
    >>> part = Turbulence(place="propeller", force=10.0, corner=50.0)
    >>> hertz, density = turbulence_density(part, 1e5)
    >>> bool(abs(np.trapezoid(density, hertz) / 100 - 1) < 1e-3)
    True
    """
    steps = np.linspace(0, math.asinh(highest / part.corner), _DENSITY_LINES)
    hertz = part.corner * np.sinh(steps)
    hertz[-1] = highest
    density = 2 * part.force**2 / (math.pi * part.corner) / (1 + (hertz / part.corner) ** 2)
    return hertz, density
