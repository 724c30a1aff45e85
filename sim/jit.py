"""Compiled kernels whose cache cannot go stale.

numba keys a cached kernel by its own file only, so a change in a callee of another file would go
unnoticed. Here the cache folder carries a hash of every source of ``sim`` that a kernel can see; an
unwritable folder means no cache instead of an error at import.
"""

import hashlib
import math
import os
import re
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

# Contraction to fused multiply-add is the only freedom given to the compiler. Forced inlining
# halves the time of a crank step: its parameters would be copied at every call. Without numba's
# runtime a kernel allocates nothing and counts no references, which doubles its speed again.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract"},
    "forceinline": True,
    "_nrt": False,
}

_IMPORT = re.compile(r"^from \.(\w+) import", re.MULTILINE)  # tests/test_layers.py holds us to it

Function = TypeVar("Function", bound=Callable[..., Any])


@cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels of these sources, or None where none is writable.

    The base is ``$WEARSTATE_CACHE``, else ``$XDG_CACHE_HOME/wearstate``, else
    ``~/.cache/wearstate``. Folders of other sources that are older are removed.
    """
    digest = hashlib.sha256()
    for source in kernel_sources(Path(__file__).parent):
        digest.update(source.read_bytes())
    try:
        base = _base_folder()
        folder = base / f"kernels-{digest.hexdigest()[:16]}"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        _forget_all_but_newest(base)
    except (OSError, RuntimeError):  # RuntimeError: no home directory
        return None
    return folder


def kernel_sources(folder: Path) -> list[Path]:
    """Files of a flat package that hold kernels, and all that they import from it, sorted.

    A kernel takes its callees and constants from there; other files may change freely.

    Examples
    --------
    >>> names = {path.stem for path in kernel_sources(Path(__file__).parent)}
    >>> {"jit", "contact"} <= names, "assemble" in names
    (True, False)
    """
    imports = {
        path: [folder / f"{name}.py" for name in _IMPORT.findall(path.read_text(encoding="utf-8"))]
        for path in folder.glob("*.py")
    }
    this = folder / Path(__file__).name
    found, ahead = set(), [path for path, names in imports.items() if this in names]
    while ahead:
        path = ahead.pop()
        if path not in found:
            found.add(path)
            ahead.extend(imports.get(path, []))
    return sorted(found)


def _base_folder() -> Path:
    if "WEARSTATE_CACHE" in os.environ:
        return Path(os.environ["WEARSTATE_CACHE"])
    if "XDG_CACHE_HOME" in os.environ:
        return Path(os.environ["XDG_CACHE_HOME"]) / "wearstate"
    return Path.home() / ".cache" / "wearstate"


def _forget_all_but_newest(base: Path, keep: int = 4) -> None:
    folders = sorted(base.glob("kernels-*"), key=lambda path: path.stat().st_mtime)
    for folder in folders[:-keep]:
        shutil.rmtree(folder, ignore_errors=True)


def kernel(function: Function) -> Function:
    """Compile a function of floats, integers and arrays, cached by the sources it can see."""
    folder = cache_folder()
    if folder is None:
        return numba.njit(**_OPTIONS)(function)  # type: ignore[no-any-return]
    settings: Any = numba.config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(folder)  # read by numba while it decorates, restored at once
    try:
        return numba.njit(cache=True, **_OPTIONS)(function)  # type: ignore[no-any-return]
    finally:
        settings.CACHE_DIR = before


@kernel
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of one angle together [rad], for the inner loops.

    Range reduction by a two-part pi/2 and the minimax polynomials of the Cephes library on
    [-pi/4, pi/4]: within 4e-16 of libm for angles up to 1e4 rad (tested), at 0.4 of its time.
    """
    quarter = math.floor(angle * 0.6366197723675814 + 0.5)
    r = angle - quarter * 1.5707963267341256
    r -= quarter * 6.077100506506192e-11
    z = r * r
    s = 1.58969099521155010221e-10 * z - 2.50507602534068634195e-08
    s = (s * z + 2.75573137070700676789e-06) * z - 1.98412698298579493134e-04
    s = (s * z + 8.33333333332248946124e-03) * z - 1.66666666666666324348e-01
    sine = r + r * z * s
    c = -1.13596475577881948265e-11 * z + 2.08757232129817482790e-09
    c = (c * z - 2.75573143513906633035e-07) * z + 2.48015872894767294178e-05
    c = (c * z - 1.38888888888741095749e-03) * z + 4.16666666666666019037e-02
    cosine = 1.0 - 0.5 * z + z * z * c
    turn = int(quarter) & 3
    if turn & 1:
        sine, cosine = cosine, -sine
    if turn & 2:
        sine, cosine = -sine, -cosine
    return sine, cosine
