"""Figures of a scene compared with usual values: rows of a deep check, common to all machines.

A quantity is one row: its measure, the usual range in machines, the reason, and the cure outside.
"Usual" is our judgement of what machines have, wider than a designer would choose; a standard is
quoted only where a row names one. It is no limit of validity: those are checked before, by
:func:`wearstate.sim.machine.simulate.check`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..fidelity.ladder import cost_of
from ..machine.simulate import simulate
from ..output.recording import Recording
from ..scene.plausibility import (
    FEWEST_TURNS,
    LEAST_LEVEL,
    Doubt,
    scene_doubts,
    sensor_limits,
    solution_doubts,
)
from ..scene.rungs import with_values
from ..scene.scene import Scene, channels_of

_BYTES = 4  # per sample: float32
_TURNS = 6.0  # of a run without own figures
_SECONDS = 4.0  # tabulated time of a run without own figures
_ROUNDING = 1e-6  # tolerance for a value on a bound


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """One row of a machine's table.

    Attributes
    ----------
    name, unit : str
        For display; the unit is that of `measure`.
    measure : callable
        Facts of a scene -> place -> value. Empty if the scene does not have it; of several
        places the most unusual one is shown. A machine with one place names it "".
    least, most : float
        Usual range; infinite without a limit.
    reason : str
        Why it is usual, with the source if there is one.
    low, high : str
        Cure of a value below and above the range.
    doubt : str
        Row of ``plausibility.SCENE_CHECKS`` or ``RECORD_CHECKS`` for the same quantity, or words of
        the run's warning about it; "" if there is none.
    """

    name: str
    unit: str
    measure: Callable[[Any], Mapping[str, float]]
    least: float = -math.inf
    most: float = math.inf
    reason: str
    low: str = ""
    high: str = ""
    doubt: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A quantity of one scene.

    Attributes
    ----------
    quantity : Quantity
    values : mapping of str to float
        Place -> value [unit of the quantity], at least one.
    """

    quantity: Quantity
    values: Mapping[str, float]

    @property
    def worst(self) -> tuple[str, float]:
        """Place and value furthest outside the usual range; inside it, closest to an end."""
        return max(self.values.items(), key=lambda each: self._excess(each[1]))

    @property
    def usual(self) -> bool:
        """Whether all values are in the usual range."""
        return self._excess(self.worst[1]) <= _ROUNDING

    @property
    def others(self) -> tuple[str, ...]:
        """Further places outside the usual range."""
        first = self.worst[0]
        odd = (place for place, value in self.values.items() if self._excess(value) > _ROUNDING)
        return tuple(place for place in odd if place != first)

    @property
    def cure(self) -> str:
        """Cure; "" if all values are usual."""
        if self.usual:
            return ""
        value = self.worst[1]
        return self.quantity.low if value < self.quantity.least else self.quantity.high

    def _excess(self, value: float) -> float:
        """Logarithmic distance of a value beyond the nearer end, negative inside."""
        low, high = self.quantity.least, self.quantity.most
        if math.isnan(value):
            return math.inf
        below = _ratio(low, value) if low > -math.inf else -math.inf
        above = _ratio(value, high) if high < math.inf else -math.inf
        return max(below, above)


def _ratio(larger: float, smaller: float) -> float:
    """Logarithm of a ratio; infinite or its sign if a value is not above zero."""
    if larger > 0 and smaller > 0:
        return math.log(larger / smaller)
    return math.copysign(math.inf, larger - smaller) if larger != smaller else 0.0


def figures(table: Sequence[Quantity], facts: Any) -> tuple[Figure, ...]:
    """All rows of a table that apply to a scene.

    Parameters
    ----------
    table : sequence of Quantity
    facts : object
        Argument of their `measure`.

    Returns
    -------
    tuple of Figure
    """
    found = ((quantity, quantity.measure(facts)) for quantity in table)
    return tuple(Figure(quantity=quantity, values=values) for quantity, values in found if values)


@dataclass(frozen=True, kw_only=True)
class ShortRun:
    """A short simulated run of a scene.

    Attributes
    ----------
    scene : Scene
        Scene of the run, with changed duration.
    solution : Recording
        With its truth if the machine turns; signals of zeros if the run failed.
    warnings : tuple of str
        Warnings of the run, without doubts.
    doubts : tuple of Doubt
        Doubts about its recording; those about the scene are separate.
    """

    scene: Scene
    solution: Recording
    warnings: tuple[str, ...]
    doubts: tuple[Doubt, ...]

    @property
    def ok(self) -> bool:
        """Whether the run was completed."""
        return self.solution.status.ok


def trial(scene: Scene, *, turns: float, seconds: float, truth: bool = True) -> ShortRun:
    """Run a scene for some revolutions, or fewer if they are too costly.

    Parameters
    ----------
    scene : Scene
    turns : float
        Largest number of revolutions recorded; at least one.
    seconds : float
        Tabulated processor time allowed [s].
    truth : bool
        Whether to keep hidden states.

    Returns
    -------
    ShortRun
    """
    speed = float(scene.drive.speed)  # type: ignore[attr-defined]
    full = min(turns / speed, scene.duration)
    cost = cost_of(with_values(scene, {"duration": full}))
    duration = max(1.01 / speed, full * min(1.0, seconds / cost))
    short = with_values(scene, {"duration": duration, "fidelity": "given"})
    solution = simulate(short, seed=0, truth=truth, raise_on_failure=False)
    of_scene = scene_doubts(short)
    doubts = solution_doubts(short, solution)[len(of_scene) :] if solution.status.ok else ()
    known = {doubt.text for doubt in (*of_scene, *doubts)}
    shown = tuple(text for text in solution.warnings if text not in known)
    return ShortRun(scene=short, solution=solution, warnings=shown, doubts=doubts)


@dataclass(frozen=True, kw_only=True)
class PlainFacts:
    """A scene and a short run, for a machine without figures of its own."""

    scene: Scene
    trial: ShortRun


def plain_facts(scene: Scene) -> PlainFacts:
    """Run a scene for a few revolutions."""
    return PlainFacts(scene=scene, trial=trial(scene, turns=_TURNS, seconds=_SECONDS))


def over_range(run: ShortRun) -> dict[str, float]:
    """Largest deviation from the mean over the range, for every sensor in a trial."""
    if not run.ok:
        return {}
    ranges, _ = sensor_limits(run.scene)
    rows = zip(run.solution.channels, run.solution.signal, strict=True)
    return {
        channel.name: float(np.abs(row - row.mean()).max()) / ranges[channel.name]
        for channel, row in rows
        if channel.name in ranges
    }


def taylor_share(
    speed: float, radius: float, gap: float, viscosity: float, density: float
) -> float:
    """Reynolds number of a film over that of its first instability.

    Parameters
    ----------
    speed : float
        Surface speed [m/s].
    radius, gap : float
        Radius of the journal, and the radial clearance [m].
    viscosity : float
        Dynamic viscosity [Pa s].
    density : float
        Density [kg/m^3].

    Returns
    -------
    float
        ``rho U C / eta`` over ``41.2 sqrt(R / C)``: laminar below 1.

    References
    ----------
    Taylor (1923), Philosophical Transactions A 223, 289-343, doi:10.1098/rsta.1923.0008.

    Examples
    --------
    >>> round(taylor_share(23.56, 0.075, 0.25e-3, 0.0251, 880.0), 2)
    0.29
    """
    return density * speed * gap / viscosity / (41.2 * math.sqrt(radius / gap))


OIL_DENSITY = 870.0
"""Density of mineral oil if a scene gives none [kg/m^3]; all are within 5 % of it."""


# --- rows of all machines


def _turns(facts: Any) -> dict[str, float]:
    if not getattr(facts.scene, "running", True):
        return {}
    return {"": facts.scene.duration * facts.scene.drive.speed}


def _samples(facts: Any) -> dict[str, float]:
    if not getattr(facts.scene, "running", True):
        return {}
    return {"": facts.scene.sample_rate / facts.scene.drive.speed}


def _seconds(facts: Any) -> dict[str, float]:
    return {"": cost_of(facts.scene)}


def _megabytes(facts: Any) -> dict[str, float]:
    scene = facts.scene
    samples = round(scene.duration * scene.sample_rate)
    return {"": 1e-6 * _BYTES * samples * len(channels_of(scene))}


RECORDING = (
    Quantity(
        name="revolutions recorded",
        unit="",
        measure=_turns,
        least=FEWEST_TURNS,
        reason="orders a twentieth of the speed apart",
        low="raise duration",
        doubt="few revolutions",
    ),
    Quantity(
        name="samples per revolution",
        unit="",
        measure=_samples,
        least=20.0,
        reason="orders up to 8 with the usual 2.56 samples per period",
        low="raise sample_rate, or check the unit of drive.speed",
    ),
    Quantity(
        name="sensor reading over range",
        unit="",
        measure=lambda facts: over_range(facts.trial),
        least=LEAST_LEVEL,
        most=0.95,
        reason="a range should be used, but not clip",
        low="lower the sensor's range, or check the excitation of the machine",
        high="raise the sensor's range, or find the cause of the vibration",
        doubt="faint",
    ),
    Quantity(
        name="processor time per recording",
        unit="s",
        measure=_seconds,
        most=60.0,
        reason="by the table of costs; a data set has thousands of recordings",
        high="shorten duration, or see wearstate chart for cheaper rungs",
    ),
    Quantity(
        name="size of a recording",
        unit="MB",
        measure=_megabytes,
        most=100.0,
        reason="a data set has thousands of recordings",
        high="shorten duration, or lower sample_rate",
    ),
)
"""Rows at the end of every machine's table."""
