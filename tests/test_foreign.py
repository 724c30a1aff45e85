"""A sample of tests/benchmarks/foreign.py: the independent pump is physical, its file is read."""

import runpy
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from wearstate.datasets.file.record import DataSet
from wearstate.diagnose.command_line.cli import cli
from wearstate.sim.scene.load import load_scene

BENCHMARKS = Path(__file__).parent / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))  # its files import one another by name

import foreign_casing as casing  # noqa: E402
import foreign_pump as pump  # noqa: E402
from foreign_records import Job, write_records  # noqa: E402

NOTHING: frozenset[str] = frozenset()
EVERYTHING = frozenset(pump.DIFFERENCES)
STEP = 1 / (pump.SAMPLE_RATE * pump.STEPS)
LENGTH = 0.8  # of a record [s]: four revolutions
TURN = round(1 / pump.SPEED / STEP)  # steps


def of(machine=None, run=None, on=NOTHING, **replaced):
    """Kernel's parameters of machine 0 at nominal speed and pressure, some replaced."""
    machine = machine or pump.machine_draw(5, 0)
    run = run or nominal()
    return pump.mechanism(machine, run, on)._replace(**replaced)


def nominal(clearance=0.2e-3):
    return pump.Conditions(
        diametral_clearance=clearance,
        speed_hz=pump.SPEED,
        discharge=pump.DISCHARGE,
        start_angle=0.3,
        seed=1,
    )


def start():
    return pump.start_state(0.3, 2 * np.pi * pump.SPEED)


def ideal_forces(angle, m):
    """Forces on bearing x and y, guide and cylinder of a crank without clearance.

    By D'Alembert on rod and piston, accelerations by central differences of the positions.
    """
    w, h = 2 * np.pi * pump.SPEED, 1e-4

    def places(a):
        b = np.arcsin(pump.RADIUS / pump.LENGTH * np.sin(a))
        x = pump.RADIUS * np.cos(a) + pump.LENGTH * np.cos(b)
        s = pump.ROD_CENTRE
        return np.array([x, x - s * np.cos(b), s * np.sin(b), b])

    piston, rod_x, rod_y, turn = (
        w**2 * (places(angle + h) - 2 * places(angle) + places(angle - h)) / h**2
    )
    load = np.array([pump.pressure(a, m) for a in angle]) * pump.AREA
    wrist_x = pump.PISTON_MASS * (piston + pump.GRAVITY) + load  # from the rod on the piston
    pin_x = pump.ROD_MASS * (rod_x + pump.GRAVITY) + wrist_x
    b, s, rest = places(angle)[3], pump.ROD_CENTRE, pump.LENGTH - pump.ROD_CENTRE
    # moments about the rod's centre; pin at -rest cos b, rest sin b, wrist at s cos b, -s sin b
    known = pump.ROD_INERTIA * turn - rest * np.sin(b) * pin_x - s * np.sin(b) * wrist_x
    inertia_y = pump.ROD_MASS * rod_y  # pin_y + guide_y
    pin_y = (known + s * np.cos(b) * inertia_y) / (pump.LENGTH * np.cos(b))
    return np.column_stack([-pin_x, -pin_y, -(inertia_y - pin_y), load])


def test_the_nominal_numbers_are_those_of_the_scene():
    scene = load_scene("bilge-pump")
    pin, motor = scene.joint.crankpin, scene.drive.motor
    pairs = [
        (pump.RADIUS, scene.crank.radius),
        (pump.LENGTH, scene.rod.length),
        (pump.ROD_MASS, scene.rod.mass),
        (pump.ROD_CENTRE, scene.rod.centre_of_mass),
        (pump.ROD_INERTIA, scene.rod.inertia),
        (pump.PISTON_MASS, scene.piston.mass),
        (pump.BORE, scene.piston.diameter),
        (pump.GRAVITY, scene.gravity),
        (pump.SPEED, scene.drive.speed),
        (pump.SUCTION, scene.pressure.suction),
        (pump.DISCHARGE, scene.pressure.discharge),
        (pump.RISE_ANGLE, scene.pressure.rise_angle),
        (2 * pump.PIN_RADIUS, pin.pin_diameter),
        (pump.STIFFNESS, pin.stiffness),
        (pump.DAMPING, pin.damping),
        (pump.FRICTION, pin.friction),
        (pump.FRICTION_SPEED, pin.friction_speed),
        (pump.DRAG, pin.tangential_damping),
        (pump.SYNCHRONOUS, scene.drive.synchronous_speed),
        (pump.BREAKDOWN_MOMENT, motor.breakdown_moment),
        (pump.BREAKDOWN_SLIP, motor.breakdown_slip),
        (pump.INERTIA, motor.inertia),
        (pump.SAMPLE_RATE, scene.sample_rate),
        (pump.DURATION, scene.duration),
        (pump.SETTLING, scene.settling_revolutions),
        (pump.AS_NEW, scene.wear.as_new_diametral),
        (pump.GRADE_EDGES, scene.wear.grade_edges_diametral),
        (casing.FREQUENCY, [mode.frequency for mode in scene.casing.modes]),
        (casing.DAMPING_RATIO, [mode.damping_ratio for mode in scene.casing.modes]),
        (casing.SHAPES, [[mode.shape[p] for p in casing.PLACES] for mode in scene.casing.modes]),
        (casing.NOISE, scene.sensors[0].noise),
        (casing.RANGE, scene.sensors[0].range),
        (2 * np.pi * casing.PULSE_WIDTH, scene.tacho.pulse_width),
        (casing.LEVEL, scene.tacho.level),
    ]
    for own, theirs in pairs:
        np.testing.assert_allclose(own, theirs, rtol=1e-12)


def test_without_clearance_it_is_the_ideal_crank():
    m = of(clearance=1e-7, coulomb=0.0, drag=0.0)
    forces, states = pump.march(start(), m, STEP, 2 * TURN)
    angle, forces = states[TURN:, 0], forces[TURN:]
    ideal_x = pump.RADIUS * np.cos(angle) + np.sqrt(
        pump.LENGTH**2 - (pump.RADIUS * np.sin(angle)) ** 2
    )
    # the pin sinks into its eye by force over stiffness: 3 kN on 140 MN/m
    assert np.abs(states[TURN:, 2] - ideal_x).max() < 40e-6
    ideal = ideal_forces(angle, m)
    off = np.sqrt(np.mean((forces - ideal) ** 2, axis=0) / np.mean(ideal**2, axis=0))
    # what is left rings at the pin's stiffness after the pressure has changed
    assert off[0] < 0.02
    assert (off < 0.05).all()


@pytest.mark.parametrize("more", [("contact",), (), ("contact", "loose"), ("oval",)])
def test_nothing_lost_without_losses(more):
    """The energy of crank, rod, piston and contacts stays, while a free crank knocks."""
    on = frozenset({"ripple", *more})
    m = of(on=on, coulomb=0.0, drag=0.0, loss=0.0, moment=0.0, bore_loss=0.0, bore_friction=0.0)
    m = m._replace(suction=0.0, discharge=0.0, inertia=4.0)
    _, states = pump.march(start(), m, STEP, 2 * TURN)
    book = np.array([energy(y, m) for y in states[::7]])
    apart = np.array([overlap(y, m) for y in states]) < 0
    assert 0.02 < apart.mean() < 0.98  # it does knock
    piston = 0.5 * pump.PISTON_MASS * states[:, 3] ** 2
    assert np.ptp(book) < 2e-3 * np.ptp(piston)  # third order, 8 steps a sample


@pytest.mark.parametrize("on", [NOTHING, EVERYTHING])
def test_friction_and_damping_only_take(on):
    """Of a crank that runs free, without motor and pressure."""
    m = of(on=on | {"ripple"}, moment=0.0, suction=0.0, discharge=0.0, coulomb=0.3)
    _, states = pump.march(start(), m, STEP, TURN)
    book = np.array([energy(y, m) for y in states[::7]])
    assert book[-1] < 0.9 * book[0]
    assert np.diff(book).max() < 1e-4 * book[0]  # rounding and the order of the steps


def energy(y, m):
    """Kinetic, potential and elastic energy of a state [J]."""
    _, w, x, u, b, v = y[:6]
    crank = 0.5 * m.crank_mass * y[8:] @ y[8:] + m.crank_mass * pump.GRAVITY * y[6]
    bore = max(np.hypot(y[6], y[7]) - m.play, 0.0) ** 2.5 * m.bore_elastic / 2.5
    s = pump.ROD_CENTRE
    rod = np.array([u + s * np.sin(b) * v, s * np.cos(b) * v])
    kinetic = 0.5 * (m.inertia * w**2 + pump.PISTON_MASS * u**2)
    kinetic += 0.5 * (pump.ROD_MASS * rod @ rod + pump.ROD_INERTIA * v**2)
    weight = pump.GRAVITY * (pump.PISTON_MASS * x + pump.ROD_MASS * (x - s * np.cos(b)))
    depth, power = max(overlap(y, m), 0.0), 2.5 if m.hertzian else 2.0
    return kinetic + weight + m.elastic * depth**power / power + crank + bore


def overlap(y, m):
    """Of pin and eye [m]."""
    gap_x = y[6] + pump.RADIUS * np.cos(y[0]) - y[2] + pump.LENGTH * np.cos(y[4])
    gap_y = y[7] + pump.RADIUS * np.sin(y[0]) - pump.LENGTH * np.sin(y[4])
    along = gap_x * np.cos(y[4]) - gap_y * np.sin(y[4])
    across = gap_x * np.sin(y[4]) + gap_y * np.cos(y[4])
    return np.hypot(along - np.clip(along, 0.0, m.slot), across) - m.clearance


def test_the_clearance_of_an_oval_eye_is_that_along_its_rod():
    m = of(on=frozenset({"oval"}))
    assert 0 < m.slot < 0.15e-3
    assert 2 * m.clearance + m.slot == pytest.approx(0.2e-3)


def test_bearings_with_play_carry_what_the_pin_does_and_the_crank_weighs():
    m = of(on=frozenset({"loose"}))
    loose, _ = pump.march(start(), m, STEP, 3 * TURN)
    tight, _ = pump.march(start(), m._replace(crank_mass=0.0), STEP, 3 * TURN)
    found, known = (forces[TURN:, 0].mean() for forces in (loose, tight))
    assert found == pytest.approx(known - m.crank_mass * pump.GRAVITY, rel=2e-3)


def test_an_impact_leaves_with_the_restitution():
    elastic, loss = pump.hunt_crossley(pump.STIFFNESS, 0.4)
    m = of(on=EVERYTHING)._replace(elastic=elastic, loss=loss)
    depth, rate, step = 0.0, pump.IMPACT_SPEED, 1e-8
    while depth >= 0.0:  # a mass of 2 kg, symplectic Euler
        rate -= step * pump.normal(depth, rate, m) / 2.0
        depth += step * rate
    assert -rate / pump.IMPACT_SPEED == pytest.approx(0.4, abs=2e-3)


def test_every_difference_changes_the_record_and_nothing_else_is_drawn():
    machine, run = pump.machine_draw(5, 1), replace(nominal(), seed=3)

    def heard(on):
        forces, angle, settled = pump.simulate(machine, run, on, duration=0.3)
        return casing.signal(
            forces, angle, settled, pump.STEPS, pump.SAMPLE_RATE, machine.seed, run.seed, on
        )

    plain = heard(NOTHING)
    assert (heard(NOTHING) == plain).all()
    for name in pump.DIFFERENCES:
        other = heard(frozenset({name}))
        assert np.sqrt(np.mean((other - plain)[:2] ** 2)) > 0.01
        assert (name == "ripple") == bool((other[2] != plain[2]).any())


def test_tacho_tells_the_speed_of_the_crank():
    steps, rate, speed = 8, 25600.0, 4.3217
    angle = 1.0 + 2 * np.pi * speed * np.arange(round(2.0 * rate) * steps) / (rate * steps)
    pulses = casing.tacho(angle, steps, rate)
    assert pulses.mean() == pytest.approx(casing.LEVEL * casing.PULSE_WIDTH, rel=0.08)
    rising = np.flatnonzero((pulses[1:] >= 2.5) & (pulses[:-1] < 2.5))
    assert np.diff(rising).mean() == pytest.approx(rate / speed, abs=0.2)


def test_a_file_of_two_pumps_is_read_like_any_other(tmp_path):
    short = replace(
        pump.PUMP_A,
        make=partial(pump.record, duration=LENGTH),
        n_samples=round(LENGTH * pump.SAMPLE_RATE),
    )
    path = write_records(short, tmp_path / "a.h5", 2, seed=5, on=EVERYTHING)
    new = write_records(short, tmp_path / "new.h5", 2, seed=5, on=NOTHING, healthy=1)
    job = Job(seed=5, machine=0, record=1, healthy=False, on=EVERYTHING)
    with DataSet(path) as one, DataSet(new) as healthy:
        assert (one[1].signal == short.make(job)[0]).all()
        assert set(healthy.machines) == set(one.machines) == {one[0].machine}
        assert healthy.manifest["grade"].tolist() == [0]
        assert one[0].names == ("acc_x", "acc_y", "tacho")
    table = tmp_path / "table.csv"
    for command in (["info", path, "--verify"], ["features", path, "-o", table]):
        told = CliRunner().invoke(cli, [str(word) for word in command], catch_exceptions=False)
        assert told.exit_code == 0, told.output
    rows = table.read_text().splitlines()
    assert len(rows) == 3
    assert len(rows[0].split(",")) > 500


def test_two_independent_mechanisms_agree():
    """Lagrange's equations here, rigid bodies of Exudyn there."""
    pytest.importorskip("exudyn")
    import foreign_exudyn as other

    machine, run = pump.machine_draw(5, 2), replace(nominal(), diametral_clearance=0.3e-3)
    found = []
    for simulate in (pump.simulate, other.simulate):
        forces, angle, settled = simulate(machine, run, NOTHING, duration=0.4)
        kept = forces[settled:]
        assert angle[settled] == pytest.approx(run.start_angle)
        found.append(np.sqrt(np.mean(kept**2, axis=0)))
    assert found[1][3] == pytest.approx(found[0][3], rel=1e-4)  # as many steps to a transition
    # knocks are chaotic, and the contact of Exudyn opens later
    assert found[1][[0, 2]] == pytest.approx(found[0][[0, 2]], rel=0.02)
    assert found[1][1] == pytest.approx(found[0][1], rel=0.05)


def test_the_journal_turns_about_the_equilibrium_of_its_film():
    pytest.importorskip("ross")
    import foreign_ross as journal

    run = replace(journal.conditions_draw(5, 0), diametral_clearance=0.24e-3)
    place, stiffness, damping = journal.film(run, thermal=False)
    # the load pushes along X, the film drives the journal on in the direction of rotation
    assert 0 < place[1] < place[0] * 2
    assert 0.3 < np.hypot(*place) / 0.12e-3 < 0.9
    omega = 2 * np.pi * run.speed_hz
    amplitude = journal.orbit(stiffness, damping, journal.UNBALANCE, omega)
    # far stiffer than a free mass, whose amplitude is the unbalance over the mass
    assert 0.02 < np.abs(amplitude).max() * journal.MASS / journal.UNBALANCE < 2.0
    free = journal.orbit(0 * stiffness, 0 * damping, journal.UNBALANCE, omega)
    assert np.abs(free) == pytest.approx(journal.UNBALANCE / journal.MASS)


def test_the_nominal_numbers_of_the_journal_are_those_of_its_scene():
    import foreign_ross as journal

    scene = load_scene("journal-bearing")
    pairs = [
        (journal.SPEED, scene.drive.speed),
        (journal.DIAMETER, scene.bearing.diameter),
        (journal.LENGTH, scene.bearing.length),
        (journal.VISCOSITY, scene.oil.viscosity),
        (journal.MASS, scene.rotor.mass),
        (journal.UNBALANCE, scene.rotor.unbalance),
        (journal.GRAVITY, scene.gravity),
        (journal.STATIC_LOAD, scene.load.static),
        (journal.RUN_OUT, [part.amplitude for part in scene.rotor.run_out[:3]]),
        (journal.PROBES, [probe.angle for probe in scene.sensors]),
        (journal.NOISE, scene.sensors[0].noise),
        (journal.RANGE, scene.sensors[0].range),
        (2 * np.pi * journal.PULSE_WIDTH, scene.tacho.pulse_width),
        (journal.SAMPLE_RATE, scene.sample_rate),
        (journal.DURATION, scene.duration),
        (journal.AS_NEW, scene.wear.as_new_diametral),
        (journal.GRADE_EDGES, scene.wear.grade_edges_diametral),
    ]
    for own, theirs in pairs:
        np.testing.assert_allclose(own, theirs, rtol=1e-12)


def test_judge_counts_what_it_says():
    script = runpy.run_path(str(BENCHMARKS / "foreign.py"))
    from wearstate.diagnose.learning.scores import point_judged

    truth = np.array([1e-4, 2e-4, 4e-4, 4e-4])
    found = point_judged(
        np.arange(4),
        truth,
        truth + np.array([1, -1, -3, 0]) * 31e-6,
        np.array([0, 1, 1, 3]),
        4,
        graded=np.array([True, True, False, True]),
    )
    told = {
        name: round(one.value, 6) for name, one in script["figures"](found, 310e-6, 310e-6).items()
    }
    assert told["error_all"] == 0.125
    assert told["bias_all"] == -0.075
    assert told["error_graded"] == round(0.2 / 3, 6)
    assert told["missed_all"] == 0.5
    assert told["missed_graded"] == 0.0
    assert told["refused"] == 0.25
