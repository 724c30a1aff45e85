"""A propulsion shaft from its scene to its recording: balance, forces, channels, faults."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.sim.alignment.alignment import influence, reactions
from wearstate.sim.machine.simulate import check, simulate
from wearstate.sim.output.status import SimulationError, Status
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError, channels_of
from wearstate.sim.scene.shaft_parts import Coupling, Turbulence
from wearstate.sim.shaft.at_rest import film_bearings, reduced_rotor, shaft_state
from wearstate.sim.shaft.forces import (
    coupling_forces,
    harmonic_forces,
    random_forces,
    turbulence_density,
)
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line, hull_shape
from wearstate.sim.shaft.line_beam import coupling_loads, shaft_beam
from wearstate.sim.shaft.recording import peak_motion
from wearstate.sim.shaft_response.receptance import receptance

QUIET = {
    "propeller.blade_rate": [],
    "turbulence": [],
    "run_out": [],
    "dents": [],
    "coupling": None,
    "discs.0.unbalance": 0.0,
    "discs.1.unbalance": 0.0,
    "discs.2.unbalance": 0.0,
    "discs.3.unbalance": 0.0,
    "discs.4.unbalance": 0.0,
    **{f"sensors.{i}.noise": 0.0 for i in range(5)},
    **{f"sensors.{i}.bits": 32 for i in range(5)},
    **{f"probes.{i}.noise": 0.0 for i in range(2)},
    "duration": "2 s",
}
"""Nothing turns, pulses or hums, and converters are fine; ten revolutions."""


def ship(**values):
    """The built-in line; keywords with __ for the dots of a path."""
    return load_scene(
        "propulsion-shaft", {key.replace("__", "."): value for key, value in values.items()}
    )


def quiet(values):
    return load_scene("propulsion-shaft", {**QUIET, **values})


def faults(values, name="propulsion-shaft"):
    with pytest.raises(SceneError) as caught:
        load_scene(name, values)
    return caught.value.faults


def line_of(row, scene, order):
    """Complex amplitude of an order of a channel of whole revolutions, for exp(+j angle)."""
    angle = 2 * np.pi * scene.drive.speed * np.arange(row.size) / scene.sample_rate
    return 2 * np.mean(row.astype(float) * np.exp(-1j * order * angle))


# --- scene


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (
            {"bearings.1.station": "1.4 m"},
            "bearings.1.station = 1.4 m must be > that of bearings.0",
        ),
        ({"bearings.4.station": "17 m"}, "bearings.4.station = 17 m must be <= the shaft's length"),
        ({"discs.4.station": "17 m"}, "discs.4.station = 17 m must be <= the shaft's length"),
        ({"coupling.station": "17 m"}, "coupling.station = 17 m must be <= the shaft's length"),
        (
            {"bearings.2.diameter": "300 mm"},
            "bearings.2.diameter = 0.3 m must be that of the shaft",
        ),
        ({"bearings.2.name": "propeller"}, "bearings and discs: name 'propeller' is given 2 times"),
        ({"sensors.0.bearing": "aft"}, "sensors.0.bearing = 'aft' is no bearing; choose one of"),
        ({"probes.1.bearing": "aft"}, "probes.1.bearing = 'aft' is no bearing; choose one of"),
        ({"probes.1.name": "acc_stern_aft"}, "sensors: name 'acc_stern_aft' is given 2 times"),
        (
            {"propeller.disc": "screw"},
            "propeller.disc = 'screw' is no disc; choose one of propeller",
        ),
        ({"turbulence.1.place": "hull"}, "turbulence.1.place = 'hull' is no bearing and no disc"),
        (
            {"film.rung": "map"},
            "film.rung = 'map' is for an aligned journal; set film.rung = 'direct'",
        ),
        (
            {"film.condition": "reynolds"},
            "film.condition = 'reynolds' must be 'periodic' or 'guembel'; it holds P = 0",
        ),
        ({"film.n_z": 3}, "film.n_z = 3 must be >= 5"),
        (
            {"bearings.0.wear_down": "40 mm"},
            "bearings.0: diametral_clearance + wear_down = 0.0407 m",
        ),
        (
            {"bearings.0.lift": "0.5 mm"},
            "bearings.0: lift = 0.0005 m must be <= half of diametral_",
        ),
        (
            {"sections.0.inner_diameter": "0.4 m"},
            "sections.0: inner_diameter = 0.4 m must be < outer",
        ),
        ({"shaft.damping_band": ["9 Hz", "5 Hz"]}, "shaft: damping_band = 9 Hz, 5 Hz must be >= 0"),
        ({"bearings.0.sag": "-1 mm"}, "bearings.0.sag = -0.001 m must be >= 0"),
        ({"sensors": [], "probes": []}, "sensors and probes: both are empty"),
    ],
)
def test_a_faulty_scene_is_told_where_and_how(values, expected):
    assert any(fault.startswith(expected) for fault in faults(values)), faults(values)


def test_faults_of_many_parts_come_together():
    found = faults({"propeller.disc": "screw", "probes.0.bearing": "aft", "drive.speed": "0 rpm"})
    assert len(found) == 3


def test_channels_are_accelerations_displacements_and_the_tacho():
    channels = channels_of(ship())
    quantities = [channel.quantity for channel in channels]
    assert quantities == ["acceleration"] * 5 + ["displacement"] * 2 + ["tacho"]
    assert channels[0].place == "housing of stern_aft"
    assert channels[0].direction == "vertical, up"
    assert [channel.unit for channel in channels[4:]] == ["m/s^2", "m", "m", "V"]


def test_limits_are_what_their_comments_say():
    scene = ship()
    assert scene.wear_down.condemning == pytest.approx(0.003 * scene.bearings[0].diameter)
    line = alignment_line(ship(coupling=None))
    share = reactions(line).reactions[2] / influence(line)[2, 2]
    # nine tenths, rounded to a tenth of a millimetre
    assert scene.wear_sag.condemning == pytest.approx(0.9 * share, abs=0.05e-3)


def test_the_rig_is_in_need_of_alignment_and_the_ship_is_not():
    for name, low in (("propulsion-shaft", []), ("shaft-rig", ["third"])):
        scene = load_scene(name)
        line = alignment_line(scene)
        for condition in alignment_conditions(scene).values():
            state = reactions(line, condition)
            below = [
                seat.name
                for seat, reaction in zip(line.seats, state.reactions, strict=True)
                if reaction < seat.least_load
            ]
            assert below == low
            most = [seat.most_slope for seat in line.seats]
            assert (np.abs(state.relative_slopes) <= most).all()


# --- statics


def test_the_beam_weighs_what_its_parts_weigh():
    scene = ship(coupling=None)
    volume = sum(
        math.pi / 4 * (s.outer_diameter**2 - s.inner_diameter**2) * s.length for s in scene.sections
    )
    mass = scene.shaft.density * volume + sum(disc.mass for disc in scene.discs)
    lift = sum(disc.buoyancy for disc in scene.discs)
    # sums of a hundred terms: rounding
    assert shaft_beam(scene).weight == pytest.approx(mass * scene.gravity - lift, rel=1e-12)


def test_machines_that_differ_in_films_and_forces_share_a_beam():
    one, other = ship(), ship(discs__0__unbalance="1 kg m", bearings__0__wear_down="1 mm")
    assert shaft_beam(one).stiffness is shaft_beam(other).stiffness
    stiffer = ship(shaft__young="207 GPa")
    assert shaft_beam(one).stiffness is not shaft_beam(stiffer).stiffness


@pytest.mark.parametrize("name", ["propulsion-shaft", "shaft-rig"])
def test_reactions_balance_all_loads(name):
    """Forces and moments on the whole shaft, up and to the side."""
    state = shaft_state(load_scene(name))
    stations, load, film = state.beam.stations, state.beam.load, state.film
    at = np.array([bearing.station for bearing in film.bearings])
    for axis in (0, 1):
        force, moment = load[2 * axis :: 4], load[2 * axis + 1 :: 4]
        size = np.abs(load[0::4]).sum()
        # the film's balance leaves 1e-9 of each bearing's load, pedestals and condensation rounding
        assert abs(force.sum() + film.reactions[:, axis].sum()) < 1e-7 * size
        turning = (force * stations + moment).sum()
        turning += (film.reactions[:, axis] * at + film.moments[:, axis]).sum()
        assert abs(turning) < 1e-7 * size * stations[-1]


def test_films_carry_about_what_rigid_seats_do():
    scene = ship()
    rigid = reactions(alignment_line(scene), alignment_conditions(scene)["running"])
    film = shaft_state(scene).film
    # journals lie some hundredths of a millimetre off the lift that the scene guesses, and the
    # influence numbers are up to 12 kN/mm
    assert_allclose(film.reactions[:, 0], rigid.reactions, atol=600)


def test_a_thrust_above_the_axis_lifts_the_propeller():
    low = shaft_state(ship(propeller__thrust_height="0 mm")).film.reactions[:, 0]
    high = shaft_state(ship(propeller__thrust_height="36 mm")).film.reactions[:, 0]
    assert high[0] < low[0] - 1000
    assert high[1] > low[1] + 1000


def test_the_hull_bends_as_a_parabola_and_turns_the_bores():
    scene = ship(hull__deflection="0.4 mm")
    stations = np.array([bearing.station for bearing in scene.bearings])
    height, slope = np.array([hull_shape(scene, s) for s in stations]).T
    assert_allclose([height[0], height[-1]], 0, atol=1e-15)
    step = 1e-4
    shifted = [hull_shape(scene, s + step)[0] - hull_shape(scene, s - step)[0] for s in stations]
    # the central difference of a parabola is exact but for rounding
    assert_allclose(slope, np.array(shifted) / (2 * step), atol=1e-10)
    plain, bent = film_bearings(ship()), film_bearings(scene)
    raised = [b.offset - p.offset for b, p in zip(bent, plain, strict=True)]
    turned = [b.slope[0] - p.slope[0] for b, p in zip(bent, plain, strict=True)]
    assert_allclose(raised, 0.4e-3 * height, atol=1e-15)
    assert_allclose(turned, 0.4e-3 * slope, atol=1e-15)
    running = alignment_conditions(scene)["running"]
    assert_allclose(running.slopes, turned, atol=1e-15)


def test_conditions_hold_rise_lift_hull_and_thrust():
    found = alignment_conditions(ship())
    rise = [0, 0, 1e-4, 1e-4, 2e-4]
    assert_allclose(found["cold"].rises, 0, atol=1e-15)
    middle = [hull_shape(ship(), b.station)[0] for b in ship().bearings]
    assert_allclose(found["hot"].rises, rise + np.array(middle) * -0.3e-3, atol=1e-15)
    lift = [0.12e-3, 0.12e-3, 0.06e-3, 0.06e-3, 0.06e-3]
    assert_allclose(found["running"].rises, np.array(rise) + lift, atol=1e-15)
    assert found["hot"].loads == ()
    assert found["running"].loads[0].moment_up == pytest.approx(-350e3 * 0.036)


def test_moves_sag_and_wear_lower_and_raise_the_bore():
    scene = ship(bearings__2__sag="0.5 mm", bearings__0__wear_down="0.4 mm")
    found = film_bearings(scene, {"thrust_block": 2e-4})
    assert found[2].offset == pytest.approx(-0.5e-3 + 0.1e-3)  # hot by a tenth
    assert found[4].offset == pytest.approx(0.2e-3 + 0.2e-3)
    assert found[0].worn.clearance == pytest.approx((0.7e-3 + 0.4e-3) / 2)
    seats = alignment_line(scene).seats
    assert (seats[0].offset, seats[2].offset) == (-0.4e-3, -0.5e-3)
    with pytest.raises(ValueError, match="moves: 'thrust' is no bearing; choose one of stern_aft"):
        film_bearings(scene, {"thrust": 0.0})


def test_a_move_against_a_sag_is_none():
    sagged = ship(bearings__2__sag="0.5 mm")
    mended = shaft_state(sagged, {"intermediate_aft": 0.5e-3}).film.reactions
    # the same equations, found from the same start
    assert_allclose(mended, shaft_state(ship()).film.reactions, rtol=1e-9, atol=1e-3)


def test_a_sag_moves_load_by_the_influence_numbers():
    sag = 0.3e-3
    changes = (
        shaft_state(ship(bearings__2__sag=sag)).film.reactions[:, 0]
        - shaft_state(ship()).film.reactions[:, 0]
    )
    expected = -sag * influence(alignment_line(ship()))[:, 2]
    # films take up some of it: journals move by tens of micrometres of the 300
    assert_allclose(changes, expected, atol=0.15 * np.abs(expected).max())


# --- forces


def ring(coupling, angle, n=3600):
    """Force and moment of a ring of many elements, added up one by one."""
    phi = 2 * np.pi * np.arange(n) / n
    psi = phi + angle + coupling.uneven_phase
    share = 1 + coupling.uneven_once * np.cos(phi) + coupling.uneven_twice * np.cos(2 * phi)
    along = np.stack([-np.sin(psi), np.cos(psi)])
    outward = np.stack([np.cos(psi), np.sin(psi)])
    turn = np.array([math.cos(coupling.offset_angle), math.sin(coupling.offset_angle)])
    offset = coupling.parallel_offset * turn
    pulled = 2 * coupling.stiffness / n * share * (offset @ along)
    carried = coupling.torque / coupling.ring_radius / n * share
    bent = 2 * coupling.bending_stiffness / n * share * coupling.angle * outward[0]
    return along @ (pulled + carried), outward @ bent


def test_coupling_forces_are_those_of_a_ring_of_elements():
    part = Coupling(
        station=2.0,
        parallel_offset=0.8e-3,
        offset_angle=0.4,
        angle=1e-3,
        stiffness=2e6,
        bending_stiffness=8e4,
        torque=1e5,
        ring_radius=0.4,
        uneven_once=0.03,
        uneven_twice=0.2,
        uneven_phase=0.7,
    )
    [steady] = coupling_loads(part)
    places = ("y", "z", "slope_y", "slope_z")
    for angle in np.linspace(0, 2 * np.pi, 7):
        force, moment = ring(part, angle)
        found = dict.fromkeys(places, 0.0)
        for harmonic in coupling_forces(part):
            turned = harmonic.amplitude * np.exp(1j * harmonic.order * angle)
            found[harmonic.place[1]] += turned.real
        found["y"] += steady.up
        found["z"] += steady.side
        found["slope_y"] += steady.moment_up
        # means of harmonics over equal steps are exact
        assert_allclose([found["y"], found["z"]], force, rtol=1e-9, atol=1e-6)
        assert_allclose([found["slope_y"], found["slope_z"]], moment, rtol=1e-9, atol=1e-9)
    # across the angle the torque alone remains, half of its bend
    assert steady.moment_side == pytest.approx(-part.torque * part.angle / 2)


def test_unbalance_turns_forward_from_the_mark():
    scene = quiet({"discs.0.unbalance": "0.5 kg m", "discs.0.unbalance_angle": "90 deg"})
    [force] = harmonic_forces(scene)
    size = 0.5 * (2 * math.pi * 5) ** 2
    # at the mark the heavy spot is a quarter ahead of up: to starboard
    assert_allclose(force.forces[0.35, "y"], 1j * size, rtol=1e-12)
    assert_allclose(force.forces[0.35, "z"].real, size, rtol=1e-12)
    turned = quiet(
        {
            "discs.0.unbalance": "0.5 kg m",
            "discs.0.unbalance_angle": "0 deg",
            "drive.start_angle": "90 deg",
        }
    )
    assert_allclose(harmonic_forces(turned)[0].forces[0.35, "y"], 1j * size, rtol=1e-12)


def test_blade_rate_is_a_share_of_the_thrust():
    forces = {round(f.frequency / 5): f.forces for f in harmonic_forces(ship())}
    assert abs(forces[4][0.35, "y"]) == pytest.approx(0.012 * 350e3)
    assert abs(forces[8][0.35, "slope_y"]) == pytest.approx(0.0015 * 2.4 * 350e3)
    half = {
        round(f.frequency / 5): f.forces for f in harmonic_forces(ship(propeller__thrust=175e3))
    }
    assert abs(half[4][0.35, "z"]) == pytest.approx(0.5 * abs(forces[4][0.35, "z"]))


def test_turbulence_has_its_rms_and_its_corner():
    part = Turbulence(place="propeller", force=20.0, corner=50.0)
    hertz, density = turbulence_density(part, 1e6)
    # 200 lines, trapezoids: 0.1 %; the tail beyond 1 MHz has 3e-5
    assert np.trapezoid(density, hertz) == pytest.approx(400, rel=2e-3)
    at = np.interp([0, 50.0, 500.0], hertz, density)
    assert_allclose(at[1:] / at[0], [0.5, 1 / 101], rtol=1e-2)
    hertz, _ = turbulence_density(part, 1280.0)
    assert hertz[-1] == 1280.0
    assert len(random_forces(ship(turbulence__0__force="0 N"))) == 10


# --- recording


def test_without_forces_nothing_moves_and_probes_show_the_place_at_rest():
    scene = quiet({"bearings.0.wear_down": "0.4 mm", "probes.0.offset": "10 um"})
    solution = simulate(scene, seed=1)
    state = shaft_state(scene)
    assert not solution.signal[:5].any()
    up, side = state.film.positions[0]
    down = -(up - 0.2e-3)  # the bore's middle has sunk by half of the wear
    expected = [
        10e-6 + down * math.cos(probe.angle) - side * math.sin(probe.angle)
        for probe in scene.probes
    ]
    found = solution.signal[5:7]
    # steps of the converter of 0.36 nm, float32
    assert_allclose(found[0], expected[0], atol=1e-9)
    assert_allclose(found[1], expected[1] - 10e-6, atol=1e-9)
    assert_array_equal(np.ptp(found, axis=1), 0)


def test_wear_lowers_the_shaft_by_nearly_itself():
    """On a thin film the journal lies on the bottom of its bore, whatever the clearance."""
    places = [
        simulate(
            quiet({"bearings.0.wear_down": w, "oil.temperature": "370 K", "drive.speed": "1 Hz"}),
            seed=1,
        ).signal[5:7, 0]
        for w in (0.0, 0.2e-3)
    ]
    sunk = (places[0] - places[1]).astype(float).sum() / math.sqrt(2)  # along the line between
    assert 0.5 * 0.2e-3 < sunk < 1.1 * 0.2e-3


def test_an_unbalance_is_answered_by_the_receptance():
    scene = quiet({"discs.1.unbalance": "5 kg m", "discs.1.unbalance_angle": "20 deg"})
    solution = simulate(scene, seed=1)
    state = shaft_state(scene)
    speed = 2 * math.pi * scene.drive.speed
    force = 5 * speed**2 * np.exp(1j * math.radians(20))
    places = [(b.name, "y", "housing") for b in scene.bearings]
    places += [("stern_aft", axis, part) for part in ("shaft", "housing") for axis in "yz"]
    gain = receptance(state.rotor, [5.0], places, [(6.2, "y"), (6.2, "z")], speed=speed)[0]
    expected = gain @ [force, -1j * force]
    found = [line_of(row, scene, 1) for row in solution.signal]
    # at 5 Hz the reduced rotor is exact to 1e-6; float32 has seven digits
    assert_allclose(found[:5], -(speed**2) * expected[:5], rtol=2e-3)
    y, z = expected[5] - expected[7], expected[6] - expected[8]
    towards = [-y * math.cos(p.angle) - z * math.sin(p.angle) for p in scene.probes]
    assert_allclose(found[5:7], towards, rtol=2e-3)  # steps of 0.36 nm, of micrometres


def test_an_offset_coupling_shows_at_twice_the_speed():
    base = {"coupling": load_scene("propulsion-shaft").model_dump()["coupling"]}
    lines = []
    for offset in (0.5e-3, 1e-3):
        scene = quiet({**base, "coupling.parallel_offset": offset})
        lines.append(
            [line_of(row, scene, k) for k in (1, 2) for row in simulate(scene, seed=1).signal[4:5]]
        )
    once, twice = np.abs(lines).T
    assert twice[1] / twice[0] == pytest.approx(2, rel=0.05)  # the films follow the steady pull
    assert once[1] / once[0] == pytest.approx(1, rel=0.05)


def test_run_out_is_seen_by_the_probes_alone():
    track = [{"order": 3, "amplitude": 5e-6, "phase": 0.3}]
    scene = quiet({"run_out": track})
    solution = simulate(scene, seed=1)
    assert not solution.signal[:5].any()
    for probe, row in zip(scene.probes, solution.signal[5:7], strict=True):
        expected = 5e-6 * np.exp(1j * (0.3 - 3 * probe.angle))
        assert_allclose(line_of(row, scene, 3), expected, atol=1e-9)  # the converter's step


def test_a_dent_is_seen_by_each_probe_once_a_turn():
    dent = [{"depth": 9e-6, "width": 0.5, "angle": 0.7}]
    scene = quiet({"dents": dent})
    solution, still = simulate(scene, seed=1), simulate(quiet({}), seed=1)
    assert not solution.signal[:5].any()
    seen = solution.signal[5:7] - still.signal[5:7]
    area = 9e-6 * 0.5 / 2 / (2 * math.pi)  # of a raised cosine, over a turn
    for probe, row in zip(scene.probes, seen, strict=True):
        assert row.mean() == pytest.approx(-area, rel=0.02)
        assert row.min() == pytest.approx(-9e-6, rel=0.02)
        turn = np.exp(1j * (0.7 - probe.angle))
        assert np.angle(-line_of(row, scene, 1) / turn) == pytest.approx(0, abs=0.02)


def test_turbulence_has_the_rms_that_the_transfer_functions_give():
    scene = quiet(
        {"turbulence": [{"place": "propeller", "force": 600.0, "corner": 30.0}], "duration": "40 s"}
    )
    solution = simulate(scene, seed=3)
    state = shaft_state(scene)
    hertz, density = turbulence_density(scene.turbulence[0], 1280.0)
    fine = np.linspace(0.5, 1280, 20_000)
    places = [("stern_aft", "y", "housing")]
    gain = reduced_rotor(scene, state).receptance(fine, places, [(0.35, "y"), (0.35, "z")])[:, 0]
    power = (
        np.abs((2 * np.pi * fine[:, None]) ** 2 * gain) ** 2
        * np.interp(fine, hertz, density)[:, None]
    )
    expected = math.sqrt(np.trapezoid(power.sum(axis=1), fine))
    # 40 s of modes some hertz wide: about 100 independent values of the square
    assert solution.signal[0].std() == pytest.approx(expected, rel=0.1)


def test_the_truth_is_the_state_at_rest_and_the_motion_about_it():
    scene = ship(duration="2 s")
    solution = simulate(scene, seed=2, truth=True)
    film = shaft_state(scene).film
    truth = solution.truth
    assert truth["journal_m"].shape == truth["film_force_n"].shape == (5120, 5, 2)
    # the random part has no mean over its own, longer length: a per cent of the motion is left
    assert_allclose(truth["journal_m"].mean(axis=0), film.positions, atol=2e-6)
    assert_allclose(truth["film_force_n"].mean(axis=0), film.reactions, atol=300)
    assert_array_equal(truth["state_angle"][:1], 0)
    peak = np.linalg.norm(truth["journal_m"] - film.positions, axis=-1).max(axis=0)
    bound = peak_motion(scene, reduced_rotor(scene, shaft_state(scene)))
    assert (peak < bound).all()
    assert (peak > 0.2 * bound).all()
    # the signal does not depend on whether it is asked for
    assert_array_equal(solution.signal, simulate(scene, seed=2).signal)


def test_the_housing_hears_the_film():
    """Newton's law of a housing: film and pedestal move its mass, at each order of the blades."""
    values = {
        "propeller.blade_rate": load_scene("propulsion-shaft").model_dump()["propeller"][
            "blade_rate"
        ]
    }
    scene = quiet(values)
    solution = simulate(scene, seed=1, truth=True)
    for i, bearing in enumerate(scene.bearings):
        acceleration = line_of(solution.signal[i], scene, 4)
        force = line_of(solution.truth["film_force_n"][:, i, 0], scene, 4)
        omega = 2 * math.pi * 4 * scene.drive.speed
        place = -acceleration / omega**2
        housing = bearing.housing
        pedestal = housing.stiffness_up + 1j * omega * housing.damping_up
        # the film pushes the shaft up and the housing down
        expected = -force - pedestal * place
        # float32: 1e-7 of 0.1 m/s^2, through the pedestal
        assert_allclose(housing.mass * acceleration, expected, atol=1e-3 * abs(force))


def test_equal_seeds_give_equal_records_and_others_other_noise():
    scene = ship(duration="1 s")
    one, same, other = (simulate(scene, seed=s).signal for s in (5, 5, 6))
    assert_array_equal(one, same)
    assert (one[:7] != other[:7]).any(axis=1).all()
    assert_array_equal(one[7], other[7])


def test_numerics_tell_how_good_it_is():
    numerics = simulate(ship(duration="1 s"), seed=1).numerics
    assert numerics["rung_film"] == "direct"
    assert numerics["residual"] < 1e-8
    assert 0 < numerics["motion_share"] < 0.3
    assert numerics["min_film_m"] > 100e-6
    assert numerics["least_reaction_n"] > 10e3


def test_the_mesh_is_fine_enough():
    plain = shaft_state(ship()).film
    fine = shaft_state(ship(film__n_theta=96, film__n_z=25)).film
    assert_allclose(plain.reactions[:, 0], fine.reactions[:, 0], rtol=1e-3)


# --- faults of a run


def test_a_lifted_bearing_is_a_warning():
    solution = simulate(ship(bearings__2__sag="1.8 mm", duration="1 s"), seed=1)
    assert solution.status is Status.OK
    warning, short = solution.warnings
    assert short.startswith("duration = 1 s holds 5 revolutions")
    assert warning.startswith("bearing 'intermediate_aft' carries -5")
    assert solution.numerics["least_reaction_n"] < 0


def test_large_motion_is_a_warning_then_a_failure():
    warned = simulate(ship(discs__0__unbalance="50 kg m", duration="1 s"), seed=1)
    assert any("of its least film" in warning for warning in warned.warnings)
    scene = ship(discs__0__unbalance="200 kg m", duration="1 s")
    failed = simulate(scene, seed=1, raise_on_failure=False)
    assert failed.status is Status.LINE_MOTION
    assert not failed.signal.any()
    with pytest.raises(
        SimulationError, match="bearing 'stern_forward': line motion: the journal would"
    ):
        simulate(scene, seed=1)


def test_a_line_that_whirls_is_a_failure():
    with pytest.raises(SimulationError, match="line unstable: the line is unstable on its films"):
        simulate(ship(drive__speed="3000 rpm", sample_rate="5.12 kHz"), seed=1)


def test_a_shaft_on_the_edge_of_its_bore_names_the_bearing():
    with pytest.raises(SimulationError, match="bearing 'stern_aft': line edge: the shaft touches"):
        simulate(ship(bearings__0__slope=0.004), seed=1)


def test_clipping_is_told():
    solution = simulate(ship(sensors__0__range="0.1 m/s^2", duration="1 s"), seed=1)
    assert solution.numerics["clipped_samples"] > 0
    assert any("samples clipped" in warning for warning in solution.warnings)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"duration": "0.1 s"}, "duration = 0.1 s must be >= one revolution = 0.2 s"),
        ({"sample_rate": "80 Hz"}, "sample_rate = 80 Hz must be >= 85 Hz, 17 samples a revolution"),
        ({"tacho.pulse_width": "0.5 deg"}, "tacho.pulse_width = 0.00872665 rad must last >= 2"),
        ({"duration": "3600 s"}, "duration = 3600 s at sample_rate = 2560 Hz needs 14.7 GB"),
        ({"discs.0.station": "1.2501 m"}, "stations"),
    ],
)
def test_what_only_the_physics_can_tell(values, expected):
    with pytest.raises(SceneError) as caught:
        check(load_scene("propulsion-shaft", values))
    assert any(expected in fault for fault in caught.value.faults), caught.value.faults
