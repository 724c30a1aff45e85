"""Changes of a shaft line to first order against the line computed anew."""

import math
from dataclasses import replace

import numpy as np
import pytest
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft import changed as shaft_change
from wearstate.sim.shaft.at_rest import shaft_state
from wearstate.sim.shaft.changed import (
    QUANTITIES,
    coefficient_slopes,
    free_line,
    line_model,
    no_change,
    rest,
    transfer,
    transfer_slopes,
    unit_change,
)
from wearstate.sim.shaft_films.small_changes import coefficient_gradients, journal_shifts
from wearstate.sim.shaft_response.receptance import accelerance

SPEED = 2 * math.pi * 10
HERTZ = np.array([12.0, 33.0, 70.0, 145.0, 320.0])
RESPONSES = [(name, axis, "housing") for name in ("aft", "third") for axis in "yz"]


@pytest.fixture(scope="module")
def rig():
    """A rig on a fine mesh, whose films' coefficients jump less from node to node."""
    return line_model(load_scene("shaft-rig", {"film.n_theta": 96, "film.n_z": 13}))


@pytest.fixture(scope="module")
def film(rig):
    return rest(rig, SPEED)


@pytest.fixture(scope="module")
def line(rig):
    return free_line(rig, HERTZ, speed=SPEED, forces=[("second", "y")], responses=RESPONSES)


@pytest.mark.parametrize("force", [("second", "y"), (0.1, "z"), ("third", "y", "housing")])
def test_it_is_the_whole_rotors_accelerance(rig, film, force):
    scene = load_scene("shaft-rig", {"film.n_theta": 96, "film.n_z": 13})
    responses = [*RESPONSES, (4.2, "y")]
    test = free_line(rig, HERTZ, speed=SPEED, forces=[force], responses=responses)
    expected = accelerance(shaft_state(scene).rotor, HERTZ, responses, [force], speed=SPEED)
    # the free shaft is all but singular at low frequencies: six digits go there
    np.testing.assert_allclose(transfer(rig, film, test).value, expected, rtol=1e-8, atol=1e-12)


def places(found):
    return np.concatenate([found.positions, found.slopes], axis=1)


@pytest.mark.parametrize("quantity", ["bore", "viscosity", "clearance", "pedestal"])
def test_journals_shift_as_the_balance_found_anew(rig, film, quantity):
    """The shift that the slopes are made of, for each thing that moves a journal."""
    size = 1e-7 if quantity == "bore" else 1e-3
    way = size * unit_change(4, 1, quantity)
    ends = [places(rest(rig.changed(side * way), SPEED, start=film)) for side in (-1, 1)]
    found = shaft_change._shifts(rig, film, way[None])[0]
    scale = np.abs(found).max(axis=0)
    assert (np.abs((ends[1] - ends[0]) / 2 - found).max(axis=0) < 2e-3 * scale).all()


def test_shift_of_the_journals_needs_all_three_terms(rig, film):
    """Each term alone gives another answer: none is lost in the sum."""
    ways = np.zeros((3, 3, 4, 4))
    for k in range(3):
        ways[k, k, 1, 0] = (1e-6, 10.0, 1e-6)[k]
    shifts = [
        journal_shifts(rig.beam, film, bores=bores, forces=forces, gives=gives)
        for bores, forces, gives in (w[:, None] for w in ways)
    ]
    np.testing.assert_allclose(shifts[0], shifts[2], rtol=1e-9)  # a bore that sinks, and its give
    assert not np.allclose(shifts[0], shifts[1], rtol=0.1)


SIZES = {"bore": 1e-7, "viscosity": 1e-3, "clearance": 1e-3}


def differences(model, film, line, way, size):
    ends = []
    for side in (-1, 1):
        other = model.changed(side * size * way)
        balance = rest(other, SPEED, start=film)
        ends.append(transfer(other, balance, line, side * size * way).value)
    return (ends[1] - ends[0]) / (2 * size)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_slopes_of_the_accelerance_are_its_differences(rig, line, quantity):
    """On the short film, whose coefficients know no mesh."""
    smooth = replace(rig, rung="short")
    film, way = rest(smooth, SPEED), unit_change(4, 1, quantity)
    expected = differences(smooth, film, line, way, SIZES.get(quantity, 1e-4))
    films = coefficient_slopes(smooth, film, way[None], step=1e-3)
    found = transfer_slopes(smooth, line, transfer(smooth, film, line), films, way[None])[0]
    size = np.abs(expected).max(axis=(1, 2))
    assert (size > 0).all()
    # central differences of both orders 1e-3, squared, and of coefficients that are differences
    assert (np.abs(found - expected).max(axis=(1, 2)) < 5e-3 * size).all()


def test_slopes_hold_on_the_tilted_film_as_far_as_its_mesh_does(rig, film, line):
    """At low frequencies, where the film's stiffness is what counts."""
    way = unit_change(4, 1, "bore")
    expected = differences(rig, film, line, way, 3e-5)[:2]
    films = coefficient_slopes(rig, film, way[None])
    found = transfer_slopes(rig, line, transfer(rig, film, line), films, way[None])[0, :2]
    # jumps of one per cent from node to node, over a change by 20 %
    assert np.abs(found - expected).max() < 0.3 * np.abs(expected).max()


def test_gradients_of_a_film_without_tilt_leave_the_slopes_out(rig):
    stiffness, damping = coefficient_gradients(rest(replace(rig, rung="short"), SPEED))
    assert not stiffness[:, 2:].any()
    assert not damping[:, 2:].any()
    assert stiffness[:, :2, :2, :2].any()


def test_unknown_places_are_named(rig):
    with pytest.raises(ValueError, match="place = 'bow' must be a bearing: aft, second"):
        free_line(rig, HERTZ, speed=SPEED, forces=[("bow", "y")], responses=RESPONSES)
    with pytest.raises(ValueError, match=r"frequency = 0 Hz must be > 0"):
        free_line(rig, [0.0], speed=SPEED, forces=[("aft", "y")], responses=RESPONSES)
    with pytest.raises(ValueError, match="quantity = 'oil' must be one of bore"):
        unit_change(4, 0, "oil")


def test_no_change_changes_nothing(rig, film, line):
    same = transfer(rig.changed(no_change(4)), film, line, no_change(4)).value
    np.testing.assert_array_equal(same, transfer(rig, film, line).value)
