"""Speed of an equilibrium with its eight coefficients, and against ROSS ``PlainJournal``.

The opponent is ross-rotordynamics 2.3.0 (with plotly < 6) of the interpreter in the environment
variable ``ROSS_PYTHON``, by default this one; without it that part is skipped. It is timed on the
example of its own documentation, 11 x 3 volumes on each of two pads, which is not converged on its
mesh: between 11 x 3, 22 x 6 and 44 x 12 its eccentricity ratio goes .687, .659, .652 and its cross
stiffness Kxy .34, .17, .26 GN/m, that is 5 % and 30 % off on the documented mesh; on 44 x 12 it
takes ten times as long. It also solves for the temperature of the oil, iterating the viscosity,
which is left out here; both find the equilibrium and eight coefficients.
"""

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from wearstate.sim.bearing.coefficients import coefficients
from wearstate.sim.bearing.equilibrium import equilibrium
from wearstate.sim.film.solve import FilmGeometry, Groove

RADIUS, LENGTH, CLEARANCE, SPEED, LOAD = 0.2, 0.263144, 195e-6, 2 * math.pi * 15, 112814.91
VISCOSITY = 0.02  # Pa s, of ISO VG 32 at about 50 degrees Celsius
MESH = (180, 17)  # a line every 2 degrees, so that a groove is as wide as it says

OPPONENT = """
import json, time, warnings
warnings.simplefilter("ignore")
from ross.bearings.plain_journal import PlainJournal
from ross.units import Q_
def run():
    return PlainJournal(
        n=3, axial_length=0.263144, journal_radius=0.2, radial_clearance=1.95e-4,
        elements_circumferential=11, elements_axial=3, n_pad=2, pad_arc_length=176, preload=0,
        geometry="circular", reference_temperature=50, frequency=Q_([900], "RPM"), fxs_load=0,
        fys_load=-112814.91, groove_factor=[0.52, 0.48], lubricant="ISOVG32", sommerfeld_type=2,
        initial_guess=[0.1, -0.1], method="perturbation", operating_type="flooded",
        oil_supply_pressure=0, oil_flow_v=Q_(37.86, "l/min"),
    )
run()
seconds = []
for _ in range(3):
    start = time.perf_counter()
    bearing = run()
    seconds.append(time.perf_counter() - start)
print(json.dumps({"seconds": min(seconds), "eccentricity": float(bearing.equilibrium_pos[0])}))
"""


def film(n_theta, n_z):
    """Two pads of 176 degrees, the load between the grooves."""
    grooves = tuple(
        Groove(angle=angle, width=math.radians(4)) for angle in (math.pi / 2, -math.pi / 2)
    )
    return FilmGeometry(
        length_to_diameter=LENGTH / (2 * RADIUS), n_theta=n_theta, n_z=n_z, grooves=grooves
    )


def solve(geometry):
    unit = VISCOSITY * SPEED * RADIUS**3 * LENGTH / CLEARANCE**2
    found = equilibrium(geometry, [LOAD / unit, 0.0])
    return found, coefficients(found)


def check(found, own):
    """Mesh error within 1 %, by a mesh four times as fine."""
    exact_place, exact = solve(film(4 * MESH[0], 4 * (MESH[1] - 1) + 1))
    assert_allclose(found.eccentricity_ratio, exact_place.eccentricity_ratio, rtol=0.01)
    for value, reference in zip(own, exact, strict=True):
        assert_allclose(value, reference, atol=0.01 * np.abs(reference).max())


def test_speed_of_an_equilibrium(benchmark):
    geometry = film(*MESH)
    found, own = benchmark(solve, geometry)
    if benchmark.enabled:
        print(f"\n{1e3 * benchmark.stats.stats.median:.2f} ms, {found.iterations} film solves")
    check(found, own)


def test_speed_against_ross(benchmark):
    if not benchmark.enabled:
        pytest.skip("measured with --benchmark-enable only")
    python = os.environ.get("ROSS_PYTHON", sys.executable)
    done = subprocess.run([python, "-c", OPPONENT], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"{python} has no ross-rotordynamics; set ROSS_PYTHON")
    opponent = json.loads(done.stdout.splitlines()[-1])
    found, own = benchmark(solve, film(*MESH))
    ratio = opponent["seconds"] / benchmark.stats.stats.median
    print(f"\n{opponent['seconds']:.2f} s of ROSS on 11 x 3: {ratio:.0f} times as long")
    assert_allclose(opponent["eccentricity"], 0.687332, atol=1e-4)  # the case of its manual
    check(found, own)
    assert ratio >= 200
