"""Stability of a rotor on a bearing: the whirl threshold."""

import math
from dataclasses import dataclass, replace

import numpy as np

from ..brief import brief
from ..film.slopes import Coefficients
from ..film.solve import FilmGeometry
from .coefficients import coefficients
from .equilibrium import Equilibrium, checked_positive, equilibrium

WHIRL_TOLERANCE = 0.03
"""Accepted error of a threshold's speed: a damping of 5 % changes it by more."""

_FINEST = (288, 65)


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """Whirl threshold of a rigid rotor on its bearings.

    Attributes
    ----------
    stiffness : float
        Equivalent stiffness at the threshold, in the unit of the given stiffness.
    whirl_ratio : float
        Frequency of the whirl over that of the rotation; 0 if no speed is unstable.
    mass : float
        ``m C omega^2 / W`` at the threshold, for coefficients over the load: below it, the rotor's
        mass per bearing is stable; inf if no speed is unstable.
    """

    stiffness: float
    whirl_ratio: float
    mass: float

    @property
    def speed(self) -> float:
        """``omega sqrt(C / g)`` at the threshold of a rotor whose weight is the load."""
        return math.sqrt(self.mass)


def stability(c: Coefficients) -> Threshold:
    """Threshold of a rigid rotor from its eight coefficients, by Routh and Hurwitz.

    Parameters
    ----------
    c : Coefficients [shape=(2, 2) or more]
        Over the load, in the usual tabulated form; of a larger matrix the 2 x 2 part of forces and
        centre.

    Returns
    -------
    Threshold
        Speed, frequency and mass.

    Raises
    ------
    ValueError
        The damping is not positive definite, which no film at rest has.

    Notes
    -----
    At the threshold ``m x'' + C x' + K x = 0`` has a circular frequency ``lambda omega``::

        kappa = (Kxx Cyy + Kyy Cxx - Kxy Cyx - Kyx Cxy) / (Cxx + Cyy)
        lambda^2 = ((Kxx - kappa) (Kyy - kappa) - Kxy Kyx) / (Cxx Cyy - Cxy Cyx)
        m C omega^2 / W = kappa / lambda^2

    The rotor is symmetric and its tilt neglected; coefficients belong to one Sommerfeld number,
    which itself depends on the speed.

    Examples
    --------
    >>> from wearstate.sim.bearing.short_bearing import short_coefficients
    >>> threshold = stability(short_coefficients(0.3))
    >>> [round(v, 4) for v in (threshold.whirl_ratio, threshold.speed)]
    [0.5194, 2.6058]
    """
    kappa, square = _neutral(c)
    if square <= 0:
        return Threshold(stiffness=kappa, whirl_ratio=0.0, mass=math.inf)
    return Threshold(stiffness=kappa, whirl_ratio=math.sqrt(square), mass=max(0.0, kappa / square))


def _neutral(c: Coefficients) -> tuple[float, float]:
    """Equivalent stiffness and square of the whirl ratio at the threshold."""
    (kxx, kxy), (kyx, kyy) = c.stiffness[:2, :2]
    (cxx, cxy), (cyx, cyy) = c.damping[:2, :2]
    determinant = cxx * cyy - cxy * cyx
    if not (cxx + cyy > 0 and determinant > 0):
        raise ValueError(
            f"damping of determinant {determinant:g} must be positive definite; give the "
            "coefficients of a film about its equilibrium"
        )
    kappa = (kxx * cyy + kyy * cxx - kxy * cyx - kyx * cxy) / (cxx + cyy)
    square = ((kxx - kappa) * (kyy - kappa) - kxy * kyx) / determinant
    return float(kappa), float(square)


@dataclass(frozen=True, kw_only=True)
class Whirl:
    """Whirl threshold of a rotor, and its mesh error.

    Attributes
    ----------
    threshold : Threshold
        From the coefficients over the load; if the mesh leaves open whether there is a threshold,
        the least mass that may whirl.
    coefficients : Coefficients [shape=(2, 2)]
        Over the load, extrapolated from the two finest meshes.
    stiffness_error, damping_error : float
        Largest change of the finest mesh's coefficients by the extrapolation, over
        the largest of its kind.
    speed_error : float
        Relative error of `threshold.speed`; 0 if certainly no speed is unstable,
        inf if that is open, NaN if only one mesh was used.
    n_theta, n_z : int
        Size of the finest mesh.
    """

    threshold: Threshold
    coefficients: Coefficients
    stiffness_error: float
    damping_error: float
    speed_error: float
    n_theta: int
    n_z: int

    __repr__ = brief("resolved", "stiffness_error", "damping_error", "speed_error")

    @property
    def resolved(self) -> bool:
        """Whether it is certain that there is a threshold, or that there is none."""
        return self.speed_error < math.inf


def whirl(found: Equilibrium, *, tolerance: float = WHIRL_TOLERANCE) -> Whirl:
    """Threshold of a rigid rotor, on meshes as fine as its error requires.

    Parameters
    ----------
    found : Equilibrium
        On the coarsest of the meshes.
    tolerance : float
        Largest error of the threshold's speed, > 0.

    Returns
    -------
    Whirl
        Its error exceeds the tolerance if twice the finest mesh would have more than
        288 x 65 nodes.

    Raises
    ------
    ValueError
        The tolerance is not above zero.

    Notes
    -----
    The coefficients' error is of second order (:mod:`.film.slopes`): those of a mesh and of one of
    half its width are extrapolated, and the change is the stated error. For the threshold it is
    that of ``W / (m C omega^2)``, which passes through zero where the last speed becomes stable;
    there the relative error of the speed is unbounded, and meshes are halved until the sign is
    certain or they end. Rungs other than *direct* are used on one mesh only.

    Two meshes take about 6 times the time of the first alone, a third 60 to 100 times.

    Examples
    --------
    >>> found = equilibrium(FilmGeometry(length_to_diameter=0.5), [0.5, 0.0])
    >>> limit = whirl(found)
    >>> round(limit.threshold.speed, 2), limit.speed_error < 0.01
    (2.55, True)
    """
    checked_positive("tolerance", tolerance, "of the speed")
    load = float(np.hypot(*found.load))
    exact = found.rung == "direct" and found.geometry.inlet_fill == 1
    own = coefficients(found, method="analytic" if exact else "displacement").per_load(load)
    geometry = found.geometry
    result = Whirl(
        threshold=stability(own),
        coefficients=own,
        stiffness_error=math.nan,
        damping_error=math.nan,
        speed_error=math.nan,
        n_theta=geometry.n_theta,
        n_z=geometry.n_z,
    )
    place = found.position
    while exact and not result.speed_error <= tolerance:
        geometry = doubled(geometry)
        finer = equilibrium(
            geometry, found.load, tilt=found.tilt, start=place, raise_on_failure=False
        )
        if not finer.status.ok:
            break
        fine, place = coefficients(finer).per_load(load), finer.position
        result, own = _extrapolated(own, fine, geometry), fine
        if 2 * geometry.n_theta > _FINEST[0] or 2 * geometry.n_z - 1 > _FINEST[1]:
            break
    return result


def doubled(geometry: FilmGeometry) -> FilmGeometry:
    """The same film on a mesh of half the width both ways, with the bore interpolated linearly."""
    bore = geometry.bore
    if bore is not None:
        bore = np.stack([bore, 0.5 * (bore + np.roll(bore, -1))], axis=1).ravel()
    return replace(geometry, n_theta=2 * geometry.n_theta, n_z=2 * geometry.n_z - 1, bore=bore)


def _extrapolated(coarse: Coefficients, fine: Coefficients, geometry: FilmGeometry) -> Whirl:
    """Richardson extrapolation from two meshes, the finer of half the width."""
    changes = [(b - a) / 3 for a, b in zip(coarse, fine, strict=True)]
    best = Coefficients(*(b + change for b, change in zip(fine, changes, strict=True)))
    errors = [
        float(np.abs(change).max() / np.abs(own).max())
        for own, change in zip(best, changes, strict=True)
    ]
    inverse = _inverse_mass(best)
    doubt = abs(inverse - _inverse_mass(fine))
    threshold, error = stability(best), 0.0
    if inverse - doubt > 0:
        error = math.sqrt(inverse / (inverse - doubt)) - 1
    elif inverse + doubt > 0:
        threshold, error = replace(threshold, mass=1 / (inverse + doubt)), math.inf
    return Whirl(
        threshold=threshold,
        coefficients=best,
        stiffness_error=errors[0],
        damping_error=errors[1],
        speed_error=error,
        n_theta=geometry.n_theta,
        n_z=geometry.n_z,
    )


def _inverse_mass(c: Coefficients) -> float:
    """W / (m C omega^2) at the threshold; negative if no speed is unstable."""
    kappa, square = _neutral(c)
    return square / kappa if kappa > 0 else math.inf
