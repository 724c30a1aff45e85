"""Simulation of any scene, importing only the physics that it needs."""

from collections.abc import Collection, Hashable, Iterator, Sequence
from dataclasses import replace

from ..output.recording import Recorder, Recording
from ..scene.plausibility import solution_doubts
from ..scene.scene import Scene, SceneError
from .registry import machine_of


def simulate(
    scene: Scene, *, seed: int, truth: bool = False, raise_on_failure: bool = True
) -> Recording:
    """Simulate one recording of a scene.

    Parameters
    ----------
    scene : Scene
        A validated scene, see :func:`wearstate.sim.scene.load.load_scene`.
    seed : int
        Seed of the sensor noise; the mechanics are deterministic.
    truth : bool
        Also return forces and orbit at the sample instants.
    raise_on_failure : bool
        False: a failed run is returned with its status and a signal of zeros.

    Returns
    -------
    Recording
        Signal, channels, status, numerics, and truth if requested; its warnings include implausible
        values of scene and signal, see :mod:`.scene.plausibility`. The ``estimated_error``
        of its numerics is that of rungs and steps: it does not cover how realistic the scene is.

    Raises
    ------
    SceneError
        A rung is not valid for the scene, the step is too long for the contact, the recording is
        shorter than a revolution, or pulses or modes cannot be sampled; or its fidelity is not
        resolved.
    SimulationError
        The run failed and `raise_on_failure` is true.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("bilge-pump", {"duration": "0.2 s"})
    >>> simulate(scene, seed=1).signal.shape
    (3, 5120)
    """
    _refuse_unresolved(scene)
    return _with_doubts(scene, machine_of(scene).simulate(scene, seed, truth, raise_on_failure))


def simulate_many(
    jobs: Sequence[tuple[Scene, int]], *, truth: Collection[str] = (), doubts: bool = True
) -> Iterator[tuple[int, Recording | SceneError]]:
    """Simulate recordings of many scenes of one machine, in parallel where possible.

    Parameters
    ----------
    jobs : sequence of (Scene, int)
        Scene and seed of each, all of the same machine.
    truth : collection of str
        Names of the truth needed. A recording has at least these; fewer may be faster.
    doubts : bool
        False: only warnings of the run, without plausibility checks of scene and signal, which cost
        a spectrum per channel.

    Yields
    ------
    number : int
        Number of the job. Every job is returned once, in any order.
    recording : Recording or SceneError
        The same bytes as from :func:`simulate`, independent of the other jobs; a failed run with
        its status and a signal of zeros. Or the faults of a scene that is refused.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("bilge-pump", {"duration": "0.25 s"})
    >>> found = dict(simulate_many([(scene, seed) for seed in range(2)]))
    >>> bool((found[1].signal == simulate(scene, seed=1).signal).all())
    True
    """
    if not jobs:
        return
    many = machine_of(jobs[0][0]).many or _one_by_one
    for number, found in many(jobs, truth):
        if doubts and not isinstance(found, SceneError):
            found = _with_doubts(jobs[number][0], found)
        yield number, found


def simulates_together(scene: Scene) -> bool:
    """Whether records of a scene's machine are faster in parallel.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> simulates_together(load_scene("bilge-pump")), simulates_together(load_scene("shaft-rig"))
    (True, False)
    """
    return machine_of(scene).many is not None


def alike(scene: Scene) -> Hashable:
    """Key of scenes of a machine that are best simulated together.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> tight = load_scene("bilge-pump", {"joint.crankpin.rung": "link"})
    >>> alike(load_scene("bilge-pump")) == alike(tight)
    False
    """
    return machine_of(scene).alike(scene)


def _one_by_one(
    jobs: Sequence[tuple[Scene, int]], truth: Collection[str]
) -> Iterator[tuple[int, Recording | SceneError]]:
    for number, (scene, seed) in enumerate(jobs):
        try:
            yield number, machine_of(scene).simulate(scene, seed, bool(truth), False)
        except SceneError as error:
            yield number, error


def _with_doubts(scene: Scene, solution: Recording) -> Recording:
    if not solution.status.ok:
        return solution
    doubts = tuple(doubt.text for doubt in solution_doubts(scene, solution))
    return replace(solution, warnings=(*solution.warnings, *doubts))


def recorder(scene: Scene) -> Recorder:
    """Function that simulates a scene from many starts, sharing their common work.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    callable
        Scene, seed, truth, raise_on_failure, as in :func:`simulate`; the scene may differ from this
        one only in its start angle. Warnings are those of the run, without plausibility checks.

    Raises
    ------
    SceneError
        As in :func:`simulate`; for a machine without shared work, raised only when called.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("propulsion-shaft", {"duration": "0.4 s"})
    >>> again = recorder(scene)
    >>> bool((again(scene, 1, False, True).signal == simulate(scene, seed=1).signal).all())
    True
    """
    _refuse_unresolved(scene)
    machine = machine_of(scene)
    return machine.recorder(scene) if machine.recorder else machine.simulate


def check(scene: Scene) -> None:
    """Check rungs, step and sampling, which need the physics.

    Raises
    ------
    SceneError
        All faults together.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> check(load_scene("bilge-pump"))
    """
    machine_of(scene).check(scene)


def _refuse_unresolved(scene: Scene) -> None:
    """Refuse fidelity = 'auto': it is resolved by features, which this package does not use."""
    if scene.fidelity == "auto":
        fault = (
            "fidelity = 'auto' must be resolved before a run; set fidelity = 'given', or call "
            "wearstate.datasets.generation.quantities.resolved(scene)"
        )
        raise SceneError(scene.name, [fault])
