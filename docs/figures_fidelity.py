"""Pictures of the page on fidelity: ``python docs/figures_fidelity.py [FOLDER]``, all simulated.

Small charts and maps of a few scenes, half a minute on one core: a chart shows speed against
accuracy of every rung and step (``wearstate chart``), a map where each method fails
(``wearstate stability``). ``--scenes NAME ...`` writes the full charts and atlases of these scenes
instead, in up to ten minutes each, and prints the text of every chart to stdout. Atlases have no
time budget and are the same on every machine.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sheets import write
from wearstate.diagnose.charts.chart import Chart, chart_text
from wearstate.diagnose.charts.figure import question_figure
from wearstate.diagnose.charts.of_scene import scene_chart
from wearstate.diagnose.charts.page import save_chart
from wearstate.diagnose.stability.atlas import atlas
from wearstate.diagnose.stability.figure import atlas_figure, save_figure
from wearstate.sim.scene.load import load_scene, scene_names

BUDGET = 300.0
"""Time of a chart [s]; the picture names what was left out for lack of time."""

JOBS = 2
"""Worker processes of a chart; its errors do not depend on them."""

SHORTER: dict[str, dict[str, Any]] = {
    "bilge-pump": {"duration": "0.8 s"},  # four revolutions
    "triplex-pump": {"duration": "0.8 s"},
    "journal-bearing": {"duration": "0.4 s"},  # twenty
    "journal-unbalance": {"duration": "0.16 s", "settling_revolutions": 6},
    "journal-whirl": {"duration": "0.25 s", "start.x": 0.6},  # near its limit cycle
}
"""Scenes with a shortened recording, so that all rungs fit into a budget of minutes."""

COARSER: dict[str, dict[str, Any]] = {
    "slider-crank-benchmark": {"accuracy": 0.05},  # 0.02 takes 512 starts of every step
    "triplex-pump": {"accuracy": 0.05},
}
"""Scenes whose knocks scatter too much for their own accuracy in that time."""


def chart(name: str, budget: float | None = BUDGET, jobs: int = JOBS) -> Chart:
    """Chart of a scene, pinned rungs as written."""
    changes = SHORTER.get(name, {}) | COARSER.get(name, {})
    return scene_chart(load_scene(name, changes), budget=budget, jobs=jobs)


def small_chart() -> Figure:
    """Chart of a journal bearing over ten revolutions, with every combination."""
    found = scene_chart(load_scene("journal-bearing", {"duration": "0.2 s"}), jobs=1)
    return question_figure(found, found.questions[-1])  # with other rungs allowed


def small_map(name: str, plan: str, size: int) -> Figure:
    """Map of a scene with `size` cells along either axis."""
    scene = load_scene(name)
    return atlas_figure(scene, atlas(scene, name=plan, size=size))


FIGURES: dict[str, Callable[[], Figure]] = {
    "fidelity-chart": small_chart,
    "fidelity-contact": lambda: small_map("bilge-pump", "step-stiffness", 7),
    "fidelity-squeeze": lambda: small_map("journal-bearing", "step-squeeze", 8),
}


def whole(names: Sequence[str], folder: Path) -> None:
    """Write charts and atlases of scenes, and print the text of the charts."""
    for name in names:
        found = chart(name)
        save_chart(found, folder / f"chart-{name}.png")
        print(chart_text(found), end="\n\n", flush=True)
        scene = load_scene(name)
        maps = atlas(scene)
        if maps:
            save_figure(scene, maps, folder / f"atlas-{name}.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Pictures of the page on fidelity.")
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parent / "img")
    parser.add_argument("--scenes", nargs="+", choices=scene_names(), metavar="NAME")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.scenes:
        whole(given.scenes, given.folder)
    else:
        write(FIGURES, given.folder, dpi=100)
