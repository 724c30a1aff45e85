"""The independent propulsion shaft of tests/benchmarks/foreign.py: film, line and record."""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from wearstate.datasets.file.record import DataSet
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.at_rest import reduced_rotor, shaft_state
from wearstate.sim.shaft.forces import harmonic_forces
from wearstate.sim.shaft_response.time_response import harmonic_response

BENCHMARKS = Path(__file__).parent / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))  # its files import one another by name

import foreign_line_draws as draws  # noqa: E402
import foreign_line_sensors as sensors  # noqa: E402
from foreign_records import write_records  # noqa: E402
from foreign_tilted_film import Bore, solve_film  # noqa: E402

NOTHING: frozenset[str] = frozenset()
RADIUS, CLEARANCE, VISCOSITY, SPEED = 0.15, 0.3e-3, 0.08, 30.0


def bore(ratio, n_psi=72, n_z=12):
    """Round, of a length over its diameter."""
    return Bore(
        radius=RADIUS,
        length=2 * RADIUS * ratio,
        gap=np.full(n_psi, CLEARANCE),
        grooved=np.zeros(n_psi, dtype=bool),
        n_z=n_z,
    )


@pytest.fixture(scope="module")
def line():
    """The modules that need ROSS."""
    pytest.importorskip("ross")
    import foreign_ross_line
    import foreign_ross_shaft

    return foreign_ross_line, foreign_ross_shaft


def nominal():
    """A line of the scene's own numbers."""
    return replace(
        draws.machine_draw(5, 0),
        clearance=draws.BEARINGS[:, 3],
        housing=draws.HOUSINGS.astype(float),
    )


def worn():
    """A worn line on a cold day."""
    return replace(
        draws.conditions_draw(5, 0),
        wear_down=0.6e-3,
        sag=0.5e-3,
        coupling_offset=1e-3,
        hull=0.3e-3,
        temperature=303.15,
    )


def same_scene(run, **more):
    """The library's scene in the same state."""
    return load_scene(
        "propulsion-shaft",
        {
            "bearings.0.wear_down": run.wear_down,
            "bearings.2.sag": run.sag,
            "coupling.parallel_offset": run.coupling_offset,
            "drive.speed": run.speed_hz,
            "drive.start_angle": run.start_angle,
            "propeller.thrust": run.thrust,
            "hull.deflection": run.hull,
            "oil.temperature": run.temperature,
            **more,
        },
    )


def test_the_nominal_numbers_are_those_of_the_scene():
    scene = load_scene("propulsion-shaft")
    propeller, coupling, limits = scene.propeller, scene.coupling, scene.wear_down
    discs, bearings = scene.discs, scene.bearings
    moments = [(r.up, r.side, r.moment_up, r.moment_side) for r in propeller.blade_rate]
    pairs = [
        (draws.SPEED, scene.drive.speed),
        (draws.GRAVITY, scene.gravity),
        ((draws.YOUNG, draws.SHEAR), (scene.shaft.young, scene.shaft.shear_modulus)),
        (draws.DENSITY, scene.shaft.density),
        (draws.DAMPING_RATIO, scene.shaft.damping_ratio),
        (draws.DAMPING_BAND, scene.shaft.damping_band),
        (draws.SECTIONS, [(s.length, s.outer_diameter) for s in scene.sections]),
        (
            draws.DISCS,
            [(d.station, d.mass, d.diametral_inertia, d.polar_inertia, d.unbalance) for d in discs],
        ),
        (draws.WATER, (discs[0].entrained_mass, discs[0].entrained_diametral)),
        (draws.BUOYANCY, discs[0].buoyancy),
        (
            draws.BEARINGS,
            [(b.station, b.diameter, b.length, b.diametral_clearance, b.rise) for b in bearings],
        ),
        (
            draws.HOUSINGS,
            [
                (h.mass, h.stiffness_up, h.stiffness_side, h.damping_up, h.damping_side)
                for h in (b.housing for b in bearings)
            ],
        ),
        (
            draws.viscosity(300.0),
            same_scene(replace(worn(), temperature=300.0)).oil.dynamic_viscosity,
        ),
        (draws.THRUST, propeller.thrust),
        (
            (draws.THRUST_HEIGHT, draws.THRUST_SIDE),
            (propeller.thrust_height, propeller.thrust_side),
        ),
        (draws.COUPLING_STIFFNESS, coupling.stiffness),
        (draws.COUPLING_BENDING, coupling.bending_stiffness),
        (sensors.BLADE_RATE[:2], moments),
        (sensors.BLADE_PHASE[:2], [(r.up_phase, r.side_phase) for r in propeller.blade_rate]),
        ((sensors.TORQUE, sensors.RING_RADIUS), (coupling.torque, coupling.ring_radius)),
        (sensors.UNEVEN_ONCE, coupling.uneven_once),
        (sensors.UNEVEN_TWICE, coupling.uneven_twice),
        (sensors.RUN_OUT, [part.amplitude for part in scene.run_out[:3]]),
        (sensors.PROBES, [probe.angle for probe in scene.probes]),
        (
            (sensors.PROBE_NOISE, sensors.PROBE_RANGE),
            (scene.probes[0].noise, scene.probes[0].range),
        ),
        ((sensors.NOISE, sensors.RANGE), (scene.sensors[0].noise, scene.sensors[0].range)),
        (2 * np.pi * sensors.PULSE_WIDTH, scene.tacho.pulse_width),
        ((sensors.SAMPLE_RATE, sensors.DURATION), (scene.sample_rate, scene.duration)),
        (sensors.GRADE_EDGES, limits.grade_edges),
        ((sensors.AS_NEW, sensors.CONDEMNING), (limits.as_new, limits.condemning)),
    ]
    for own, theirs in pairs:
        np.testing.assert_allclose(own, theirs, rtol=1e-12)


@pytest.mark.parametrize(
    ("ratio", "eccentricity", "sommerfeld", "attitude"),
    [(1.0, 0.6, 0.121, 50.58), (1.0, 0.8, 0.0446, 36.24), (0.5, 0.6, 0.319, 48.14)],
)
def test_the_film_is_that_of_raimondi_and_boyd(ratio, eccentricity, sommerfeld, attitude):
    """Trans. ASLE 1 (1958), part III, a full bearing: their film starts at the widest gap."""
    held = bore(ratio)
    held.grooved[0] = True
    found = solve_film(
        held,
        VISCOSITY,
        SPEED,
        np.array([-eccentricity * CLEARANCE, 0, 0, 0]),
    )
    load = np.hypot(*found.force[:2])
    area = 4 * RADIUS**2 * ratio
    number = VISCOSITY * SPEED / (2 * np.pi) * area / load * (RADIUS / CLEARANCE) ** 2
    assert number == pytest.approx(sommerfeld, rel=0.015)  # the mesh
    angle = np.degrees(np.arctan2(abs(found.force[1]), found.force[0]))
    assert angle == pytest.approx(attitude, abs=0.2)


def test_stiffness_is_the_slope_of_the_force_and_a_tilted_film_pushes_back():
    place = np.array([-0.15e-3, 0.08e-3, 1e-4, -0.5e-4])
    held, step = bore(2.0, 48, 8), 1e-8
    found = solve_film(held, VISCOSITY, SPEED, place)
    for k, change in enumerate(step * np.eye(4)):
        ends = [solve_film(held, VISCOSITY, SPEED, place + way * change) for way in (1, -1)]
        slope = -(ends[0].force - ends[1].force) / (2 * step)
        np.testing.assert_allclose(found.stiffness[:, k], slope, rtol=1e-4)
    assert (np.diag(found.stiffness) > 0).all()
    assert (np.linalg.eigvalsh(found.damping + found.damping.T) > 0).all()


def test_without_differences_it_lies_where_the_library_has_it(line):
    """Reactions, places and slopes; meshes of both leave 1 % of a film's force."""
    run, machine = worn(), nominal()
    rest = line[0].balance(machine, run, NOTHING)
    theirs = shaft_state(same_scene(run)).film
    force = np.array([film.force for film in rest.films])
    np.testing.assert_allclose(force[:, :2], theirs.reactions, atol=20.0)  # of 20 kN
    places = theirs.positions - np.outer(np.eye(5)[0], [run.wear_down / 2, 0])
    np.testing.assert_allclose(rest.places[:, :2], places, atol=3e-6)  # of 350 um
    np.testing.assert_allclose(rest.places[:, 2:], theirs.slopes, atol=2e-6)
    load = line[0].steady_load(machine, run, NOTHING)
    assert force[:, 0].sum() == pytest.approx(-load[::4].sum(), rel=1e-9)


def test_without_differences_it_moves_as_the_library_has_it(line):
    run, machine = worn(), nominal()
    part = replace(
        sensors.parts_draw(1),
        unbalance=draws.DISCS[:, 4].astype(complex),
        blades=4,
        uneven=(sensors.UNEVEN_ONCE, sensors.UNEVEN_TWICE, 0.0),
    )
    own = line[1].Line(machine, run, line[0].balance(machine, run, NOTHING), NOTHING)
    scene = same_scene(run, **{f"discs.{i}.unbalance_angle": 0.0 for i in range(5)})
    reduced = reduced_rotor(scene, shaft_state(scene))
    names = [bearing.name for bearing in scene.bearings]
    places = [(name, "y", "housing") for name in names]
    places += [(names[0], a, p) for p in ("shaft", "housing") for a in "yz"]
    harmonics = harmonic_forces(scene)
    theirs = harmonic_response(reduced, harmonics, places)
    theirs = np.hstack([theirs[:, :5], theirs[:, 5:7] - theirs[:, 7:9]])
    forces = line[1].order_forces(machine, part, run, NOTHING)
    for (order, force), each in zip(sorted(forces.items())[:4], theirs, strict=True):
        full = np.zeros(own.size, complex)
        full[own.shaft] = force * np.exp(1j * order * run.start_angle)
        found = own.seen(own.motion(order * run.speed_hz, full))
        # the films' damping of tilt differs by 4 %, and with it the bending modes at blade rates
        assert np.abs(found - each).max() < 0.03 * np.abs(each).max(), order


def test_every_difference_changes_the_record_and_nothing_else_is_drawn(line):
    shaft = line[1]
    machine, run = draws.machine_draw(5, 1), worn()
    plain = shaft.simulate(machine, run, NOTHING, duration=0.4)
    assert (shaft.simulate(machine, run, NOTHING, duration=0.4) == plain).all()
    for name in shaft.DIFFERENCES:
        other = shaft.simulate(machine, run, frozenset({name}), duration=0.4)
        change = np.abs(other - plain).max(axis=1) / plain.std(axis=1)
        assert change[:7].max() > 0.01, name
        assert (name == "ripple") == bool(change[7] > 0)


def test_a_file_of_a_shaft_is_read_like_any_other(line, tmp_path):
    length = 0.5  # [s]
    shaft = line[1]
    short = replace(
        shaft.SHAFT,
        make=partial(shaft.record, duration=length),
        n_samples=round(length * sensors.SAMPLE_RATE),
    )
    path = write_records(short, tmp_path / "a.h5", 2, seed=5, on=frozenset(shaft.DIFFERENCES))
    with DataSet(path) as data:
        assert data[1].names == tuple(channel.name for channel in shaft.SHAFT.head["channels"])
        assert data[0].machine == data[1].machine
        assert np.isfinite(data[1].signal).all()
        assert data.attributes.condemning_limit == sensors.CONDEMNING
