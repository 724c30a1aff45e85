"""Test of a shaft line before and after its calibration: table and text."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ...sim.alignment.calibration import Calibration
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.at_rest import shaft_state
from ...sim.shaft.forces import harmonic_forces, random_forces
from ...sim.shaft.line_beam import shaft_beam
from ...sim.shaft_response.places import Place
from .peak_changes import PeakChange, peak_changes
from .rig_setup import TEST_KINDS, HammerTest, RigError, ShakerTest, free_time
from .rig_test import Plant, RigTest, named_place, needed_time, rotor_plant, run_test

_BLOW_SHARE, _SHAKER_SHARE, _CELL_SHARE = 0.2, 0.02, 5e-6  # forces over shaft weight


@dataclass(frozen=True, kw_only=True, eq=False)
class BeforeAfter:
    """One test before and after bearings were moved.

    Attributes
    ----------
    scene : str
        Name of the scene.
    moves : dict of str to float
        Bearing -> upward move [m].
    force : place
        Place of the test force.
    before, after : RigTest
    changes : tuple of PeakChange
    """

    scene: str
    moves: dict[str, float]
    force: Place
    before: RigTest
    after: RigTest
    changes: tuple[PeakChange, ...]

    def of(self, verdict: str) -> tuple[PeakChange, ...]:
        """Peaks with the verdict ``suppressed``, ``amplified`` or ``unchanged``."""
        return tuple(change for change in self.changes if change.verdict == verdict)

    @property
    def summary(self) -> str:
        """Whether the moves suppress transmission at some peaks, in two or three sentences."""
        return _summary(self)


def scene_plant(
    scene: ShaftScene,
    moves: Mapping[str, float] | None = None,
    *,
    force: Place,
    sample_rate: float,
) -> Plant:
    """Shaft of a scene in steady running, with a vertical accelerometer on every housing.

    Parameters
    ----------
    scene : ShaftScene
    moves : mapping of str to float, optional
        Bearing -> upward move [m].
    force : place
        Place of the test force: ``(bearing or station, "y" or "z")`` on the shaft, or
        ``(bearing, "y" or "z", "housing")``. A station must be a node of the beam: at a disc, a
        load, a bearing or the coupling.
    sample_rate : float
        Sample rate of the test [Hz].

    Returns
    -------
    Plant
        Its own vibration comes from unbalance, blade rate, coupling and turbulence of the scene;
        every channel has the noise of the noisiest accelerometer.

    Raises
    ------
    ShaftFilmError
        Beam and films have no equilibrium.
    RigError, ValueError
        A place or a move is unknown.
    """
    state = shaft_state(scene, moves)
    return rotor_plant(
        state.rotor,
        speed=math.tau * scene.drive.speed,
        force=force,
        responses={b.name: (b.name, "y", "housing") for b in scene.bearings},
        sample_rate=sample_rate,
        harmonics=harmonic_forces(scene),
        broadband=random_forces(scene.model_copy(update={"sample_rate": sample_rate})),
        noise=max((sensor.noise for sensor in scene.sensors), default=0.0),
    )


def turned_scene(scene: ShaftScene, turns: Mapping[str, float]) -> ShaftScene:
    """Turn the bearings of a scene, as by slope boring.

    Parameters
    ----------
    scene : ShaftScene
    turns : mapping of str to float
        Bearing -> increase of the slope dy/dx of its bore [rad].

    Returns
    -------
    ShaftScene

    Raises
    ------
    RigError
        A turn names an unknown bearing.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> turned_scene(load_scene("propulsion-shaft"), {"stern_aft": 1e-4}).bearings[0].slope
    0.0001
    """
    names = [bearing.name for bearing in scene.bearings]
    unknown = sorted(set(turns) - set(names))
    if unknown:
        raise RigError(
            "\n".join(
                f"turns: '{name}' is no bearing; choose one of {', '.join(names)}"
                for name in unknown
            )
        )
    bearings = tuple(
        bearing.model_copy(update={"slope": bearing.slope + turns.get(bearing.name, 0.0)})
        for bearing in scene.bearings
    )
    return scene.model_copy(update={"bearings": bearings})


def before_after(
    scene: ShaftScene,
    moves: Mapping[str, float],
    *,
    force: Place,
    turns: Mapping[str, float] | None = None,
    setup: HammerTest | ShakerTest | None = None,
    seed: int = 0,
) -> BeforeAfter:
    """Test a shaft before and after its bearings are moved, and compare the peaks.

    Parameters
    ----------
    scene : ShaftScene
    moves : mapping of str to float
        Bearing -> upward move [m], as a load calibration proposes.
    force : place
        Place of the test force, see `scene_plant`.
    turns : mapping of str to float, optional
        Bearing -> rotation of its bore [rad].
    setup : HammerTest or ShakerTest, optional
        By default ``HammerTest()``.
    seed : int
        Seed of both tests, which are independent of each other.

    Returns
    -------
    BeforeAfter

    Raises
    ------
    ShaftFilmError, RigError
        As in `scene_plant`, `run_test`.

    Notes
    -----
    It tests the claim that calibration of the bearing loads suppresses the transmission of
    vibration at some peaks.

    References
    ----------
    Zhang, Suo (2020), Research on the influence of shafting alignment condition on transverse
    vibration transmission characteristics, Ship Science and Technology 42(6), 65-70,
    doi:10.3404/j.issn.1672-7649.2020.06.013.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> result = before_after(load_scene("propulsion-shaft"), {"intermediate_aft": 5e-4},
    ...                       force=("stern_aft", "y"), setup=ShakerTest(bursts=10, quiet=5.0))
    >>> result.summary.split(" peaks ")[0][:3], len(result.changes) > 5
    ('Of ', True)
    """
    test = HammerTest() if setup is None else setup
    seeds = np.random.SeedSequence(seed).generate_state(2)
    before, after = (
        run_test(
            scene_plant(state, lifts, force=force, sample_rate=test.sample_rate),
            test,
            seed=int(own),
        )
        for state, lifts, own in (
            (scene, None, seeds[0]),
            (turned_scene(scene, turns or {}), moves, seeds[1]),
        )
    )
    return BeforeAfter(
        scene=scene.name,
        moves=dict(moves),
        force=force,
        before=before,
        after=after,
        changes=peak_changes(before, after),
    )


def calibrated_test(
    scene: Scene,
    calibration: Calibration | None,
    kind: str,
    *,
    push: str | None = None,
    seed: int = 0,
) -> BeforeAfter | None:
    """Test a shaft before and after the moves of a calibration.

    Parameters
    ----------
    scene : Scene
        Scene of the machine propulsion-shaft.
    calibration : Calibration or None
        From :func:`wearstate.sim.alignment.calibration.calibrate`.
    kind : str
        Name of a kind in `TEST_KINDS`, with the setup of `usual_setup`.
    push : str, optional
        Bearing whose journal is pushed up; by default the aftmost one.
    seed : int

    Returns
    -------
    BeforeAfter or None
        None if nothing is moved.

    Raises
    ------
    ShaftFilmError, RigError
        As in `before_after`; or the scene is not a shaft line, or `push` is not a bearing of it.
    """
    if not isinstance(scene, ShaftScene):
        raise RigError(
            f"machine of scene '{scene.name}' = '{scene.machine}' must be 'propulsion-shaft'; "
            "only a shaft line has an alignment to test"
        )
    names = [bearing.name for bearing in scene.bearings]
    if push is not None and push not in names:
        raise RigError(f"push = '{push}' is no bearing; choose one of {', '.join(names)}")
    if calibration is None or not calibration.moved:
        return None
    moves = dict(zip(calibration.line.names, map(float, calibration.moves), strict=True))
    turns = dict(zip(calibration.line.names, map(float, calibration.turns), strict=True))
    force = (push or names[0], "y")
    return before_after(
        scene,
        moves,
        turns=turns,
        force=force,
        setup=usual_setup(kind, scene, ((None, None), (moves, turns)), force=force),
        seed=seed,
    )


def usual_setup(
    kind: str,
    scene: ShaftScene,
    states: Sequence[tuple[Mapping[str, float] | None, Mapping[str, float] | None]],
    *,
    force: Place,
) -> HammerTest | ShakerTest:
    """Test sized for the shaft, with blocks long enough for every state.

    Parameters
    ----------
    kind : str
        Name of a kind in `TEST_KINDS`.
    scene : ShaftScene
    states : sequence of tuple
        Moves [m] and turns [rad] of each state to be tested.
    force : place

    Returns
    -------
    HammerTest or ShakerTest
        Peak force a fifth of the shaft's weight for a hammer, rms force a fiftieth for a shaker;
        noise of the force cell 5e-6 of it. Blocks of 4 s, or as many whole seconds as the responses
        need.

    Raises
    ------
    ShaftFilmError, RigError, ValueError
        As in `scene_plant`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("propulsion-shaft")
    >>> found = usual_setup("hammer", scene, [(None, None)], force=("stern_aft", "y"))
    >>> round(found.peak_force / 1e3), found.block
    (20, 4.0)
    """
    weight = shaft_beam(scene).weight
    noise = _CELL_SHARE * weight
    setup: HammerTest | ShakerTest = ShakerTest(force=_SHAKER_SHARE * weight, force_noise=noise)
    if kind == "hammer":
        setup = HammerTest(peak_force=_BLOW_SHARE * weight, force_noise=noise)
    plants = [
        scene_plant(
            turned_scene(scene, turns or {}), moves, force=force, sample_rate=setup.sample_rate
        )
        for moves, turns in states
    ]
    longest = max(
        (needed_time(plant, setup) for plant in plants if plant.reduced.stable), default=0.0
    )
    return replace(
        setup, block=float(max(setup.block, math.ceil(setup.block * longest / free_time(setup))))
    )


def _summary(result: BeforeAfter) -> str:
    counted = len(result.changes)
    if not counted:
        return "No peak exceeds the scatter: average more, push harder or run more quietly."
    fell, rose = result.of("suppressed"), result.of("amplified")
    texts = [
        f"Of {counted} peaks {len(fell)} fell and {len(rose)} rose significantly "
        f"({len(result.before.channels)} bearings, all peaks taken together)."
    ]
    for changes, word, pick in ((fell, "fall", min), (rose, "rise", max)):
        if changes:
            most = pick(changes, key=lambda peak: peak.change)
            low, high = most.interval
            texts.append(
                f"Largest {word}: {most.change:+.1f} dB ({low:+.1f} … {high:+.1f}) at "
                f"{most.channel}, {most.frequency_before:.1f} Hz."
            )
    truths = [peak.model_change for peak in result.changes]
    texts.append(f"In the model these peaks change by {min(truths):+.1f} … {max(truths):+.1f} dB.")
    return " ".join([*texts, _power(result.changes)])


def _power(changes: Sequence[PeakChange]) -> str:
    """Sentence on which effects of the moves such a test can show."""
    scatter = [peak.scatter for peak in changes]
    shown = [peak for peak in changes if peak.expected]
    scatters = (
        f"The change of a peak scatters by ±{min(scatter):.1f} to ±{max(scatter):.1f} dB in this "
        "test; in the model "
    )
    if not shown:
        return f"{scatters}no peak changes by more, so the test cannot show what these moves do."
    most = max(shown, key=lambda peak: abs(peak.model_change) / peak.scatter)
    verb = "changes" if len(shown) == 1 else "change"
    return (
        f"{scatters}{len(shown)} of {len(changes)} peaks {verb} by more and "
        f"may show it, above all {most.channel} at "
        f"{most.frequency_before:.1f} Hz ({most.model_change:+.1f} dB)."
    )


def rig_table(result: BeforeAfter) -> dict[str, Any]:
    """Results of a test before and after, in SI and decibels, ready for JSON.

    Parameters
    ----------
    result : BeforeAfter

    Returns
    -------
    dict
        ``kind``, ``force_place``, ``moves_m``, ``averages``, ``summary``, ``rejected`` and
        ``peaks``, one dictionary for each `PeakChange`.
    """
    return {
        "kind": TEST_KINDS[type(result.before.setup)].name,
        "force_place": list(result.force) if isinstance(result.force, tuple) else result.force,
        "moves_m": result.moves,
        "averages": [test.frf.averages for test in (result.before, result.after)],
        "rejected": [*result.before.rejected, *result.after.rejected],
        "summary": result.summary,
        "peaks": [
            asdict(peak) | {"scatter": peak.scatter, "expected": peak.expected}
            for peak in result.changes
        ],
    }


def rig_text(result: BeforeAfter) -> str:
    """Results of a test before and after, for a terminal.

    Parameters
    ----------
    result : BeforeAfter

    Returns
    -------
    str
        One line per peak: place, level before, and change with its interval.
    """
    kind = TEST_KINDS[type(result.before.setup)].name
    count, where = round(result.before.frf.averages), _in_words(result.force)
    lines = [
        f"simulated {kind} test, pushing {where}, {count} blocks before and after",
        f"  {result.summary}",
    ]
    if result.changes:
        lines.append(
            f"  {'bearing':22} {'Hz':>7} {'dB re 1 (m/s²)/N':>17} {'change dB':>10} "
            f"{'interval':>15} {'model':>6}  {'verdict':10} by model"
        )
    for peak in result.changes:
        low, high = peak.interval
        lines.append(
            f"  {peak.channel:22} {peak.frequency_before:7.1f} {peak.level_before:17.1f} "
            f"{peak.change:+10.1f} {f'{low:+.1f} … {high:+.1f}':>15} {peak.model_change:+6.1f}"
            f"  {peak.verdict:10} {EXPECTED[peak.expected]}"
        )
    return "\n".join(lines)


EXPECTED = {True: "may show", False: "too small"}
"""Whether the change in the model is larger than the scatter of the test."""


def _in_words(place: Place) -> str:
    where, coordinate, *part = named_place(place)
    name = where if isinstance(where, str) else f"the shaft at {where:g} m"
    of = "the housing of " if part == ["housing"] else ""
    return f"{of}{name} {'up' if coordinate == 'y' else 'sideways'}"
