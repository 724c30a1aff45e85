"""Pictures of a simulated recording, always marked as simulated."""

from pathlib import Path

from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from ..pages.page import short_name
from ..pages.picture import save_picture
from .registry import presentation_of


def plot_simulation(scene: Scene, solution: Recording, path: Path, *, force: bool = True) -> None:
    """Draw a simulated recording with forces, pressures and orbits that sensors do not show.

    Parameters
    ----------
    scene : Scene
    solution : Recording
        Recording with truth.
    path : Path
        ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        The suffix is none of these.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7), layout="constrained")
    figure.suptitle(f"{short_name(scene.name, 90)} (simulated)")
    presentation_of(scene).draw(figure, scene, solution)
    save_picture(figure, path, force=force)
