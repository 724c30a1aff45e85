"""One simulated recording of a scene, with rungs chosen if the scene leaves them open."""

from collections.abc import Mapping
from dataclasses import replace
from operator import index
from pathlib import Path
from typing import Any

from ...sim.machine import simulate as machine
from ...sim.output.recording import Recording
from ...sim.scene.load import load_scene, scene_from_table
from ...sim.scene.scene import Scene, SceneError
from ..recipe.recipe import condition_of, conditions_of
from .quantities import resolved, with_estimate


def simulate(
    scene: Scene | str | Path | Mapping[str, Any],
    *,
    seed: int = 0,
    truth: bool = False,
    raise_on_failure: bool = True,
) -> Recording:
    """Simulate one recording of a machine.

    Parameters
    ----------
    scene : Scene, str, Path or mapping
        Scene, as from :func:`wearstate.load_scene`, name of a built-in one, TOML file, or table of
        a scene as in such a file. With ``fidelity = "auto"`` the cheapest rungs that meet its
        accuracy are chosen first.
    seed : int
        Seed of the sensor noise; the mechanics are deterministic.
    truth : bool
        Also keep quantities that no sensor measures (forces, orbits, pressures) in ``truth``, over
        ``time``.
    raise_on_failure : bool
        If False, a failed run is returned with its status and a signal of zeros.

    Returns
    -------
    Recording
        Its ``warnings`` list implausible properties of scene and signal, its ``row`` holds the
        operating conditions (speed, pressures, load, oil), which models use.

    Raises
    ------
    ValueError
        If `seed` is negative.
    SceneError
        If there is no such scene, or a rung, the step or a sensor does not fit it.
    SimulationError
        If the run failed and `raise_on_failure` is true.

    Examples
    --------
    >>> import wearstate
    >>> wearstate.simulate("bilge-pump")
    <Recording bilge-pump 4.8 s, 25.6 kHz, acc_x acc_y tacho>
    >>> scene = wearstate.load_scene("bilge-pump", {"duration": "1 s"})
    >>> recording = wearstate.simulate(scene, truth=True)
    >>> recording.truth["pin_force_n"].shape, recording.time.shape
    ((25600, 2), (25600,))
    >>> recording.row["discharge_pressure_pa"]
    300000.0

    A table as from a TOML file is a scene, too:

    >>> table = scene.model_dump(mode="json", exclude_none=True)
    >>> wearstate.simulate({**table, "duration": "0.5 s"}).duration
    0.5
    """
    if index(seed) < 0:
        raise ValueError(f"seed = {seed} must be a whole number >= 0")
    chosen, resolution = resolved(_scene_of(scene))
    recording = machine.simulate(chosen, seed=seed, truth=truth, raise_on_failure=raise_on_failure)
    known = {name: condition_of(chosen, name) for name in conditions_of(chosen)}
    recording = replace(recording, row={**recording.row, **known})
    return recording if resolution is None else with_estimate(recording, resolution)


def _scene_of(scene: Scene | str | Path | Mapping[str, Any]) -> Scene:
    """Scene from any of its forms."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, Mapping):
        paths = [str(key) for key in scene if "." in str(key)]
        if paths and "machine" not in scene:
            fault = (
                "is a value of a scene, must be a scene: load_scene(NAME, {...}) replaces values"
            )
            raise SceneError("scene", [f"{path} {fault}" for path in paths])
        return scene_from_table(scene)
    return load_scene(scene)
