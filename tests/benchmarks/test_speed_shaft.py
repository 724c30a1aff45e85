"""Speed of a shaft line of 100 elements on 8 bearings, and against ROSS ``run_freq_response``.

The opponent is ross-rotordynamics 2.3.0 (with plotly < 6) of the interpreter in the environment
variable ``ROSS_PYTHON``, by default this one; without it that part is skipped. Both have the same
shaft (100 Timoshenko elements with Cowper's coefficient, a propeller, eight bearings of eight
coefficients to the ground), the speed of each line equal to its frequency, one thread; the two
transfer functions agree to 1e-12 of a line's largest entry. ROSS assembles the matrices anew for
each line and inverts the whole dynamic stiffness, dense, with axial and torsional coordinates,
606 in all; of its answer the same 16 x 16 entries are used. Its time of a line does not depend on
the count of lines, so that 8 are enough (2,000 of its results would take 35 GB).

Measured on one core of a shared two-core machine (AMD EPYC, Python 3.11, numpy 2.4), quiet: 70 to
110 ms a line for ROSS, 0.09 ms for :func:`receptance` (0.11 ms with housings and shaft damping),
0.009 ms for the reduced rotor; busy, 156 against 0.18 ms and 288 against 0.27 ms, 850 and 1,070
times. Most of the factor is the sparse matrix: scipy's SuperLU takes 0.7 ms a line on it.
"""

import json
import math
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from threadpoolctl import threadpool_limits
from wearstate.sim.alignment.alignment import AlignmentLine, influence, reactions
from wearstate.sim.alignment.seats import Seat
from wearstate.sim.beam.beam import assemble_beam
from wearstate.sim.beam.beam_parts import Disc, Section
from wearstate.sim.beam.rotor import Rotor, Support
from wearstate.sim.fidelity.ladder import effects_of
from wearstate.sim.machine.simulate import recorder, simulate
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.rungs import admissible, with_values
from wearstate.sim.shaft_response.receptance import receptance
from wearstate.sim.shaft_response.reduced import free_basis, reduce_rotor
from wearstate.sim.shaft_response.time_response import Broadband, Harmonic, time_response

ELEMENTS, LENGTH, DIAMETER = 100, 40.0, 0.4
NODES = (5, 17, 29, 41, 53, 65, 77, 89)
STATIONS = tuple(LENGTH / ELEMENTS * k for k in NODES)
NAMES = tuple("abcdefgh")
STIFFNESS = np.array([[8e8, 3e8], [-2e8, 1.2e9]])
DAMPING = np.array([[4e6, -1e6], [-1e6, 6e6]])
LINES = np.linspace(1.0, 100.0, 2000)
THEIR_LINES = np.linspace(2.0, 90.0, 8)
JOURNALS = [(name, axis) for name in NAMES for axis in "yz"]
HOUSINGS = [(name, "y", "housing") for name in NAMES]

OPPONENT = """
import json, os, time, warnings
os.environ["OPENBLAS_NUM_THREADS"] = "1"
warnings.simplefilter("ignore")
import numpy as np
import ross as rs
steel = rs.Material("steel", rho=7850, E=2.06e11, G_s=7.92e10)
shaft = [rs.ShaftElement(n=k, L=0.4, idl=0, odl=0.4, material=steel, shear_effects=True,
                         rotary_inertia=True, gyroscopic=True) for k in range(100)]
nodes = (5, 17, 29, 41, 53, 65, 77, 89)
bearings = [rs.BearingElement(n=k, kxx=8e8, kyy=1.2e9, kxy=3e8, kyx=-2e8, cxx=4e6, cyy=6e6,
                              cxy=-1e6, cyx=-1e6) for k in nodes]
rotor = rs.Rotor(shaft, [rs.DiskElement(n=0, m=8000, Id=3000, Ip=5000)], bearings)
omega = 2 * np.pi * np.linspace(2.0, 90.0, 8)
rotor.run_freq_response(speed_range=omega[:2])
seconds = []
for shift in (1e-9, 2e-9, 0.0):  # it remembers what it was asked before
    start = time.perf_counter()
    found = rotor.run_freq_response(speed_range=omega * (1 + shift))
    seconds.append(time.perf_counter() - start)
at = [6 * k + axis for k in nodes for axis in (0, 1)]
h = found.freq_resp[np.ix_(at, at)]
print(json.dumps({"seconds_per_line": min(seconds) / omega.size,
                  "real": h.real.tolist(), "imag": h.imag.tolist()}))
"""


def beam():
    return assemble_beam(
        [
            Section(
                length=LENGTH,
                outer_diameter=DIAMETER,
                young=2.06e11,
                shear_modulus=7.92e10,
                density=7850.0,
            )
        ],
        discs=[Disc(station=0.0, mass=8000.0, polar_inertia=5000.0, diametral_inertia=3000.0)],
        stations=STATIONS,
        longest_element=LENGTH / ELEMENTS,
        theory="timoshenko",
        shear_coefficient="cowper",
    )


def line(damping_ratio=0.0, **pedestal):
    return Rotor(
        beam=beam(),
        supports=[
            Support(name=name, station=s, stiffness=STIFFNESS, damping=DAMPING, **pedestal)
            for name, s in zip(NAMES, STATIONS, strict=True)
        ],
        damping_ratio=damping_ratio,
        damping_band=(1.0, 100.0) if damping_ratio else None,
    )


def on_pedestals():
    return line(
        damping_ratio=0.005,
        housing_mass=1500.0,
        pedestal_stiffness=(2e9, 1e9),
        pedestal_damping=(1e5, 2e5),
    )


def timed(benchmark, function, *arguments, **options):
    """On one thread; the result, and the median in seconds or None."""
    with threadpool_limits(1):
        result = benchmark(function, *arguments, **options)
    return result, benchmark.stats.stats.median if benchmark.enabled else None


def test_speed_of_the_assembly(benchmark):
    found, seconds = timed(benchmark, beam)
    assert found.stations.size == ELEMENTS + 1
    if seconds:
        print(f"\n{1e3 * seconds:.2f} ms")


def test_speed_of_reactions_and_influence(benchmark):
    shaft = beam()
    seats = tuple(
        Seat(name=name, station=s, stiffness=1e9) for name, s in zip(NAMES, STATIONS, strict=True)
    )

    def both():
        own = AlignmentLine(beam=shaft, seats=seats)
        state = reactions(own)
        return state, influence(own, state)

    (state, matrix), seconds = timed(benchmark, both)
    # equilibrium, to the rounding of a shaft of 100 elements
    assert_allclose(state.reactions.sum(), shaft.weight, rtol=1e-8)
    assert_allclose(matrix.sum(axis=1), 0, atol=1e-6 * np.abs(matrix).max())
    if seconds:
        print(f"\n{1e3 * seconds:.2f} ms")
        assert seconds <= 0.020


@pytest.mark.parametrize("housings", [False, True])
def test_speed_of_the_receptance(benchmark, housings):
    rotor = on_pedestals() if housings else line()
    places = HOUSINGS if housings else JOURNALS
    found, seconds = timed(benchmark, receptance, rotor, LINES, places, JOURNALS, speed=10.0)
    assert found.shape == (LINES.size, len(places), len(JOURNALS))
    if seconds:
        print(f"\n{1e3 * seconds / LINES.size:.3f} ms a line, {LINES.size} lines")


def test_speed_of_the_reduced_rotor(benchmark):
    rotor = on_pedestals()
    with threadpool_limits(1):
        start = time.perf_counter()
        basis = free_basis(rotor.beam, limit_hz=300.0, stations=(0.0, *STATIONS), slopes=False)
        middle = time.perf_counter()
        reduced = reduce_rotor(rotor, basis, speed=10.0)
        end = time.perf_counter()
    _, seconds = timed(benchmark, reduced.receptance, LINES, HOUSINGS, JOURNALS)
    error = reduced.measured_error(LINES[::200], HOUSINGS, JOURNALS)
    assert error < 1e-3  # up to a third of the limit
    if seconds:
        print(
            f"\n{1e3 * seconds / LINES.size:.4f} ms a line, basis {1e3 * (middle - start):.0f} ms, "
            f"reduction {1e3 * (end - middle):.0f} ms, error {error:.1e}"
        )


def test_speed_of_a_record(benchmark):
    """Four seconds, eight channels at 25.6 kHz, orders of the shaft and two broadband forces."""
    rotor = on_pedestals()
    basis = free_basis(rotor.beam, limit_hz=300.0, stations=(0.0, *STATIONS), slopes=False)
    orders = [
        Harmonic(frequency=order * 10 / (2 * math.pi), forces={(0.0, "y"): 1e3, (0.0, "z"): -1e3j})
        for order in range(1, 11)
    ]
    noise = [
        Broadband(frequencies=[1.0, 500.0], density=[1.0, 1.0], forces={(0.0, axis): 1.0})
        for axis in "yz"
    ]

    def record():
        reduced = reduce_rotor(rotor, basis, speed=10.0)
        return time_response(
            reduced,
            HOUSINGS,
            n_samples=102_400,
            sample_rate=25_600.0,
            harmonics=orders,
            broadband=noise,
            seed=1,
        )

    found, seconds = timed(benchmark, record)
    assert found.shape == (8, 102_400)
    if seconds:
        print(f"\n{1e3 * seconds:.0f} ms")
        assert seconds <= 0.3


def test_speed_of_starts_that_share_their_state_of_rest(benchmark):
    """Eight starts of the rig on its best rungs, as ``auto`` and ``chart`` run them, beside
    eight recordings that each solve the line anew."""
    scene = load_scene("shaft-rig", {"duration": "1 s"})
    best = {p: v for e in effects_of(scene) for p, v in admissible(e, scene)[-1].values.items()}
    scene = with_values(scene, best)
    alone = simulate(scene, seed=7)  # compile, or read the cache
    begin = time.perf_counter()
    for seed in range(8):
        simulate(scene, seed=seed)
    took = time.perf_counter() - begin

    def shared():
        record = recorder(scene)
        return [record(scene, seed, False, True) for seed in range(8)]

    found, seconds = timed(benchmark, shared)
    assert_array_equal(found[7].signal, alone.signal)
    if seconds:
        print(f"\n{1e3 * seconds:.0f} ms together, {took / seconds:.1f} times as long each alone")


def test_speed_against_ross(benchmark):
    if not benchmark.enabled:
        pytest.skip("measured with --benchmark-enable only")
    python = os.environ.get("ROSS_PYTHON", sys.executable)
    done = subprocess.run([python, "-c", OPPONENT], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"{python} has no ross-rotordynamics; set ROSS_PYTHON")
    opponent = json.loads(done.stdout.splitlines()[-1])
    rotor = line()
    _, seconds = timed(
        benchmark, receptance, rotor, LINES, JOURNALS, JOURNALS, speed=2 * math.pi * LINES
    )
    own = receptance(rotor, THEIR_LINES, JOURNALS, JOURNALS, speed=2 * math.pi * THEIR_LINES)
    theirs = np.array(opponent["real"]) + 1j * np.array(opponent["imag"])
    largest = np.abs(own).max(axis=(1, 2), keepdims=True)
    # rounding, by a condition of 1e4
    assert_allclose(own / largest, np.moveaxis(theirs, -1, 0) / largest, atol=1e-11)
    ratio = opponent["seconds_per_line"] / (seconds / LINES.size)
    print(
        f"\n{1e3 * opponent['seconds_per_line']:.0f} ms a line of ROSS, "
        f"{1e3 * seconds / LINES.size:.3f} ms own: {ratio:.0f} times as long"
    )
    assert ratio >= 20
