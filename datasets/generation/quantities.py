"""Quantities of interest in words, and the rungs that they ask for."""

from dataclasses import replace

from ...sim.fidelity.choose import Resolution, resolve, resolved_scene
from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from .machines import edges_of_bands, known_of


def quantity_label(name: str, scene: Scene) -> tuple[str, str]:
    """A quantity of interest in words, and its unit.

    Parameters
    ----------
    name : str
        Of the machine of the scene.
    scene : Scene
        That it is of.

    Returns
    -------
    tuple of str
        An unknown name stands for itself.

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
    """A scene that can be run: with ``fidelity = "auto"`` the least model that it needs.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    scene : Scene
        With fidelity "given".
    resolution : Resolution or None
        What was chosen and why; None where the scene says itself.

    Raises
    ------
    SceneError
        The reference of the choice cannot be run.

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
    """A solution whose estimated error is the one that was measured when its rungs were chosen."""
    numerics = {**solution.numerics, "estimated_error": resolution.estimated_error}
    return replace(solution, numerics=numerics)
