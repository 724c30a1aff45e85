"""One simulated recording of a scene, by name: rungs chosen where the scene leaves them open."""

from operator import index
from pathlib import Path

from ...sim.machine import simulate as machine
from ...sim.output.recording import Recording
from ...sim.scene.load import load_scene
from ...sim.scene.parts import Scene
from .quantities import resolved, with_estimate


def simulate(
    scene: Scene | str | Path,
    *,
    seed: int = 0,
    truth: bool = False,
    raise_on_failure: bool = True,
) -> Recording:
    """Simulate one recording of a machine.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene, as of :func:`wearstate.load_scene`, the name of a built-in one, or a TOML file.
        With ``fidelity = "auto"`` the cheapest rungs that meet its accuracy are chosen first.
    seed : int
        Seed of the sensor noise; the mechanics are deterministic.
    truth : bool
        Also keep what no sensor tells (forces, orbits, pressures) in ``truth``, over ``time``.
    raise_on_failure : bool
        False: a failed run comes back with its status and a signal of zeros.

    Returns
    -------
    Recording
        Its ``warnings`` say what of scene and signal is hardly meant.

    Raises
    ------
    ValueError
        If `seed` is negative.
    SceneError
        There is no such scene, or a rung, the step or a sensor does not fit it.
    SimulationError
        The run failed and `raise_on_failure` is true.

    Examples
    --------
    >>> import wearstate
    >>> wearstate.simulate("bilge-pump")
    <Recording bilge-pump 4.8 s, 25.6 kHz, acc_x acc_y tacho>
    >>> scene = wearstate.load_scene("bilge-pump", {"duration": "1 s"})
    >>> recording = wearstate.simulate(scene, truth=True)
    >>> recording.truth["pin_force_n"].shape, recording.time.shape
    ((25600, 2), (25600,))
    """
    if index(seed) < 0:
        raise ValueError(f"seed = {seed} must be a whole number >= 0")
    chosen, resolution = resolved(scene if isinstance(scene, Scene) else load_scene(scene))
    recording = machine.simulate(chosen, seed=seed, truth=truth, raise_on_failure=raise_on_failure)
    return recording if resolution is None else with_estimate(recording, resolution)
