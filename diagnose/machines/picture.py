"""Pictures of a simulated recording. Always says that it is simulated."""

from pathlib import Path

from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene
from ..pages.page import short_name
from ..pages.picture import save_picture
from .registry import presentation_of


def plot_simulation(scene: Scene, solution: Recording, path: Path, *, force: bool = True) -> None:
    """Draw a simulated recording with what its sensors do not see: forces, pressures, orbits.

    Parameters
    ----------
    scene : Scene
    solution : Recording
        With truth.
    path : Path
        ``.png``, ``.svg`` or ``.pdf``.
    force : bool
        Replace an existing file.

    Raises
    ------
    DataError
        Another suffix.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 7), layout="constrained")
    figure.suptitle(f"{short_name(scene.name, 90)} (simulated)")
    presentation_of(scene).draw(figure, scene, solution)
    save_picture(figure, path, force=force)
