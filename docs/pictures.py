"""Make the pictures of the pages that are missing or older than the program.

``python docs/pictures.py [JOBS]``, which ``make docs`` calls, also makes the screenshots of pages
(``screenshots.py``); one to two minutes on two cores.
"""

import hashlib
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

DOCS = Path(__file__).parent
FOLDER = DOCS / "img"
SCRIPTS = tuple(  # the longest first
    f"figures_{part}.py" for part in ("fidelity", "shaft", "pump", "journal", "oil")
)
FLOORS = ("sim", "features", "datasets", "diagnose")


def state(sources: Iterable[Path]) -> str:
    """Hash of all files that the pictures depend on."""
    digest = hashlib.sha256()
    for path in sorted(sources):
        digest.update(str(path.relative_to(DOCS.parent)).encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def current(script: str) -> str:
    """Hash of the program and of a script."""
    sources = [DOCS / script, DOCS / "sheets.py"]
    for floor in FLOORS:
        for kind in ("*.py", "*.toml"):
            sources += (DOCS.parent / floor).rglob(kind)
    return state(sources)


def stale(script: str) -> bool:
    """Whether a script must run again."""
    stamp = FOLDER / f".{script}.made"
    if not stamp.is_file() or stamp.read_text().split("\n")[0] != current(script):
        return True
    return not all((FOLDER / name).is_file() for name in stamp.read_text().split("\n")[1:])


def run(script: str) -> None:
    """Make the pictures of a script, and store the hash they were made for."""
    known = current(script)
    command = [sys.executable, str(DOCS / script), str(FOLDER)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    names = [Path(line).name for line in done.stdout.splitlines() if line.endswith(".png")]
    (FOLDER / f".{script}.made").write_text("\n".join([known, *names]))


def main(jobs: int) -> None:
    """Run the stale scripts, and the screenshots, which check for themselves."""
    with ThreadPoolExecutor(jobs) as pool:
        command = [sys.executable, str(DOCS / "screenshots.py")]
        pages = pool.submit(subprocess.run, command, check=True)
        list(pool.map(run, [script for script in SCRIPTS if stale(script)]))
        pages.result()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
