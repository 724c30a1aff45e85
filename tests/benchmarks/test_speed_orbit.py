"""Speed of the seed case's orbit by the map. Results are asserted, times are only printed.

The opponent is the source paper's method, compiled: semi-implicit Euler of step 0.02 over 140 rad,
projected over-relaxation of factor 1.96 on 72 x 17 nodes over the whole length at every step, down
to a change of 1e-5, each started from the pressure of the step before. The second opponent uses
that the film is mirrored about the middle of the length, which halves its mesh. The map is built
once for all orbits of a geometry (0.2 to 0.5 s, or 1 ms from the cache), which is not counted.
"""

import math
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.sim.film.impedance_map import impedance_map
from wearstate.sim.film.over_relaxed import PAPER_RELAXATION, relaxed_force
from wearstate.sim.film.solve import FilmGeometry, direct_film
from wearstate.sim.jit import kernel
from wearstate.sim.journal.load import load, step_history
from wearstate.sim.journal.orbit import run_orbit
from wearstate.sim.journal.orbit_film import map_film, solved_film

ALPHA, WEIGHT, JUMP = 0.83537, 0.3972, 16 * math.pi
STEP, STEPS, TOLERANCE = 0.02, 7000, 1e-5
GEOMETRY = FilmGeometry(length_to_diameter=2 / 3, n_theta=72, n_z=17)
Q = load(alpha=ALPHA, static=(WEIGHT, 0.0), **step_history(JUMP, (1.0, 0.0)))


@kernel
def relaxed_march(work, steps, record, sweeps):
    """The paper's loop."""
    x = y = u = v = 0.0
    for n in range(steps):
        record[n, 0], record[n, 1] = x, y
        f_x, f_y = relaxed_force(work, x, y, u, v, PAPER_RELAXATION, TOLERANCE, 5000)
        sweeps[0] += work.outcome[1]
        sweeps[1] += work.outcome[0] != 0
        push = WEIGHT + (1.0 if n * STEP >= JUMP else 0.0)
        u += STEP * (ALPHA * f_x + push)
        v += STEP * ALPHA * f_y
        x += STEP * u
        y += STEP * v


def opponent(steps, *, whole):
    record, sweeps = np.zeros((steps, 2)), np.zeros(2)
    relaxed_march(direct_film(GEOMETRY, tilted=whole), 2, record, sweeps)  # compile
    sweeps[:] = 0
    start = time.perf_counter()
    relaxed_march(direct_film(GEOMETRY, tilted=whole), steps, record, sweeps)
    seconds = (time.perf_counter() - start) / steps
    assert sweeps[1] == 0
    return record, seconds, sweeps[0] / steps


def by_map(film, integrator, tolerance):
    return run_orbit(
        film, Q, duration=STEP * (STEPS - 1), integrator=integrator, step=STEP, tolerance=tolerance
    )


@pytest.mark.parametrize(
    ("integrator", "tolerance"), [("euler", 1e-5), ("adaptive", 1e-4), ("adaptive", 1e-6)]
)
def test_speed_of_an_orbit(benchmark, integrator, tolerance):
    film = map_film(impedance_map(GEOMETRY), 2 / 3)
    by_map(film, integrator, tolerance)  # compile, or read the cache
    run = benchmark(by_map, film, integrator, tolerance)
    exact = run_orbit(solved_film(GEOMETRY), Q, duration=60.0, step=STEP, tolerance=1e-7)
    miss = np.abs(run.position[: len(exact.tau)] - exact.position).max()
    if integrator == "adaptive":
        assert miss < 1e-3
    else:  # the step of 0.02 itself misses by more than the map
        assert miss < 4e-3
        record, _, _ = opponent(500, whole=False)
        # the opponent stops its sweeps at 1e-5; the map's own error is 2e-4
        assert_allclose(run.position[:500], record, atol=1e-3)
    if not benchmark.enabled:
        return
    seconds = benchmark.stats.stats.median / STEPS
    print(f"\n{seconds * 1e9:.0f} ns per step of {STEP}, {miss:.1e} C from the converged orbit")
    for whole in (True, False):
        record, theirs, sweeps = opponent(STEPS, whole=whole)
        theirs_miss = np.abs(record[: len(exact.tau)] - exact.position).max()
        print(
            f"over-relaxation, {'whole' if whole else 'half'} length: {theirs * 1e6:.0f} us per "
            f"step, {sweeps:.0f} sweeps, {theirs_miss:.1e} C from it: {theirs / seconds:.0f} times"
        )
    turned = impedance_map(GEOMETRY).turned.most
    print(f"95 % of the map's forces within {100 * turned:.1f} % of direct solves on that mesh")
