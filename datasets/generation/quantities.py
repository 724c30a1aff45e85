"""Descriptions of quantities of interest, and the rungs that a scene needs."""

from dataclasses import replace

from ...sim.fidelity.choose import Resolution, resolve, resolved_scene
from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from .machines import edges_of_bands, known_of


def quantity_label(name: str, scene: Scene) -> tuple[str, str]:
    """Description of a quantity of interest, and its unit.

    Parameters
    ----------
    name : str
        Name of the quantity.
    scene : Scene
        Scene of its machine.

    Returns
    -------
    tuple of str
        Description and unit; an unknown name is returned as it is.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> quantity_label("band_3", load_scene("bilge-pump"))
    ('vibration level, 306 to 758 Hz', 'dB')
    >>> quantity_label("pin_rms_2", load_scene("triplex-pump"))
    ('rms crank pin force, throw 2', 'N')
    >>> quantity_label("orbit_second", load_scene("shaft-rig"))
    ("rms orbit radius at bearing 'second'", 'm')
    """
    known = known_of(scene).words
    stem, _, last = name.rpartition("_")
    if stem in ("band", "order"):
        text = _band_words(int(last), scene.sample_rate) if stem == "band" else f"at order {last}"
        return f"vibration level, {text}", "dB"
    if name in known:
        return known[name]
    if stem in known and last.isdecimal():
        words, unit = known[stem]
        return f"{words}, throw {last}", unit
    kind, _, bearing = name.partition("_")
    words, unit = known.get(kind, ("", ""))
    return (f"{words} '{bearing}'", unit) if words else (name, "")


def _band_words(number: int, fs: float) -> str:
    low, high = edges_of_bands(fs)[number - 1 : number + 1]
    if high < _KILO:
        return f"{low:.0f} to {high:.0f} Hz"
    return f"{low / _KILO:.2g} to {high / _KILO:.2g} kHz"


_KILO = 1000.0  # Hz


def resolved(scene: Scene) -> tuple[Scene, Resolution | None]:
    """A scene that can be run: with ``fidelity = "auto"``, the cheapest sufficient models.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    scene : Scene
        Scene with fidelity "given".
    resolution : Resolution or None
        The choice and its reasons; None if the scene has fidelity "given".

    Raises
    ------
    SceneError
        If the reference of the choice cannot be run.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> scene = load_scene("journal-step", {"fidelity": "auto", "pinned": ["film", "mesh"]})
    >>> chosen, resolution = resolved(scene)
    >>> chosen.fidelity, resolution.status
    ('given', 'resolved')
    """
    if scene.fidelity == "given":
        return scene, None
    known = known_of(scene)
    found = resolve(scene, known.quantities, truth=known.truth)
    return resolved_scene(scene, found), found


def with_estimate(solution: Recording, resolution: Resolution) -> Recording:
    """A solution with the error estimate that was measured when its rungs were chosen."""
    numerics = {**solution.numerics, "estimated_error": resolution.estimated_error}
    return replace(solution, numerics=numerics)
