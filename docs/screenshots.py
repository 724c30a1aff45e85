"""Screenshots of HTML pages at the width of a phone and of a window.

``python docs/screenshots.py``, which ``make docs`` calls through ``pictures.py``, takes about a
minute, and does nothing if the program has not changed. It writes ``docs/_build/screens.md``, which
``docs/pages.md`` includes; without Chromium that file only says so.
"""

import shutil
import subprocess
import sys
from html import escape
from pathlib import Path

from pictures import DOCS, FOLDER, current
from PIL import Image

BUILD = DOCS / "_build"
WORDS = BUILD / "screens.md"
STAMP = BUILD / ".screens.made"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PHONE, WINDOW, HEIGHT = 390, 1280, 1100  # px
SPARE = 100  # px at the bottom, which a busy browser may leave unpainted

PAGES = {
    "report": ("One recording", "report demo/data.h5 --record 5 --model demo/model.wsm -o"),
    "zoom": (
        "Interactive plots of a recording",
        "info demo/data.h5 --record 5 --interactive --plot",
    ),
    "card": ("A data set", "info demo/data.h5 --card"),
    "evaluate": ("Evaluation of a model", "evaluate demo/model.wsm demo/data.h5 --quick -j 1 -o"),
    "align": ("A shaft line", "align propulsion-shaft --set bearings.2.sag=1.6mm -o"),
    "chart": (
        "Speed against accuracy",
        "chart journal-bearing --set duration=0.3 --budget 10 -j 1 -o",
    ),
    "atlas": (
        "Where numerical methods fail",
        "stability journal-bearing --map eccentricity-mesh --size 6 -o",
    ),
}
"""Kind -> heading and command, without the name of the page."""

SIDE_BY_SIDE = """<!DOCTYPE html><meta charset="utf-8">
<body style="margin: 0; display: flex; gap: 20px; background: #9aa3ab">
<iframe width="{phone}" height="{height}" style="border: 0" srcdoc="{page}"></iframe>
<iframe width="{window}" height="{height}" style="border: 0" srcdoc="{page}"></iframe>"""


def wearstate(command: str) -> None:
    """Run a wearstate command in the build folder."""
    program = [sys.executable, "-m", "wearstate", *command.split()]
    subprocess.run(program, check=True, capture_output=True, cwd=BUILD)


def shoot(browser: str, kind: str, command: str) -> None:
    """Write a page and a picture of it at both widths.

    Frames show them, because a browser window cannot be as narrow as a phone.
    """
    wearstate(f"{command} {kind}.html --force")
    html = (BUILD / f"{kind}.html").read_text(encoding="utf-8")
    sizes = {"phone": PHONE, "window": WINDOW, "height": HEIGHT}
    sheet = BUILD / f"{kind}.both.html"
    sheet.write_text(SIDE_BY_SIDE.format(page=escape(html), **sizes), encoding="utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    width = PHONE + 20 + WINDOW
    options += [f"--window-size={width},{HEIGHT + SPARE}", "--virtual-time-budget=20000"]
    picture = FOLDER / f"screen-{kind}.png"
    command_line = [browser, *options, f"--screenshot={picture}", sheet.as_uri()]
    subprocess.run(command_line, check=True, capture_output=True, timeout=120)
    Image.open(picture).crop((0, 0, width, HEIGHT)).save(picture)


def main() -> None:
    """Make the screenshots and the text around them if the program has changed."""
    BUILD.mkdir(exist_ok=True)
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if browser is None:
        WORDS.write_text("No pictures here: no Chromium was found when this site was built.\n")
        return
    known = current(Path(__file__).name)
    if STAMP.is_file() and STAMP.read_text() == known and WORDS.is_file():
        return
    (BUILD / "demo").mkdir(exist_ok=True)
    wearstate("generate bilge-pump-small -n 60 -j 1 -o demo/data.h5 --force")
    wearstate("train demo/data.h5 -j 1 -o demo/model.wsm --force")
    parts = []
    for kind, (heading, command) in PAGES.items():
        shoot(browser, kind, command)
        call = f"wearstate {command.replace('demo/', '')} {kind}.html"
        parts.append(f"## {heading}\n\n`{call}`\n\n![{heading}](img/screen-{kind}.png)\n")
    WORDS.write_text("\n".join(parts))
    STAMP.write_text(known)


if __name__ == "__main__":
    main()
