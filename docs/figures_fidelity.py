"""Charts and atlases of the built-in scenes: ``python docs/figures_fidelity.py [NAME …]``.

All simulated. A chart is speed against accuracy of every rung and step (``wearstate chart``), an
atlas shows where each method fails (``wearstate stability``). Up to ten minutes a scene on one
core; the text of every chart goes to stdout. Atlases have no budget: they come out the same on
every machine.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wearstate.diagnose.charts.chart import Chart, chart_text
from wearstate.diagnose.charts.of_scene import scene_chart
from wearstate.diagnose.charts.page import save_chart
from wearstate.diagnose.stability.atlas import atlas
from wearstate.diagnose.stability.figure import save_figure
from wearstate.sim.scene.load import load_scene, scene_names

BUDGET = 300.0
"""Seconds of a chart; what it leaves no time for is said in the picture."""

JOBS = 2
"""Worker processes of a chart; its errors do not depend on them."""

SHORTER: dict[str, dict[str, Any]] = {
    "bilge-pump": {"duration": "0.8 s"},  # four revolutions
    "triplex-pump": {"duration": "0.8 s"},
    "journal-bearing": {"duration": "0.4 s"},  # twenty
    "journal-unbalance": {"duration": "0.16 s", "settling_revolutions": 6},
    "journal-whirl": {"duration": "0.25 s", "start.x": 0.6},  # near its limit cycle
}
"""Scenes whose recording is cut, so that a budget of minutes sees all rungs."""

COARSER: dict[str, dict[str, Any]] = {
    "slider-crank-benchmark": {"accuracy": 0.05},  # 0.02 takes 512 starts of every step
    "triplex-pump": {"accuracy": 0.05},
}
"""Scenes whose knocks scatter too much for their own accuracy in that time."""


def chart(name: str, budget: float | None = BUDGET, jobs: int = JOBS) -> Chart:
    """Chart of a scene, with its rungs as written where they are pinned."""
    changes = SHORTER.get(name, {}) | COARSER.get(name, {})
    return scene_chart(load_scene(name, changes), budget=budget, jobs=jobs)


def main(names: Sequence[str], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names or scene_names():
        found = chart(name)
        save_chart(found, folder / f"chart-{name}.png")
        print(chart_text(found), end="\n\n", flush=True)
        scene = load_scene(name)
        maps = atlas(scene)
        if maps:
            save_figure(scene, maps, folder / f"atlas-{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:], Path(__file__).parent / "img")
