"""Balancing by influence coefficients: trial runs in, correction masses out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Complex = NDArray[np.complex128]

LARGEST_CONDITION = 50.0
"""Largest condition number of the influence coefficients [-]: at it, reading errors of 2 % cause
errors of 100 % in the masses, so that the planes cannot be distinguished."""


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Correction masses and the residual vibration.

    Parameters
    ----------
    masses : ndarray, shape (n_planes,)
        Complex masses, with angles counted as for the trial masses [unit of the trial masses].
    residual : ndarray, shape (n_sensors,)
        Predicted 1X vibration with the masses [unit of the vibration]; 0 with as many planes as
        sensors.

    Examples
    --------
    >>> Correction(masses=np.ones(1), residual=np.zeros(2)).residual.size
    2
    """

    masses: Complex
    residual: Complex


def influence_coefficients(
    initial: ArrayLike, trials: ArrayLike, trial_masses: ArrayLike
) -> Complex:
    """Change of the vibration per unit mass in each plane.

    Parameters
    ----------
    initial : array_like, shape (n_sensors,)
        Complex 1X vibration of the machine as found [any unit], as from `order.order_amplitudes`.
    trials : array_like, shape (n_planes, n_sensors)
        Vibration with a trial mass in one plane at a time, the previous one removed [same unit].
    trial_masses : array_like, shape (n_planes,)
        Complex trial masses [any unit, such as kg or kg m], angle from the mark.

    Returns
    -------
    ndarray, shape (n_sensors, n_planes)
        ``(trial - initial) / trial mass`` [unit of vibration per unit of mass].

    Raises
    ------
    ValueError
        If shapes disagree, a value is not finite, or a trial mass is 0; all faults at once.

    Notes
    -----
    Angles of vibration and mass may be counted either way (with or against the rotation, lead or
    lag), but all in the same way. Assumes a linear machine at one speed.

    References
    ----------
    T. P. Goodman, "A least-squares method for computing balance corrections", J. Eng. Ind. 86
    (1964) 273-277, doi:10.1115/1.3670532; ISO 21940-13:2012.

    Examples
    --------
    >>> influence_coefficients([2.0], [[3.0 + 1j]], [2.0]).tolist()
    [[(0.5+0.5j)]]
    """
    found = np.asarray(initial, dtype=np.complex128)
    runs = np.asarray(trials, dtype=np.complex128)
    masses = np.asarray(trial_masses, dtype=np.complex128)
    _check_runs(found, runs, masses)
    return np.asarray((runs - found).T / masses)


def _check_runs(initial: Complex, trials: Complex, masses: Complex) -> None:
    faults = []
    if initial.ndim != 1 or masses.ndim != 1 or trials.shape != (masses.size, initial.size):
        faults.append(
            f"trials has shape {trials.shape}, must be (n_planes, n_sensors) = "
            f"{masses.shape + initial.shape}; give one run for each trial mass"
        )
    for name, values in (("initial", initial), ("trials", trials), ("trial_masses", masses)):
        if not np.all(np.isfinite(values)):
            faults.append(f"{name} must be finite; repeat the run that failed")
    if np.any(masses == 0):
        faults.append("trial_masses must not be 0; use masses that change the vibration by 20 %")
    if faults:
        raise ValueError("\n".join(faults))


def correction_masses(coefficients: ArrayLike, initial: ArrayLike) -> Correction:
    """Correction masses that minimise the vibration.

    Parameters
    ----------
    coefficients : array_like, shape (n_sensors, n_planes)
        Coefficients from `influence_coefficients`.
    initial : array_like, shape (n_sensors,)
        Complex 1X vibration with the trial masses removed.

    Returns
    -------
    Correction
        Masses, exact with as many planes as sensors, by least squares with fewer; and the residual
        vibration.

    Raises
    ------
    ValueError
        If shapes disagree, a value is not finite, there are more planes than sensors, or the
        condition number of the coefficients exceeds 50.

    References
    ----------
    As `influence_coefficients`.

    Examples
    --------
    >>> correction_masses([[0.5 + 0.5j]], [2.0]).masses.round(6).tolist()
    [(-2+2j)]
    """
    matrix = np.asarray(coefficients, dtype=np.complex128)
    found = np.asarray(initial, dtype=np.complex128)
    _check_coefficients(matrix, found)
    masses: Complex = np.asarray(
        np.linalg.lstsq(matrix, -found, rcond=None)[0], dtype=np.complex128
    )
    return Correction(masses=masses, residual=np.asarray(found + matrix @ masses))


def _check_coefficients(matrix: Complex, initial: Complex) -> None:
    if matrix.ndim != 2 or initial.shape != matrix.shape[:1] or matrix.shape[1] < 1:
        raise ValueError(
            f"coefficients have shape {matrix.shape}, must be (n_sensors, n_planes >= 1) with "
            f"{initial.shape} as initial; use the sensors of the trial runs"
        )
    if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(initial))):
        raise ValueError("coefficients and initial must be finite; repeat the run that failed")
    if matrix.shape[1] > matrix.shape[0]:
        raise ValueError(
            f"n_planes = {matrix.shape[1]} must be <= n_sensors = {matrix.shape[0]}; read more "
            "sensors or speeds, or leave planes out"
        )
    condition = float(np.linalg.cond(matrix))
    if not condition <= LARGEST_CONDITION:
        raise ValueError(
            f"condition number of the coefficients = {condition:.3g} must be <= "
            f"{LARGEST_CONDITION:g}; the planes act alike: leave one out, or use other sensors"
        )
