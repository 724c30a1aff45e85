"""The same input gives the same bytes in every file, in another folder, process and second."""

import os
import subprocess
import sys
import time
from pathlib import Path

COMMANDS = """
simulate bilge-pump --set duration=0.6 -o one.h5 --truth --plot one.svg
generate bilge-pump-small -n 24 -o data.h5 -j 1
splits data.h5 --defaults --force
recipe preview bilge-pump-small -n 20 -j 1 --plot draws.svg
features data.h5 -o table.csv -j 1
features data.h5 -o table.parquet -j 1
features data.h5 -o table.h5 -j 1
export data.h5 -o copy.h5 --compress
export data.h5 -o copy.npz
export data.h5 -o copy.parquet --signals
export data.h5 --as wav -o wav
import wav/00000000.wav wav/00000001.wav --unit m/s2 -o measured.h5
info data.h5 --card card.html
info data.h5 --card card.md
info one.h5 --plot sheet.png
align shaft-rig -o line.html --plot line.svg
align shaft-rig --plot line.pdf
stability journal-bearing --map relaxation-mesh --size 3 -o atlas.svg
stability journal-bearing --map relaxation-mesh --size 3 -o atlas.html
sweep bilge-pump --set duration=0.45 --over drive.speed=5,6 --starts 2 -j 1 -o sweep.html
train data.h5 -o model.wsm
report one.h5 --model model.wsm -o report.html
report data.h5 --model model.wsm -o batch.html
evaluate model.wsm data.h5 -o judged.html
evaluate model.wsm data.h5 -o judged.json
evaluate model.wsm data.h5 -o judged.svg
"""
"""Lines that together write every kind of file, and every drawing in one format.

Charts hold measured times and are left out.
"""

RUN = """
import shlex, sys
from wearstate.diagnose.command_line.cli import cli
for line in sys.stdin.read().strip().splitlines():
    try:
        code = cli.main(shlex.split(line), standalone_mode=False)  # of a refusal it is returned
    except SystemExit as end:
        code = end.code
    assert not code, (line, code)
"""


def begun(folder: Path, seed: str):
    folder.mkdir()
    run = subprocess.Popen(
        [sys.executable, "-c", RUN],
        cwd=folder,
        env=os.environ | {"PYTHONHASHSEED": seed},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    run.stdin.write(COMMANDS)
    run.stdin.close()
    run.stdin = None
    return run


def files(folder: Path):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_every_file_has_the_same_bytes_twice(tmp_path):
    first = begun(tmp_path / "first", "1")
    time.sleep(2.1)  # HDF5 and zip tell times in whole, or even, seconds
    second = begun(tmp_path / "another place", "2")
    for run in (first, second):
        _, said = run.communicate(timeout=1200)
        assert run.returncode == 0, said
    one, two = files(tmp_path / "first"), files(tmp_path / "another place")
    assert list(one) == list(two)
    kinds = {Path(name).suffix for name in one}
    assert kinds >= {".h5", ".svg", ".png", ".pdf", ".html", ".csv", ".parquet", ".npz", ".wsm"}
    assert [name for name in one if one[name] != two[name]] == []
