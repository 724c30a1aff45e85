"""Compiled kernels whose cache cannot go stale.

numba keys a cached kernel by its own file only, so it would miss a change in a callee of another
file. Here the cache folder's name is a hash of every source of ``sim`` that a kernel can see.
Damaged files are compiled again and replaced; if the folder is not writable, every start compiles,
with one warning. The hash identifies a kernel of ``sim`` completely, so that
installations of the same sources share compiled kernels.
"""

import ast
import hashlib
import logging
import os
import pickle
import re
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import config, serialize
from numba.core.caching import FunctionCache

from .atomic import sealed, unsealed, write_whole
from .compiler import Kernel, lasting

# The compiler has no freedom, not even contraction to fused multiply-add, which it would use in
# some places only: a record has the same bytes alone and next to others. Forced inlining halves
# the time of a crank step, whose parameters would be copied at every call. Without numba's runtime
# a kernel allocates nothing and counts no references, which doubles its speed again.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "forceinline": True,
    "_nrt": False,
}

# Only import statements are parsed: whole files would cost every start a quarter of a second.
# tests/test_layers.py compares the result with the syntax trees of whole files.
_IMPORT = re.compile(r"^[ \t]*(from \.+[\w.]* import (?:\([^)]*\)|.*))", re.MULTILINE)

_dumps: Any = serialize.dumps  # numba's own pickler: also for what only its unpickler can read

_LOG = logging.getLogger(__name__)

Function = TypeVar("Function", bound=Callable[..., Any])


@cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels of these sources, or None if none is writable.

    The base is ``$WEARSTATE_CACHE``, else ``$XDG_CACHE_HOME/wearstate``, else
    ``~/.cache/wearstate``. Older folders of other sources are removed.
    """
    # stored code names its modules: a copy imported by another name has its own folder
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__} {__package__}".encode())
    for source in kernel_sources(Path(__file__).parent):
        digest.update(source.read_bytes())
    try:
        base = _base_folder()
        folder = base / f"kernels-{digest.hexdigest()[:16]}"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        _forget_all_but_newest(base)
    except (OSError, RuntimeError) as error:  # RuntimeError: no home directory
        _warn_unkept(str(error))
        return None
    return folder


@cache
def _warn_unkept(reason: str) -> None:
    """Warn once for each reason."""
    _LOG.warning(
        "compiled kernels cannot be kept (%s), so that every start compiles: free space, allow "
        "writing, or name a folder in WEARSTATE_CACHE",
        reason,
    )


@cache
def _warn_damaged(folder: Path) -> None:
    """Warn once for each folder."""
    _LOG.warning("the kernel cache %s is damaged: kernels are compiled again and replaced", folder)


def kernel_sources(folder: Path) -> list[Path]:
    """Files of a package that hold kernels, and all that they import from it.

    These hold a kernel's callees and constants; other files may change freely. Sorted by name
    below `folder`, so that the order does not depend on the location of the package.

    Examples
    --------
    >>> names = {path.stem for path in kernel_sources(Path(__file__).parent)}
    >>> {"jit", "law"} <= names, "simulate" in names
    (True, False)
    """
    files = {*folder.rglob("*.py")}
    imports = {path: _imported_from(files, path) for path in files}
    this = folder / Path(__file__).name
    found, ahead = set(), [path for path, targets in imports.items() if this in targets]
    while ahead:
        path = ahead.pop()
        if path not in found:
            found.add(path)
            ahead.extend(imports[path])
    return sorted(found, key=lambda path: path.relative_to(folder).parts)


def _imported_from(files: set[Path], path: Path) -> list[Path]:
    """Files that the relative imports of one of them name."""
    text = path.read_text(encoding="utf-8")
    statements = ast.parse("\n".join(_IMPORT.findall(text))).body
    return [
        file
        for statement in statements
        if isinstance(statement, ast.ImportFrom)
        for file in _named_files(statement, path)
        if file in files
    ]


def _named_files(statement: ast.ImportFrom, path: Path) -> list[Path]:
    """Files that a relative import may refer to: a module, or modules of a package."""
    base = path.parents[statement.level - 1].joinpath(*(statement.module or "").split("."))
    modules = [base / alias.name for alias in statement.names]
    return [each.parent / f"{each.name}.py" for each in (base, *modules)]


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


class _SealedFiles:
    """Cache files of one kernel: damage counts as a miss and is replaced by the next `save`.

    The index is preceded by its SHA-256; a data file is named by the hash of its content, so that
    two processes writing at once cannot mix theirs up.
    """

    def __init__(self, function: Any, folder: Path, stem: str, stamp: Any) -> None:
        self._function, self._folder, self._stem, self._stamp = function, folder, stem, stamp
        self._index = folder / f"{stem}.nbi"

    def load(self, key: Any) -> Any:
        """Compiled code of a signature; None if there is none that is whole."""
        name = self._load_index().get(key)
        if name is None:
            return None
        content = self._read(self._folder / name)
        if content is None or self._name_of(content) != name:
            _warn_damaged(self._folder)
            return None
        return pickle.loads(content)

    def save(self, key: Any, data: Any) -> None:
        """Store compiled code, if possible."""
        if not lasting(key[0], self._function):  # a key begins with the types of the arguments
            return
        content: bytes = _dumps(data)
        name = self._name_of(content)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(self._folder / name, content, force=True)
            index = _dumps((self._stamp, {**self._load_index(), key: name}))
            write_whole(self._index, sealed(index), force=True)
        except OSError as error:
            _warn_unkept(str(error.strerror))

    def _load_index(self) -> dict[Any, str]:
        stored = self._read(self._index)
        if stored is None:
            return {}
        content = unsealed(stored)
        if content is None:
            _warn_damaged(self._folder)
            return {}
        stamp, names = pickle.loads(content)
        return names if stamp == self._stamp else {}

    def _name_of(self, content: bytes) -> str:
        return f"{self._stem}.{hashlib.sha256(content).hexdigest()[:32]}.nbc"

    def _read(self, path: Path) -> bytes | None:
        try:
            return path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError:
            _warn_damaged(self._folder)
            return None


class _SealedParts:
    """Parts of one kernel, each in a file preceded by its SHA-256; damage counts as a miss."""

    def __init__(self, folder: Path, stem: str, stamp: Any) -> None:
        self._folder, self._stem, self._stamp = folder, stem, stamp

    def load(self, name: str) -> Any:
        """Content stored under a name by the same source; None if there is none that is whole."""
        try:
            content = unsealed(self._path(name).read_bytes())
        except FileNotFoundError:
            return None
        except OSError:
            content = None
        if content is None:
            _warn_damaged(self._folder)
            return None
        stamp, found = pickle.loads(content)
        return found if stamp == self._stamp else None

    def save(self, name: str, content: Any) -> None:
        """Store content, if possible."""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(self._path(name), sealed(_dumps((self._stamp, content))), force=True)
        except OSError as error:
            _warn_unkept(str(error.strerror))

    def _path(self, name: str) -> Path:
        return self._folder / f"{self._stem}.{name}.part"


def kernel(function: Function) -> Function:
    """Compile a function of floats, integers and arrays, cached by the sources it can see."""
    return _compiled(function, _OPTIONS)


def subroutine(function: Function) -> Function:
    """Compile like :func:`kernel`, but as a call instead of inline, once for all callers."""
    return _compiled(function, _OPTIONS | {"forceinline": False})


def kernel_noalias(function: Function) -> Function:
    """Compile like :func:`kernel`, for records and arrays that do not overlap in memory.

    Its loops are vectorised without a run-time overlap check at every call.
    """
    return _compiled(function, _OPTIONS, noalias=True)


def _compiled(function: Function, options: dict[str, Any], noalias: bool = False) -> Function:
    folder = cache_folder()
    if folder is None:
        return Kernel(function, targetoptions=options, noalias=noalias)
    settings: Any = config
    before = settings.CACHE_DIR
    settings.CACHE_DIR = str(folder)  # numba reads it immediately; restored below
    try:
        files: Any = FunctionCache(function)
    finally:
        settings.CACHE_DIR = before
    place = Path(files.cache_path)
    if not place.is_relative_to(folder):  # not writable for numba, which chose another folder
        return Kernel(function, targetoptions=options, noalias=noalias)
    names = files._impl
    stamp = names.locator.get_source_stamp()
    source, here = Path(function.__code__.co_filename), Path(__file__).parent
    if source.is_relative_to(here):
        place, stamp = folder / "sim" / source.relative_to(here).parent, None
    files._cache_file = _SealedFiles(function, place, names.filename_base, stamp)
    compiled: Any = Kernel(
        function,
        targetoptions=options,
        store=_SealedParts(place, names.filename_base, stamp),
        noalias=noalias,
    )
    compiled._cache = files
    return compiled  # type: ignore[no-any-return]


NEAR = 0.785
"""Angle up to which :func:`near_sine_cosine` equals :func:`sine_cosine`, less than pi/4 [rad]."""


@kernel
def near_sine_cosine(r: float) -> tuple[float, float]:
    """Sine and cosine of an angle of at most pi/4 [rad]."""
    z = r * r
    s = 1.58969099521155010221e-10 * z - 2.50507602534068634195e-08
    s = (s * z + 2.75573137070700676789e-06) * z - 1.98412698298579493134e-04
    s = (s * z + 8.33333333332248946124e-03) * z - 1.66666666666666324348e-01
    sine = r + r * z * s
    c = -1.13596475577881948265e-11 * z + 2.08757232129817482790e-09
    c = (c * z - 2.75573143513906633035e-07) * z + 2.48015872894767294178e-05
    c = (c * z - 1.38888888888741095749e-03) * z + 4.16666666666666019037e-02
    cosine = 1.0 - 0.5 * z + z * z * c
    return sine, cosine


@kernel
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad], computed together for inner loops.

    Range reduction by a two-part pi/2 and the minimax polynomials of the Cephes library on
    [-pi/4, pi/4]: within 4e-16 of libm for angles up to 1e4 rad (tested), at 0.4 of its time.
    """
    quarter = np.floor(angle * 0.6366197723675814 + 0.5)
    r = angle - quarter * 1.5707963267341256
    r -= quarter * 6.077100506506192e-11
    sine, cosine = near_sine_cosine(r)
    turn = quarter - 4.0 * np.floor(0.25 * quarter)  # 0 to 3, selected without branching
    odd = turn == 1.0 or turn == 3.0
    first, second = cosine if odd else sine, sine if odd else cosine
    return (-first if turn >= 2.0 else first), (-second if 0.5 < turn < 2.5 else second)


_STEEP = 0.66  # tangent from which the arc tangent is reduced by pi/4
_LESS = 6.123233995736766e-17  # missing from the double of pi/2


@kernel
def half_turn_angle(along: float, across: float) -> float:
    """Angle of (along, across) for across >= 0, in [0, pi] [rad], without branch or call.

    Within 4e-16 of the library's arc tangent (tested): range reduction and rational function of the
    Cephes library.
    """
    size = abs(along)
    high, low = max(size, across), min(size, across)
    steep = low > _STEEP * high
    over = low + high if steep else high
    t = (low - high if steep else low) / (over if over > 0.0 else 1.0)
    z = t * t
    p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    p = (p * z - 7.500855792314704667340e1) * z - 1.228866684490136173410e2
    p = p * z - 6.485021904942025371773e1
    q = (z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2
    q = (q * z + 4.328810604912902668951e2) * z + 4.853903996359136964868e2
    q = q * z + 1.945506571482613964425e2
    own = t + (t * (z * p / q) + (0.5 * _LESS if steep else 0.0))
    angle = (0.25 * np.pi if steep else 0.0) + own
    turned = 0.5 * np.pi - (angle - _LESS) if across > size else angle
    return np.pi - (turned - 2.0 * _LESS) if along < 0.0 else turned


_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_ROOT_HALF = 0x3FE6A09E667F3BCD  # bits of sqrt(1/2)
_UPPER_HALF = -(1 << 27)  # of a mantissa's bits: products of two such halves are exact


@kernel
def _bits(x: float) -> Any:
    return np.float64(x).view(np.int64)


@kernel
def _from_bits(bits: Any) -> Any:
    return np.int64(bits).view(np.float64)


@kernel
def power(x: float, exponent: float) -> float:
    """Power of a positive number for an exponent between -1 and 1, without branch or call.

    NaN for 0, negative numbers, infinity and NaN.

    Vectorised, it takes a third of the library's time. Six of seven results are identical to the
    library's, others are off by 1 ulp, four in a thousand by 2 (tested): the logarithm
    after fdlibm's ``e_log.c``, kept in two parts as far as its product with the exponent needs it,
    and the series of the exponential.
    """
    bits = _bits(x)
    binary = (bits - _ROOT_HALF) >> 52
    f = _from_bits(bits - (binary << 52)) - 1.0  # from sqrt(1/2) to sqrt(2), less one
    s = f / (2.0 + f)
    z = s * s
    r = 1.479819860511658591e-01 * z + 1.531383769920937332e-01
    r = (r * z + 1.818357216161805012e-01) * z + 2.222219843214978396e-01
    r = (r * z + 2.857142874366239149e-01) * z + 3.999999999940941908e-01
    r = r * z + 6.666666666666735130e-01
    half = 0.5 * f * f
    twos = float(binary)
    whole, part = twos * _LN2_HIGH, f - (half - s * (half + z * r)) + twos * _LN2_LOW
    logarithm = whole + part
    rest = part - (logarithm - whole)
    l_high = _from_bits(_bits(logarithm) & _UPPER_HALF)
    e_high = _from_bits(_bits(exponent) & _UPPER_HALF)
    shift = np.floor(exponent * logarithm * 1.4426950408889634 + 0.5)
    low = e_high * (logarithm - l_high) + (exponent - e_high) * logarithm + exponent * rest
    y = (e_high * l_high - shift * _LN2_HIGH) + (low - shift * _LN2_LOW)  # at most 0.35
    y2 = y * y
    y4 = y2 * y2
    early = 0.5 + y * (1.0 / 6.0) + (1.0 / 24.0 + y * (1.0 / 120.0)) * y2
    middle = 1.0 / 720.0 + y * (1.0 / 5040.0) + (1.0 / 40320.0 + y * (1.0 / 362880.0)) * y2
    late = 1.0 / 3628800.0 + y * (1.0 / 39916800.0) + y2 * (1.0 / 479001600.0)
    grown = 1.0 + (y + y2 * (early + middle * y4 + late * (y4 * y4)))
    found: float = grown * _from_bits((np.int64(shift) + 1023) << 52)
    return found if 0.0 < x < np.inf else np.nan  # other bits would give an arbitrary number
