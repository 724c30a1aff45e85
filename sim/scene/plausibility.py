"""Plausibility checks: warnings about scenes and recordings that run but look wrong.

An error prevents a run that cannot be computed. These checks ask whether a computable scene can be
meant: the error estimate of a run covers its integration, not a casing of two kilograms or a shaft
without excitation. Every check is one row with its usual value, and every warning gives the value
found, the usual value and the cure.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..output.recording import Recording
from ..output.sensor import Channel
from ..parts.casing import CasingMode
from .journal import JournalScene
from .pump import FORCE_PLACES, PumpScene
from .pump_hydraulics import PIPED_RUNGS
from .pump_joints import OILED_RUNGS
from .scene import Scene
from .shaft import ShaftScene

Signal = NDArray[np.float32]

FEWEST_TURNS = 20.0
"""Revolutions of a recording: orders are then resolved to a twentieth of the speed, and a mean over
revolutions has an error of about a fifth of its scatter."""

_TURN_ROUNDING = 1e-6  # of a duration given as a number of revolutions

LEAST_MASS_RATIO = 2.0
"""Casing over piston and rod; 5 to 30 is usual, or the foot would follow the piston."""

MOST_DEFLECTION = 1e-3
"""Deflection of a casing under the largest steady force [m]; usual: hundredths of a millimetre."""

MOST_ABOVE = 0.5
"""Share of casing modes above half the sample rate: they do not appear in the recording."""

LEAST_LEVEL = 1e-3
"""Largest deviation from the mean over the sensor's range; a few per cent is usual."""

LEAST_OVER_NOISE = 1.1
"""rms over the rms of the sensor's own noise; 30 times is usual."""

MOST_VELOCITY = 0.112
"""rms within 10 Hz to 1 kHz [m/s], the highest severity grade of ISO 10816-6 for
reciprocating machines; other machines stay below a tenth of it."""

_VELOCITY_BAND = (10.0, 1000.0)  # Hz, the band of that standard


@dataclass(frozen=True, kw_only=True)
class Doubt:
    """One implausible value.

    Attributes
    ----------
    check : str
        Row of :data:`SCENE_CHECKS` or :data:`RECORD_CHECKS`.
    text : str
        Value, usual value, and cure.
    """

    check: str
    text: str


@dataclass(frozen=True, kw_only=True)
class Seen:
    """A recording, and the limits of its sensors.

    Attributes
    ----------
    signal : numpy.ndarray [shape=(n_channels, n_samples)]
        Finite, in the unit of each channel.
    sample_rate : float
        Sampling rate [Hz].
    channels : sequence of Channel
        One per row.
    tacho : str, optional
        Name of the tacho channel.
    turns : float
        Revolutions in the recording; NaN if unknown.
    full_scale, noise : mapping
        Sensor limits by channel name [unit of the channel]; omitted if unknown.
    """

    signal: Signal
    sample_rate: float
    channels: Sequence[Channel]
    tacho: str | None = None
    turns: float = math.nan
    full_scale: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)

    def rows(self) -> Iterator[tuple[Channel, Signal]]:
        """Every channel except the tacho."""
        for channel, row in zip(self.channels, self.signal, strict=True):
            if channel.quantity != "tacho" and channel.name != self.tacho:
                yield channel, row


# --- scenes


def scene_doubts(scene: Scene) -> tuple[Doubt, ...]:
    """Implausible values of a scene, before it is run.

    Parameters
    ----------
    scene : Scene
        A valid scene.

    Returns
    -------
    tuple of Doubt

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene_doubts(load_scene("bilge-pump"))
    ()
    >>> print(scene_doubts(load_scene("bilge-pump", {"duration": "1.2 s"}))[0].text)
    duration = 1.2 s holds 6 revolutions, usual are >= 20; record 4 s or longer
    """
    return tuple(
        Doubt(check=row.name, text=text)
        for row in SCENE_CHECKS
        if isinstance(scene, row.machine)
        for text in row.function(scene)
    )


def _few_turns(scene: Any) -> Iterator[str]:
    if not getattr(scene, "running", True):
        return
    speed = float(scene.drive.speed)
    turns = scene.duration * speed
    if turns < FEWEST_TURNS * (1 - _TURN_ROUNDING):
        yield (
            f"duration = {scene.duration:g} s holds {turns:.3g} revolutions, usual are >= "
            f"{FEWEST_TURNS:g}; record {FEWEST_TURNS / speed:.3g} s or longer"
        )


def _light_casing(pump: PumpScene) -> Iterator[str]:
    moving = len(pump.throws) * (pump.piston.mass + pump.rod.mass)
    masses = [(index, modal_mass(mode)) for index, mode in enumerate(pump.casing.modes)]
    light = [(index, mass) for index, mass in masses if mass < LEAST_MASS_RATIO * moving]
    if light:
        index, mass = min(light, key=lambda each: each[1])
        yield (
            f"casing.modes: {len(light)} of {len(masses)} move less than {LEAST_MASS_RATIO:g} "
            f"times the mass of piston and rod ({moving:.3g} kg), least casing.modes.{index} with "
            f"{mass:.3g} kg, usual are >= 5 times; shapes are mass-normalised, near 1 over the "
            "square root of the mass that moves"
        )


def modal_mass(mode: CasingMode) -> float:
    """Modal mass at the place of largest amplitude of a mode [kg]."""
    largest = max(abs(value) for value in mode.shape.values())
    return 1 / largest**2 if largest > 0 else math.inf


def _soft_casing(pump: PumpScene) -> Iterator[str]:
    found = largest_deflection(pump)
    if found is not None and found[2] > MOST_DEFLECTION:
        place, sensor, most = found
        yield (
            f"casing.modes: {largest_force(pump):.3g} N at {place} move {sensor} by "
            f"{1e3 * most:.3g} mm, usual are < {1e3 * MOST_DEFLECTION / 10:g} mm; raise the "
            "frequencies of the modes, or lower their shapes"
        )


def largest_deflection(pump: PumpScene) -> tuple[str, str, float] | None:
    """Largest static deflection of a sensor under the largest steady force at any place.

    Parameters
    ----------
    pump : PumpScene

    Returns
    -------
    tuple of str, str, float, or None
        Place of the force, sensor, and deflection [m]; None for a casing without modes.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> place, sensor, most = largest_deflection(load_scene("bilge-pump"))
    >>> place, sensor, round(1e6 * most)
    ('guide_y', 'acc_y', 61)
    """
    sensors = [sensor.name for sensor in pump.accelerometers]
    places = {key for mode in pump.casing.modes for key in mode.shape} - set(sensors)
    compliance = {
        (place, sensor): abs(_compliance(pump.casing.modes, place, sensor))
        for place in places
        for sensor in sensors
    }
    if not compliance:
        return None
    (place, sensor), most = max(compliance.items(), key=lambda each: (each[1], each[0]))
    return place, sensor, most * largest_force(pump)


def _compliance(modes: Sequence[CasingMode], place: str, sensor: str) -> float:
    """Static deflection at a sensor over a force at a place [m/N]."""
    return math.fsum(
        mode.shape.get(place, 0.0) * mode.shape[sensor] / (math.tau * mode.frequency) ** 2
        for mode in modes
    )


def largest_force(pump: PumpScene) -> float:
    """Largest force of liquid and piston of one throw on the casing [N]."""
    area = math.pi / 4 * pump.piston.diameter**2
    pressure = max(abs(pump.pressure.suction), abs(pump.pressure.discharge))
    liquid = area * pressure if pump.pressure.rung != "none" else 0.0
    throw = pump.crank.radius * (math.tau * pump.drive.speed) ** 2
    return liquid + (pump.piston.mass + pump.rod.mass) * throw


def _modes_outside(pump: PumpScene) -> Iterator[str]:
    modes, half = pump.casing.modes, pump.sample_rate / 2
    above = sum(mode.frequency > half for mode in modes)
    if modes and above > MOST_ABOVE * len(modes):
        lowest = min(mode.frequency for mode in modes)
        yield (
            f"casing.modes: {above} of {len(modes)} lie above half the sample rate = {half:g} Hz, "
            f"the lowest at {lowest:g} Hz, usual is all below; raise sample_rate, or check the "
            "unit of their frequencies"
        )


def _nodes(pump: PumpScene) -> Iterator[str]:
    """Find sensors that no force reaches through any mode."""
    modes = pump.casing.modes
    for sensor in pump.accelerometers if modes else ():
        if not any(mode.shape[sensor.name] and _driven(mode) for mode in modes):
            yield (
                f"sensors: '{sensor.name}' moves in none of {len(modes)} casing modes that a force "
                "drives, usual is most of them; give casing.modes shapes other than 0 there and "
                f"at {', '.join(FORCE_PLACES[:4])}"
            )


def _driven(mode: CasingMode) -> bool:
    return any(value for key, value in mode.shape.items() if key.startswith(FORCE_PLACES))


def _fast_waves(pump: PumpScene) -> Iterator[str]:
    """Find pipes whose waves are faster than sound in their liquid without air.

    Korteweg (1878): ``a = c / sqrt(1 + K D / (E e))`` in a pipe of modulus E and wall e, so a rigid
    one has the speed of sound c of the liquid itself, and any other less.
    """
    pressure = pump.pressure
    if pressure.rung not in PIPED_RUNGS:
        return
    airless = pressure.liquid.model_copy(update={"air_fraction": 0.0})
    sides = (("suction", pressure.suction_line), ("discharge", pressure.discharge_line))
    for (side, line), level in zip(sides, pressure.at_pump, strict=True):
        most = airless.wave_speed(level)
        if line is not None and line.wave_speed is not None and line.wave_speed > most:
            yield (
                f"pressure.{side}_line.wave_speed = {line.wave_speed:g} m/s is above the speed of "
                f"sound in the liquid without air at {level:.3g} Pa = {most:.4g} m/s, the limit of "
                "a rigid pipe, usual are 0.7 to 0.95 times that in steel; lower it, or raise "
                "pressure.liquid.bulk_modulus"
            )


def _unread_oil(pump: PumpScene) -> Iterator[str]:
    """Find pins with oil whose rung is dry."""
    joints = {
        f"throws.{index}.joint" if throw.joint else "joint": throw.joint or pump.joint
        for index, throw in enumerate(pump.throws)
    }
    for place, joint in joints.items():
        for name, pin in (("crankpin", joint.crankpin), ("wristpin", joint.wristpin)):
            if pin is not None and pin.oil is not None and pin.rung not in OILED_RUNGS:
                yield (
                    f"{place}.{name}.oil is given, but the rung '{pin.rung}' is dry, usual is one "
                    f"of {', '.join(OILED_RUNGS)}; set {place}.{name}.rung, or leave the oil out"
                )


def _unexcited_shaft(shaft: ShaftScene) -> Iterator[str]:
    propeller, coupling = shaft.propeller, shaft.coupling
    excited = (
        any(disc.unbalance for disc in shaft.discs)
        or any(part.force for part in shaft.turbulence)
        or bool(shaft.mounted_exciters)
        or (propeller is not None and propeller.thrust > 0 and bool(propeller.blade_rate))
        or (coupling is not None and bool(coupling.parallel_offset or coupling.angle))
    )
    if not excited:
        yield (
            "discs: 0 of them have an unbalance, and no blade_rate, coupling offset or turbulence "
            "excites the line, usual is balance quality G 2.5 to G 6.3; give discs their unbalance"
        )


def _unexcited_journal(journal: JournalScene) -> Iterator[str]:
    pushed = journal.load.history != "none" or any(one.amplitude for one in journal.load.orders)
    still = not journal.rotor.unbalance and not pushed
    if still and journal.settling_revolutions > 0:
        yield (
            "rotor.unbalance = 0 kg m and load.history = 'none': nothing excites the shaft, which "
            "comes to rest within settling_revolutions unless it whirls, usual is balance quality "
            "G 2.5 to G 6.3; give rotor.unbalance"
        )


@dataclass(frozen=True, kw_only=True)
class SceneCheck:
    """One check of a scene.

    Attributes
    ----------
    name : str
    machine : type
        Scene types that it applies to.
    function : callable
        Scene to texts; none if nothing is implausible.
    usual : str
        Usual value, in words.
    """

    name: str
    machine: type  # Scene for every machine
    function: Callable[[Any], Iterator[str]]
    usual: str


SCENE_CHECKS: tuple[SceneCheck, ...] = (
    SceneCheck(
        name="few revolutions", machine=Scene, function=_few_turns, usual="20 after settling"
    ),
    SceneCheck(
        name="light casing",
        machine=PumpScene,
        function=_light_casing,
        usual="casing of 5 to 30 times the mass of piston and rod",
    ),
    SceneCheck(
        name="soft casing",
        machine=PumpScene,
        function=_soft_casing,
        usual="hundredths of a millimetre under the largest force",
    ),
    SceneCheck(
        name="modes outside",
        machine=PumpScene,
        function=_modes_outside,
        usual="all below half the sample rate",
    ),
    SceneCheck(
        name="sensor at nodes",
        machine=PumpScene,
        function=_nodes,
        usual="every sensor moves in most modes",
    ),
    SceneCheck(
        name="fast waves",
        machine=PumpScene,
        function=_fast_waves,
        usual="0.7 to 0.95 times the speed of sound of the liquid without air",
    ),
    SceneCheck(
        name="unread oil",
        machine=PumpScene,
        function=_unread_oil,
        usual="film-map",
    ),
    SceneCheck(
        name="no excitation",
        machine=ShaftScene,
        function=_unexcited_shaft,
        usual="balance quality G 2.5 to G 6.3",
    ),
    SceneCheck(
        name="no excitation",
        machine=JournalScene,
        function=_unexcited_journal,
        usual="balance quality G 2.5 to G 6.3",
    ),
)
"""All checks of a scene. A new one is one function and one row."""


# --- recordings


def record_doubts(seen: Seen) -> tuple[Doubt, ...]:
    """Implausible values of a recording.

    Parameters
    ----------
    seen : Seen

    Returns
    -------
    tuple of Doubt

    Examples
    --------
    >>> channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    >>> still = np.zeros((1, 100), dtype=np.float32)
    >>> doubts = record_doubts(Seen(signal=still, sample_rate=1e3, channels=(channel,)))
    >>> print(doubts[0].text)
    channel 'acc' is 0 m/s^2 throughout, usual is a vibration; check the sensor, and the \
excitation of the machine
    """
    return tuple(
        Doubt(check=row.name, text=text) for row in RECORD_CHECKS for text in row.function(seen)
    )


def _short(seen: Seen) -> Iterator[str]:
    if seen.turns < FEWEST_TURNS * (1 - _TURN_ROUNDING):
        length = seen.signal.shape[1] / seen.sample_rate
        yield (
            f"{length:.3g} s hold {seen.turns:.3g} revolutions, usual are >= {FEWEST_TURNS:g}; "
            f"record {length * FEWEST_TURNS / seen.turns:.3g} s or longer"
        )


def _still(seen: Seen) -> Iterator[str]:
    for channel, row in seen.rows():
        if row.min() == row.max():
            yield (
                f"channel '{channel.name}' is {float(row[0]):g} {channel.unit} throughout, usual "
                "is a vibration; check the sensor, and the excitation of the machine"
            )


def _faint(seen: Seen) -> Iterator[str]:
    """Find levels below a thousandth of the range, except those that are pure noise."""
    for channel, row in seen.rows():
        full = seen.full_scale.get(channel.name, 0.0)
        largest = float(np.abs(row - row.mean(dtype=np.float64)).max())
        if 0 < largest < LEAST_LEVEL * full and not _is_noise(seen, channel, row):
            yield (
                f"channel '{channel.name}' stays within {largest:.3g} {channel.unit} of its mean, "
                f"{largest / full:.2%} of its range of {full:.3g} {channel.unit}, usual are > "
                f"{LEAST_LEVEL:.1%}; narrow the sensor's range"
            )


def _noise_alone(seen: Seen) -> Iterator[str]:
    for channel, row in seen.rows():
        if _is_noise(seen, channel, row):
            yield (
                f"channel '{channel.name}' holds {float(row.std(dtype=np.float64)):.3g} "
                f"{channel.unit} rms, its own noise of {seen.noise[channel.name]:.3g} "
                f"{channel.unit} and hardly more, usual is 30 times; excite the machine, or use a "
                "quieter sensor"
            )


def _is_noise(seen: Seen, channel: Channel, row: Signal) -> bool:
    level = float(row.std(dtype=np.float64))
    return 0 < level < LEAST_OVER_NOISE * seen.noise.get(channel.name, 0.0)


def _violent(seen: Seen) -> Iterator[str]:
    for channel, row in seen.rows():
        if channel.quantity != "acceleration" or channel.unit != "m/s^2":
            continue
        velocity = _band_velocity(row, seen.sample_rate)
        if velocity > MOST_VELOCITY:
            low, high = _VELOCITY_BAND
            yield (
                f"channel '{channel.name}' moves with {1e3 * velocity:.3g} mm/s rms within "
                f"{low:g} to {high:g} Hz, usual are < {1e3 * MOST_VELOCITY:g} mm/s (ISO 10816-6); "
                "check its unit and gain, or the casing's mass and stiffness"
            )


def _band_velocity(acceleration: Signal, fs: float) -> float:
    """Velocity within the band of the standard, rms [m/s]."""
    from scipy import fft  # this module is imported with every scene

    n = len(acceleration)
    spectrum = fft.rfft(acceleration)
    frequency = fft.rfftfreq(n, 1 / fs)
    low, high = np.searchsorted(frequency, _VELOCITY_BAND)
    velocity = np.abs(spectrum[low:high]) / (math.tau * frequency[low:high])
    return float(math.sqrt(2 * float(np.sum(velocity**2))) / n)


@dataclass(frozen=True, kw_only=True)
class RecordCheck:
    """One check of a recording; attributes as in :class:`SceneCheck`."""

    name: str
    function: Callable[[Seen], Iterator[str]]
    usual: str


RECORD_CHECKS: tuple[RecordCheck, ...] = (
    RecordCheck(name="few revolutions", function=_short, usual="20"),
    RecordCheck(name="still", function=_still, usual="a vibration"),
    RecordCheck(name="faint", function=_faint, usual="more than 0.1 % of the range"),
    RecordCheck(name="noise alone", function=_noise_alone, usual="30 times the noise"),
    RecordCheck(name="violent", function=_violent, usual="less than 112 mm/s rms"),
)
"""All checks of a recording. A new one is one function and one row."""


# --- both


def sensor_limits(scene: Scene) -> tuple[dict[str, float], dict[str, float]]:
    """Range and noise of every sensor of a scene, by channel name.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    full_scale, noise : dict
        [unit of the channel]

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> sensor_limits(load_scene("journal-bearing"))[0]
    {'probe_1': 0.001, 'probe_2': 0.001}
    """
    sensors = scene.sensor_parts()
    return {s.name: s.range for s in sensors}, {s.name: s.noise for s in sensors}


def solution_doubts(scene: Scene, solution: Recording) -> tuple[Doubt, ...]:
    """Implausible values of a run: its scene and its recording.

    Parameters
    ----------
    scene : Scene
        Scene of the run.
    solution : Recording
        Result that did not fail.

    Examples
    --------
    >>> from wearstate.sim.machine.simulate import simulate
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("journal-unbalance")
    >>> solution_doubts(scene, simulate(scene, seed=0))
    ()
    """
    full_scale, noise = sensor_limits(scene)
    seen = Seen(
        signal=solution.signal,
        sample_rate=solution.sample_rate,
        channels=solution.channels,
        full_scale=full_scale,
        noise=noise,
    )
    return (*scene_doubts(scene), *record_doubts(seen))
