"""Parts of a journal bearing with its rotor and its proximity probes, and their cross checks.

X points along the load, and gravity acts along it; angles turn from X in the direction in which
the shaft rotates, so that Y lies a quarter of a turn ahead of X.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from ..output.sensor import Channel
from ..parts.dimensions import (
    Angle,
    Damping,
    Force,
    Frequency,
    Gravity,
    Length,
    Mass,
    Pressure,
    Ratio,
    RotationSpeed,
    Stiffness,
    Time,
    Unbalance,
    Velocity,
)
from ..parts.limits import (
    ANGLE_MOST,
    DAMPING_MOST,
    FORCE_MOST,
    GAIN_LEAST,
    GAIN_MOST,
    HEAVIEST,
    LIGHTEST,
    LONGEST,
    MOST_SENSORS,
    NAME_LONGEST,
    PRESSURE_MOST,
    SLIDING_LEAST,
    SLIDING_MOST,
    STIFFEST,
)
from ..parts.oil import Oil
from ..parts.part import Part
from ..parts.sensors import Tacho, displacement_channel
from ..parts.units import STANDARD_GRAVITY
from .scene import (
    SPEED,
    START_ANGLE,
    VISCOSITY,
    ConditionPlace,
    Numerics,
    Scene,
    Wear,
    WearPlace,
    faults_between,
    name_faults,
    refuse_disorder,
)

_UNBALANCE_MOST = 1e6  # kg m
_THINNEST = 1e-9  # m, smallest clearance: no film is thinner than its molecules
_GAP_LEAST, _GAP_MOST = 1e-9, 1.0  # m
_DEEPEST_SCAR = 0.2  # of the diametral clearance: half of the round bore's radial clearance
_MOST_GROOVES = 32
_MOST_RUN_OUT = 64

_SHAFT_ANGLE = Annotated[Angle, Field(ge=-ANGLE_MOST, le=ANGLE_MOST)]


class JournalDrive(Part):
    """Drive of the shaft."""

    speed: RotationSpeed = Field(gt=0, le=10_000, description="shaft speed, constant")
    start_angle: _SHAFT_ANGLE = Field(default=0.0, description="shaft angle at the first sample")


class AxialGroove(Part):
    """A groove along the bearing, centred in its length, full of oil."""

    angle: _SHAFT_ANGLE = Field(description="position of its middle")
    width: Angle = Field(gt=0, lt=math.tau, description="along the circumference")
    length_share: Ratio = Field(
        default=0.8, gt=0, le=1, description="share of the bearing's length"
    )
    pressure: Pressure = Field(
        default=0.0, ge=0, le=PRESSURE_MOST, description="feed pressure, gauge"
    )


class ShellContact(Part):
    """Contact of journal and shell where the film ends, after Kelvin and Voigt."""

    stiffness: Stiffness = Field(
        gt=0, le=STIFFEST, description="stiffness of shell and journal in series"
    )
    damping: Damping = Field(
        default=0.0, ge=0, le=DAMPING_MOST, description="damping along the normal"
    )
    friction: Ratio = Field(default=0.0, ge=0, le=1, description="Coulomb coefficient")
    friction_speed: Velocity = Field(
        default=0.01, ge=SLIDING_LEAST, le=SLIDING_MOST, description="speed of nearly full friction"
    )


class Bearing(Part):
    """The shell. Give exactly one of the two clearances."""

    diameter: Length = Field(gt=0, le=LONGEST, description="bore diameter")
    length: Length = Field(gt=0, le=LONGEST, description="length along the shaft")
    diametral_clearance: Length | None = Field(
        default=None, ge=_THINNEST, description="bore minus journal diameter"
    )
    radial_clearance: Length | None = Field(
        default=None, ge=_THINNEST, description="bore minus journal radius"
    )
    scar_depth: Length = Field(
        default=0.0, ge=0, description="deepest wear of the bore, where the shaft rubs at run-up"
    )
    scar_angle: _SHAFT_ANGLE = Field(default=0.0, description="position of the deepest wear")
    scar_share: Ratio = Field(
        default=0.0, ge=0, le=1, description="share of the wear since new that is a scar"
    )
    unworn_clearance: Length | None = Field(
        default=None, ge=_THINNEST, description="diametral clearance as new; needed by scar_share"
    )
    grooves: tuple[AxialGroove, ...] = Field(
        default=(), max_length=_MOST_GROOVES, description="axial oil grooves; none: a plain bore"
    )
    inlet_fill: Ratio = Field(
        default=1.0,
        gt=0,
        le=1,
        description="share of the widest gap filled by the oil supply; 1: flooded",
    )
    wall: ShellContact | None = Field(
        default=None, description="contact law; none: contact ends the run"
    )

    @model_validator(mode="after")
    def _clearance_that_fits(self) -> Self:
        given = [
            name
            for name in ("diametral_clearance", "radial_clearance")
            if getattr(self, name) is not None
        ]
        if len(given) != 1:
            raise ValueError(
                f"{' and '.join(given) if given else 'no clearance'} given, must be exactly one of "
                "diametral_clearance and radial_clearance; keep the one you measured"
            )
        if self.clearance_diametral >= self.diameter / 10:
            raise ValueError(
                f"{given[0]} = {getattr(self, given[0]):g} m must be < a tenth of the bore "
                f"(diameter = {self.diameter:g} m), the film theory neglects curvature; check the "
                "unit"
            )
        if self.scar_share > 0 and (self.unworn_clearance is None or self.scar_depth > 0):
            raise ValueError(
                f"scar_share = {self.scar_share:g} needs unworn_clearance, and no scar_depth "
                "with it; give the clearance of the new bearing and one of the two"
            )
        if self.scar_depth >= self.clearance_radial:
            raise ValueError(
                f"scar_depth = {self.scar_depth:g} m must be < the radial clearance = "
                f"{self.clearance_radial:g} m; deeper scars are outside the model"
            )
        return self

    @property
    def clearance_radial(self) -> float:
        """Radial clearance of the round part of the bore [m]."""
        return (self.clearance_diametral - self._scar_by_share) / 2

    @property
    def clearance_diametral(self) -> float:
        """Diametral clearance [m], whether given as diametral or radial.

        With a ``scar_share`` it is what a shaft lift or a lead wire measures across the scar.
        """
        if self.radial_clearance is not None:
            return 2 * self.radial_clearance
        return self.diametral_clearance or 0.0

    @property
    def scar(self) -> float:
        """Depth of the scar below the round bore [m], given directly or by ``scar_share``."""
        return self.scar_depth or self._scar_by_share

    @property
    def _scar_by_share(self) -> float:
        if self.unworn_clearance is None:
            return 0.0
        worn = max(0.0, self.clearance_diametral - self.unworn_clearance)
        return self.scar_share * min(worn, self.clearance_diametral * _DEEPEST_SCAR)


class RunOut(Part):
    """One harmonic of the run-out that the probes read: shape and magnetism of the track."""

    order: int = Field(ge=1, le=1000, description="cycles per revolution")
    amplitude: Length = Field(ge=0, le=_GAP_MOST, description="amplitude of this harmonic")
    phase: _SHAFT_ANGLE = Field(default=0.0, description="phase at the keyphasor mark")


class Dent(Part):
    """A dent, scratch or keyway end in the probes' track.

    If it is narrower than a probe's tip, it reads as wide as the tip and less deep.
    """

    depth: Length = Field(
        ge=0, le=_GAP_MOST, description="depth in the middle, as a probe reads it"
    )
    width: Angle = Field(gt=0, le=2 * math.pi, description="width from edge to edge")
    angle: _SHAFT_ANGLE = Field(
        default=0.0, description="position from the keyphasor mark, in the direction of rotation"
    )


class RotorShare(Part):
    """Share of a rigid rotor carried by one bearing."""

    mass: Mass = Field(ge=LIGHTEST, le=HEAVIEST, description="mass carried by this bearing")
    unbalance: Unbalance = Field(
        default=0.0,
        ge=0,
        le=_UNBALANCE_MOST,
        description="mass times eccentricity, this bearing's share",
    )
    unbalance_angle: _SHAFT_ANGLE = Field(
        default=0.0, description="position from the keyphasor mark, in the direction of rotation"
    )
    run_out: tuple[RunOut, ...] = Field(default=(), max_length=_MOST_RUN_OUT)
    dents: tuple[Dent, ...] = Field(default=(), max_length=_MOST_RUN_OUT)


class LoadRecord(Part):
    """Load over time from a CSV file: columns time [s], along X [N], along Y [N].

    A relative file is searched first in ``folder``, that of the scene file.
    """

    file: str = Field(min_length=1, description="CSV: time [s], force along X and Y [N]")
    folder: str = Field(default="", exclude=True, description="folder searched first")


class LoadOrder(Part):
    """A force that repeats with the shaft rotation: belt, coupling, gear mesh, vanes."""

    order: Ratio = Field(gt=0, le=1000, description="cycles per revolution; below 1 for a belt")
    amplitude: Force = Field(ge=0, le=FORCE_MOST, description="peak force")
    angle: _SHAFT_ANGLE = Field(default=0.0, description="direction from X")
    phase: _SHAFT_ANGLE = Field(
        default=0.0, description="phase of its peak in its own cycle, from the keyphasor mark"
    )


class JournalLoad(Part):
    """Loads on the shaft in addition to its weight; times count from the first sample."""

    static: Force = Field(
        default=0.0, ge=-FORCE_MOST, le=FORCE_MOST, description="steady force along X"
    )
    static_across: Force = Field(default=0.0, ge=-FORCE_MOST, le=FORCE_MOST, description="along Y")
    history: Literal["none", "step", "rectangular", "half-sine", "file"] = Field(
        default="none", description="load over time; file: from a record"
    )
    amplitude: Force = Field(
        default=0.0, ge=-FORCE_MOST, le=FORCE_MOST, description="peak of the load history"
    )
    angle: _SHAFT_ANGLE = Field(default=0.0, description="direction of the history from X")
    begin: Time = Field(default=0.0, ge=0, description="start of step or pulse")
    length: Time | None = Field(default=None, gt=0, description="duration of the pulse")
    record: LoadRecord | None = None
    orders: tuple[LoadOrder, ...] = Field(
        default=(), max_length=_MOST_RUN_OUT, description="forces periodic with the shaft"
    )

    @model_validator(mode="after")
    def _history_complete(self) -> Self:
        faults = []
        if self.history in ("rectangular", "half-sine") and self.length is None:
            faults.append(f"length is missing; the history '{self.history}' needs it")
        if self.history == "file" and self.record is None:
            faults.append("record is missing; the history 'file' needs it")
        if self.history == "none" and self.amplitude != 0:
            faults.append(
                f"amplitude = {self.amplitude:g} N needs a history; set history = 'step' or "
                "remove it"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self


class Film(Part):
    """Model of the oil film: closed form, table of solves, or a solve at every step."""

    rung: Literal["short", "map", "direct"] = Field(
        default="map",
        description="short: closed form; map: table of solves; direct: solved at every step",
    )
    condition: Literal["guembel", "reynolds", "periodic"] = Field(
        default="periodic", description="cavitation condition of the rungs map and direct"
    )
    n_theta: int = Field(default=72, ge=12, le=1440, description="nodes round the circle")
    n_z: int = Field(default=17, ge=5, le=257, description="nodes over the length, odd")

    @model_validator(mode="after")
    def _odd(self) -> Self:
        if self.n_z % 2 == 0:
            raise ValueError(f"n_z = {self.n_z} must be odd; one line of nodes lies in the middle")
        return self


class JournalStart(Part):
    """Release position of the journal, at rest, over the radial clearance."""

    x: Ratio = Field(
        default=0.0, gt=-1, lt=1, description="position along X, over the radial clearance"
    )
    y: Ratio = Field(
        default=0.0, gt=-1, lt=1, description="position along Y, over the radial clearance"
    )

    @model_validator(mode="after")
    def _inside(self) -> Self:
        if math.hypot(self.x, self.y) >= 1:
            raise ValueError(
                f"eccentricity = {math.hypot(self.x, self.y):g} must be < 1; start in the clearance"
            )
        return self


class JournalNumerics(Numerics):
    """Settings of the integrator."""

    integrator: Literal["euler", "rk4", "adaptive"] = Field(
        default="adaptive", description="euler and rk4: fixed steps; adaptive: error-controlled"
    )
    tolerance: Ratio = Field(
        default=1e-5, ge=1e-12, le=1e-2, description="error tolerance of adaptive, over the gap"
    )


class ProximityProbe(Part):
    """An eddy-current probe with its converter; it reads the shaft's motion towards it."""

    name: str = Field(min_length=1, max_length=NAME_LONGEST, description="channel name")
    angle: _SHAFT_ANGLE = Field(description="position from X in the direction of rotation")
    place: str = Field(default="", description="location, for the report")
    direction: str = Field(default="", description="direction, for the report")
    gain: Ratio = Field(
        default=1.0, ge=GAIN_LEAST, le=GAIN_MOST, description="true sensitivity over nominal"
    )
    offset: Length = Field(
        default=0.0, ge=-_GAP_MOST, le=_GAP_MOST, description="reading of a centred shaft"
    )
    noise: Length = Field(default=0.0, ge=0, le=_GAP_MOST, description="rms of white noise")
    mains: Length = Field(
        default=0.0, ge=0, le=_GAP_MOST, description="rms of mains hum with harmonics"
    )
    mains_frequency: Frequency = Field(default=50.0, ge=15, le=400, description="mains frequency")
    range: Length = Field(
        ge=_GAP_LEAST, le=_GAP_MOST, description="full scale, plus and minus, about the set gap"
    )
    bits: int = Field(default=24, ge=8, le=32, description="resolution of the converter")


class ScarLimits(Part):
    """Limits of the depth of a worn scar, and their source."""

    as_new: Length = Field(gt=0, le=LONGEST, description="depth after running in")
    condemning: Length = Field(
        gt=0, le=LONGEST, description="depth above which the shell must be renewed"
    )
    grade_edges: tuple[Length, Length, Length] = Field(
        description="depth at which grades 1, 2 and 3 begin"
    )
    source: str = Field(
        min_length=1, description="origin of the limits: standard, maker or judgement"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        refuse_disorder(self.as_new, self.grade_edges, self.condemning)
        return self


class JournalScene(Scene):
    """A rigid rotor in a hydrodynamic journal bearing, measured by proximity probes."""

    physics = "wearstate.sim.machine.journal"
    effects = ("film", "mesh", "tolerance", "step")
    wear_places = (
        WearPlace("bearing.diametral_clearance", "bearing", "diametral clearance", "wear"),
        WearPlace("bearing.scar_depth", "bearing", "depth of the worn scar", "wear_scar"),
    )
    condition_places = (
        SPEED,
        START_ANGLE,
        ConditionPlace("load.static", "static_load_n", "steady load of the bearing"),
        VISCOSITY,
        ConditionPlace("rotor.unbalance", "unbalance_kg_m", "unbalance of the rotor"),
    )

    machine: Literal["journal-bearing"] = Field(description="journal-bearing")
    gravity: Gravity = STANDARD_GRAVITY
    settling_revolutions: int = Field(
        default=3, ge=0, le=1000, description="revolutions before the recording; 0: none"
    )
    drive: JournalDrive
    bearing: Bearing
    oil: Oil
    rotor: RotorShare
    load: JournalLoad = JournalLoad()
    film: Film = Film()
    start: JournalStart = JournalStart()
    numerics: JournalNumerics = JournalNumerics()
    sensors: tuple[ProximityProbe, ...] = Field(min_length=1, max_length=MOST_SENSORS)
    wear: Wear | None = None
    wear_scar: ScarLimits | None = None

    def sensor_channels(self) -> tuple[Channel, ...]:
        """One channel of displacement for every probe."""
        return tuple(
            displacement_channel(probe.name, probe.place, probe.direction) for probe in self.sensors
        )

    def sensor_parts(self) -> tuple[ProximityProbe, ...]:
        """The probes."""
        return self.sensors

    @classmethod
    def cross_faults(cls, parts: Mapping[str, Any]) -> list[str]:
        """Faults between those parts that are present."""
        checks = (
            (_channel_faults, ("sensors", "tacho")),
            (_film_faults, ("film", "bearing")),
        )
        return faults_between(parts, checks)


def _channel_faults(sensors: tuple[ProximityProbe, ...], tacho: Tacho | None) -> list[str]:
    return name_faults([probe.name for probe in sensors], tacho)


def _film_faults(film: Film, bearing: Bearing) -> list[str]:
    """Find films that need a plain bore in a shaped one."""
    shaped = [
        name
        for name, there in (
            ("scar_depth", bearing.scar_depth > 0),
            ("scar_share", bearing.scar_share > 0),
            ("grooves", bearing.grooves),
            ("inlet_fill", bearing.inlet_fill < 1),
        )
        if there
    ]
    if film.rung == "direct" or not shaped:
        return _inlet_faults(film, bearing)
    return [
        f"film.rung = '{film.rung}' needs a plain bore, but bearing has {' and '.join(shaped)}; "
        "set film.rung = 'direct'"
    ]


def _inlet_faults(film: Film, bearing: Bearing) -> list[str]:
    """Find combinations that a film with a starved inlet does not support."""
    if bearing.inlet_fill == 1:
        return []
    faults, fill = [], f"bearing.inlet_fill = {bearing.inlet_fill:g}"
    if bearing.grooves:
        faults.append(f"{fill} must be 1 with grooves, which are full; remove one of them")
    if film.condition == "guembel":
        faults.append(
            f"{fill} must be 1 with film.condition = 'guembel', whose film is full all round; set "
            "film.condition = 'periodic'"
        )
    return faults
