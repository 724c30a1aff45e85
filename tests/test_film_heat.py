"""Heat balance of a pin's film: friction power, the balance, its limits, what a run makes of it."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from wearstate.sim.bearing.heat import film_temperature, friction_power
from wearstate.sim.bearing.short_bearing import short_load
from wearstate.sim.machine.simulate import simulate
from wearstate.sim.pump_setup.films import film_temperature_of
from wearstate.sim.scene.load import load_scene
from wearstate.sim.scene.scene import SceneError

PIN = "joint.crankpin"
WARM = {  # ISO VG 68 in a flooded pin
    f"{PIN}.rung": "film-map",
    f"{PIN}.oil.temperature": "313 K",
    f"{PIN}.oil.viscosity_40": "68 mm^2/s",
    f"{PIN}.oil.viscosity_100": "8.7 mm^2/s",
    f"{PIN}.oil.density": "870 kg/m^3",
    f"{PIN}.oil.length": "50 mm",
    "duration": "0.4 s",
}
SIZES = {"radius": 0.03, "length": 0.02, "gap": 5e-5}


def pump(**changes):
    return load_scene("bilge-pump", WARM | {f"{PIN}.oil.{k}": v for k, v in changes.items()})


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8])
def test_friction_power_is_the_shear_of_the_gap_at_the_eccentricity_of_the_load(e):
    viscosity, spin = 0.05, 20.0
    unit = viscosity * spin * SIZES["radius"] * SIZES["length"] ** 3 / (4 * SIZES["gap"] ** 2)
    found = friction_power(viscosity, spin=spin, load=unit * short_load(e), **SIZES)
    shear = quad(lambda t: 1 / (SIZES["gap"] * (1 + e * math.cos(t))), 0, math.tau)[0]
    wanted = viscosity * spin**2 * SIZES["radius"] ** 3 * SIZES["length"] * shear
    assert found == pytest.approx(wanted, rel=1e-9)


def test_the_film_gives_off_what_its_friction_makes():
    """One root, found to rounding: a power that falls exponentially has Lambert's as solution."""
    from scipy.special import lambertw

    power, fall, carried = 80.0, 0.05, 2.0
    found = film_temperature(300.0, lambda t: power * math.exp(-fall * (t - 300.0)), carried)
    assert found - 300.0 == pytest.approx(lambertw(power * fall / carried).real / fall, rel=1e-8)


def test_oil_hotter_than_its_law_makes_no_heat():
    def power(kelvin):
        if kelvin > 310.0:
            raise ValueError
        return 1e3

    assert film_temperature(300.0, power, 10.0) == pytest.approx(310.0, abs=1e-6)
    with pytest.raises(ValueError, match=r"heat carried away = 0 W/K must be > 0"):
        film_temperature(300.0, power, 0.0)


def test_a_flow_carries_what_a_conductance_of_its_heat_does():
    """1 L/min of 870 kg/m^3 and 2 kJ/(kg K) carries 29 W/K."""
    flow = pump(flow="1 L/min", specific_heat="2 kJ/(kg K)")
    metal = pump(conductance=f"{870 * 2000 * 1e-3 / 60} W/K")
    assert flow.joint.crankpin.oil.carried_per_kelvin == pytest.approx(29.0)
    warm = [film_temperature_of(scene, 0, 0) for scene in (flow, metal)]
    assert warm[0] == pytest.approx(warm[1], abs=1e-6)
    both = pump(flow="1 L/min", conductance="29 W/K")
    assert 0.45 < (film_temperature_of(both, 0, 0) - 313) / (warm[0] - 313) < 0.55


def test_less_carried_is_warmer_and_much_is_as_cold_as_the_inlet():
    found = [film_temperature_of(pump(conductance=f"{g} W/K"), 0, 0) for g in (0.3, 1, 10, 1000)]
    assert all(one > other for one, other in pairwise(found))
    assert found[-1] == pytest.approx(313.0, abs=0.02)
    assert film_temperature_of(pump(), 0, 0) is None


def test_a_run_is_that_of_the_oil_at_that_temperature():
    scene = pump(conductance="0.5 W/K")
    warm = simulate(scene, seed=0)
    kelvin = warm.numerics["film_temperature_k"]
    assert kelvin == film_temperature_of(scene, 0, 0)
    told = simulate(pump(temperature=f"{kelvin!r} K"), seed=0)
    np.testing.assert_array_equal(warm.signal, told.signal)
    cold = simulate(pump(), seed=0)
    assert warm.numerics["min_film_m"] < 0.8 * cold.numerics["min_film_m"]
    assert "film_temperature_k" not in cold.numerics


def test_the_moving_pin_rubs_as_the_resting_one_within_a_third():
    """What the balance leaves out: the load that moves. Mean of 1 / sqrt(1 - e^2) over turns."""
    for clearance, viscosity in (("0.1 mm", 0.06), ("0.2 mm", 0.1)):
        oil = {f"{PIN}.oil.viscosity": viscosity, f"{PIN}.oil.length": "50 mm"}
        more = {f"{PIN}.rung": "film-map", f"{PIN}.diametral_clearance": clearance}
        scene = load_scene("bilge-pump", {**oil, **more, "duration": "0.6 s"})
        run, pin = simulate(scene, seed=0, truth=True), scene.joint.crankpin
        gap, radius = pin.clearance_radial, pin.pin_diameter / 2
        e = np.hypot(*run.truth["pin_offset_m"].T) / gap
        load = math.sqrt(np.mean(run.truth["pin_force_n"] ** 2) * 2)
        known = {"spin": math.tau * scene.drive.speed, "radius": radius, "length": 0.05, "gap": gap}
        resting = friction_power(viscosity, load=load, **known)
        moving = friction_power(viscosity, load=0.0, **known) * np.mean(1 / np.sqrt(1 - e**2))
        assert resting == pytest.approx(moving, rel=0.33)


def test_what_a_heat_balance_cannot_be_of_is_named():
    with pytest.raises(SceneError) as error:
        load_scene(
            "bilge-pump",
            {
                f"{PIN}.oil.viscosity": "0.06 Pa s",
                f"{PIN}.oil.length": "50 mm",
                f"{PIN}.oil.filled_gap": "10 um",
                f"{PIN}.oil.conductance": "1 W/K",
            },
        )
    said = str(error.value)
    assert "needs temperature, viscosity_40, viscosity_100, density" in said
    assert "is of a flooded film" in said
