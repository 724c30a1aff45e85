"""Influence coefficients against closed forms and a measured two-plane job."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.features.rotation.balancing import correction_masses, influence_coefficients


def phasor(text):
    """'170.0@112.0' as a complex number."""
    size, angle = map(float, text.split("@"))
    return size * np.exp(1j * np.radians(angle))


def polar(value):
    return abs(value), np.degrees(np.angle(value)) % 360


def test_a_measured_two_plane_job(realdata):
    path = realdata / "bk_two_plane_balancing_MIT" / "data.txt"
    if not path.is_file():
        pytest.skip("the balancing phasors are not here")
    rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    table = {row[0]: row[1:] for row in rows if row and row[0] != "#"}
    initial = [phasor(cell) for cell in table["initial"]]
    trials = [[phasor(c) for c in table[f"1.15g@0_plane{p}"]] for p in (1, 2)]
    alpha = influence_coefficients(initial, trials, [1.15, 1.15])
    found = correction_masses(alpha, initial)
    # printed to three digits
    for mass, key, size, angle in zip(
        found.masses, ("plane1", "plane2"), (1.979, 1.071), (236.2, 121.8), strict=True
    ):
        assert polar(mass) == pytest.approx((size, angle), abs=0.06)
        assert polar(mass)[0] == pytest.approx(size, abs=6e-4)
        assert table[key] == [f"{size}@{angle}"]
    assert_allclose(abs(found.residual), 0, atol=1e-10 * abs(initial[0]))


def test_a_known_machine_is_balanced():
    rng = np.random.default_rng(2)
    alpha = rng.standard_normal((2, 2)) + 1j * rng.standard_normal((2, 2))
    unbalance = np.array([1.5 * np.exp(0.3j), 0.7 * np.exp(-2j)])
    initial = alpha @ unbalance
    trial = np.array([0.4j, 0.5])
    trials = initial + (alpha * trial).T
    found = influence_coefficients(initial, trials, trial)
    assert_allclose(found, alpha, rtol=1e-12)
    # solving a matrix of condition ~5: rounding
    assert_allclose(correction_masses(found, initial).masses, -unbalance, rtol=1e-12)


def test_more_sensors_than_planes_leave_the_least_residual():
    rng = np.random.default_rng(3)
    alpha = rng.standard_normal((4, 2)) + 1j * rng.standard_normal((4, 2))
    initial = rng.standard_normal(4) + 1j * rng.standard_normal(4)
    found = correction_masses(alpha, initial)
    # the residual of least squares is at right angles to what the planes can do
    assert_allclose(alpha.conj().T @ found.residual, 0, atol=1e-12)
    assert_allclose(found.residual, initial + alpha @ found.masses, atol=1e-14)
    assert np.linalg.norm(found.residual) > 0.1


def test_all_faults_of_the_runs_are_named():
    with pytest.raises(ValueError, match=r"trials has shape \(2, 1\).*(?s:.)*must not be 0"):
        influence_coefficients([1.0], [[1.0], [2.0]], [0.0])
    with pytest.raises(ValueError, match=r"initial must be finite"):
        influence_coefficients([np.nan], [[1.0]], [1.0])


@pytest.mark.parametrize(
    ("alpha", "initial", "message"),
    [
        ([[1.0, 1.0], [1.0, 1.001]], [1.0, 2.0], "condition number .* must be <= 50"),
        ([[1.0, 1.0]], [1.0], "n_planes = 2 must be <= n_sensors = 1"),
        ([[1.0]], [1.0, 2.0], r"coefficients have shape \(1, 1\)"),
        ([[0.0]], [1.0], "condition number"),
        ([[np.inf]], [1.0], "must be finite"),
    ],
)
def test_hopeless_coefficients_are_refused(alpha, initial, message):
    with pytest.raises(ValueError, match=message):
        correction_masses(alpha, initial)
