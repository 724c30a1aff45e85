"""Fourier transforms for all features, by FFTW or scipy according to a measured rule.

FFTW plans with ESTIMATE, which times nothing: one length has one plan, hence the same bits in every
process of a machine. With ``WEARSTATE_FFT=measure``, plans are timed and kept as wisdom in the
user's cache; ``WEARSTATE_FFT=scipy`` leaves FFTW out.
"""

import hashlib
import json
import os
import tempfile
import threading
from collections import OrderedDict
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, DTypeLike, NDArray

Complex = NDArray[np.complexfloating[Any, Any]]
Real = NDArray[np.floating[Any]]
Kind = Literal["rfft", "irfft", "fft", "ifft"]
Engine = Literal["fftw", "scipy"]

MODES = ("auto", "measure", "scipy")
"""Values of ``WEARSTATE_FFT``; the first is the default."""

FFTW_LENGTHS = (2048, 131_072)
"""Shortest and longest transform that FFTW computes [samples]."""

FFTW_FACTORS = (2, 3, 5, 7)
"""Prime factors allowed in the length of a transform that FFTW computes."""

_MOST_PLANS = 16  # per thread: at most 64 MB of buffers

_PLANNING = threading.Lock()  # FFTW may plan in one thread at a time only


class FFTModeError(ValueError):
    """``WEARSTATE_FFT`` does not name a mode."""


# --- transforms


def rfft(x: ArrayLike, n: int | None = None, *, axis: int = -1) -> Complex:
    """One-sided discrete Fourier transform of real data, precision kept.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Real data [any unit]. float32 gives complex64, float64 and integers give complex128.
    n : int, optional
        Length of the transform [samples]; `x` is cut, or filled up with zeros. Default n_samples.
    axis : int
        Axis of the transform.

    Returns
    -------
    ndarray, shape (..., n // 2 + 1)
        ``sum_m x[m] exp(-2j pi k m / n)`` for k = 0 … n // 2 [unit of x].

    Raises
    ------
    TypeError
        If `x` is complex.
    ValueError
        If there is no sample, or n < 1.

    Notes
    -----
    See `choose_engine` for the library that computes it.

    Examples
    --------
    >>> import numpy as np
    >>> spectrum = rfft(np.array([1, 0, -1, 0], dtype=np.float32))
    >>> spectrum.dtype, abs(spectrum).tolist()
    (dtype('complex64'), [0.0, 2.0, 0.0])
    """
    return transform("rfft", x, n, axis=axis)


def irfft(spectrum: ArrayLike, n: int | None = None, *, axis: int = -1) -> Real:
    """Real data from their one-sided spectrum: the inverse of `rfft`.

    Parameters
    ----------
    spectrum : array_like, shape (..., n_lines)
        Lines 0 … n // 2 [any unit]; missing ones count as 0. complex64 gives float32.
    n : int, optional
        Length of the data [samples]; ``2 (n_lines - 1)`` by default, so give it if it is odd.
    axis : int
        Axis of the transform.

    Returns
    -------
    ndarray, shape (..., n)
        Data [unit of the spectrum]; the imaginary parts of line 0, and of line n / 2 of an even
        n, are ignored.

    Raises
    ------
    ValueError
        If there is no line, or n < 1.

    Examples
    --------
    >>> irfft(rfft([1.0, 2.0, 3.0]), 3).round(6).tolist()
    [1.0, 2.0, 3.0]
    """
    return transform("irfft", spectrum, n, axis=axis)


def fft(x: ArrayLike, n: int | None = None, *, axis: int = -1) -> Complex:
    """Two-sided discrete Fourier transform, precision kept.

    Parameters
    ----------
    x : array_like, shape (..., n_samples)
        Data [any unit], real or complex.
    n : int, optional
        Length of the transform [samples]; `x` is cut, or filled up with zeros. Default n_samples.
    axis : int
        Axis of the transform.

    Returns
    -------
    ndarray, shape (..., n)
        ``sum_m x[m] exp(-2j pi k m / n)`` for k = 0 … n - 1 [unit of x].

    Raises
    ------
    ValueError
        If there is no sample, or n < 1.

    Examples
    --------
    >>> fft([1j, 1j, 1j, 1j]).tolist()
    [4j, 0j, 0j, 0j]
    """
    return transform("fft", x, n, axis=axis)


def ifft(spectrum: ArrayLike, n: int | None = None, *, axis: int = -1) -> Complex:
    """Complex data from their two-sided spectrum: the inverse of `fft`.

    Parameters
    ----------
    spectrum : array_like, shape (..., n_lines)
        Lines 0 … n - 1 [any unit].
    n : int, optional
        Length of the data [samples]; the lines are cut, or filled up with zeros. Default n_lines:
        the lines 0 … n / 2 of a real signal, doubled and filled up, give its analytic signal.
    axis : int
        Axis of the transform.

    Returns
    -------
    ndarray, shape (..., n)
        Data [unit of the spectrum].

    Raises
    ------
    ValueError
        If there is no line, or n < 1.

    Examples
    --------
    >>> ifft([4j, 0, 0, 0]).tolist()
    [1j, 1j, 1j, 1j]
    """
    return transform("ifft", spectrum, n, axis=axis)


def fast_length(n: int) -> int:
    """Smallest length >= n that transforms fast: its prime factors are 2, 3 and 5.

    Parameters
    ----------
    n : int
        Length wanted [samples], >= 1.

    Returns
    -------
    int
        Length to pad to [samples].

    Raises
    ------
    ValueError
        If n < 1.

    Examples
    --------
    >>> fast_length(25_601)
    25920
    """
    if n < 1:
        raise ValueError(f"n = {n} samples must be >= 1; give a length")
    return int(scipy.fft.next_fast_len(n, real=True))


def fast_length_within(n: int) -> int:
    """Largest even length <= n that transforms fast: its prime factors are 2, 3, 5 and 7.

    Parameters
    ----------
    n : int
        Available length [samples], >= 2.

    Returns
    -------
    int
        Length to cut to [samples]; at most 6.2 % shorter from 500 samples on.

    Raises
    ------
    ValueError
        If n < 2.

    Examples
    --------
    >>> fast_length_within(25_601)
    25600
    """
    if n < 2:
        raise ValueError(f"n = {n} samples must be >= 2; give a length")
    length = n - n % 2
    while not _smooth(length):
        length -= 2
    return length


# --- choice of the library


def choose_engine(kind: Kind, n: int, rows: int, dtype: DTypeLike) -> Engine:
    """Library that transforms such data in the default mode.

    Parameters
    ----------
    kind : {"rfft", "irfft", "fft", "ifft"}
        Transform.
    n : int
        Its length [samples].
    rows : int
        Number of transforms in one call.
    dtype : dtype
        Type of the input data.

    Returns
    -------
    {"fftw", "scipy"}
        FFTW for up to three rows of 2048 … 131,072 samples if the length has no prime factor above
        7 and the type needs no conversion; otherwise scipy.

    Notes
    -----
    Time of scipy 1.17 over that of FFTW 3.3.5, median and range over 16 such lengths, measured on
    one core of an AMD EPYC with calls and copies included. FFTW was planned with ESTIMATE and fed
    row by row through its own aligned buffers.

    ======================  ====================  ====================
    transform, data         1 row                 3 rows
    ======================  ====================  ====================
    rfft, float32           1.93 (1.24 … 3.18)    2.06 (1.36 … 3.24)
    rfft, float64           1.60 (1.04 … 1.92)    1.28 (0.80 … 1.48)
    irfft, complex64        1.70 (1.23 … 1.92)    1.75 (1.30 … 1.96)
    irfft, complex128       1.45 (1.06 … 1.77)    1.15 (0.87 … 1.40)
    fft, ifft, complex64    2.75 (1.44 … 3.93)    2.75 (1.53 … 5.07)
    fft, ifft, complex128   1.48 (0.99 … 1.79)    1.45 (0.94 … 4.24)
    ======================  ====================  ====================

    From four rows on, scipy transforms several in parallel: for 48 rows of 256 float32 it takes
    0.39 of FFTW's time, for 12 rows of 8192 0.94. A call of FFTW costs 2 us more than one of scipy,
    1.2 at 256 samples. Prime factors above 7 give 0.5 … 2.9, with plans that take up to 0.3 s;
    above 131,072 samples both are bound by memory (0.4 … 3.4). A plan of a new length takes 1 to 20
    ms. FFTW's MEASURE would be faster on batches too (1.3 … 1.7), but takes seconds to plan, and
    its plan, hence the last bits of every feature, may differ from one process to the next.

    Examples
    --------
    >>> choose_engine("rfft", 25_600, 3, "float32"), choose_engine("rfft", 256, 600, "float32")
    ('fftw', 'scipy')
    """
    if not FFTW_LENGTHS[0] <= n <= FFTW_LENGTHS[1] or not 0 < rows <= 3 or not _smooth(n):
        return "scipy"
    code = np.dtype(dtype).char
    # Data that need a conversion go to scipy, which also halves the work of an fft of real data.
    return "fftw" if code in ("fd" if kind == "rfft" else "FD") else "scipy"


def engine_in_force(kind: Kind, n: int, rows: int, dtype: DTypeLike) -> Engine:
    """Library in use here: that of `choose_engine`, or scipy if FFTW is not available.

    Parameters
    ----------
    kind, n, rows, dtype
        As for `choose_engine`.

    Returns
    -------
    {"fftw", "scipy"}
        scipy in the mode "scipy", or if pyfftw is not installed.

    Raises
    ------
    FFTModeError
        If the environment variable names no mode.

    Examples
    --------
    >>> engine_in_force("rfft", 25_601, 3, "float32")
    'scipy'
    """
    chosen = choose_engine(kind, n, rows, dtype)
    wanted = chosen == "fftw" and fft_mode() != "scipy" and fftw_library() is not None
    return "fftw" if wanted else "scipy"


def transform(
    kind: Kind,
    x: ArrayLike,
    n: int | None = None,
    *,
    axis: int = -1,
    engine: Engine | None = None,
) -> NDArray[Any]:
    """Any of the four transforms, by the selected library.

    Parameters
    ----------
    kind : {"rfft", "irfft", "fft", "ifft"}
        Transform, see the functions of these names.
    x : array_like
        Data or lines [any unit].
    n : int, optional
        Length [samples].
    axis : int
        Axis of the transform.
    engine : {"fftw", "scipy"}, optional
        Library; by default that of `engine_in_force`.

    Returns
    -------
    ndarray
        Transform [unit of x].

    Raises
    ------
    TypeError, ValueError
        As for the four functions.
    ImportError
        If `engine` is "fftw" and pyfftw is not installed.

    Examples
    --------
    >>> transform("rfft", [1.0, 1.0], engine="fftw").tolist()
    [(2+0j), 0j]
    """
    data = np.asarray(x)
    if data.ndim == 0 or not -data.ndim <= axis < data.ndim or data.shape[axis] == 0:
        raise ValueError(
            f"x of shape {data.shape} must have samples along axis {axis}; give a signal"
        )
    here = data.shape[axis]
    length = n if n is not None else 2 * (here - 1) if kind == "irfft" else here
    if length < 1:
        raise ValueError(f"n = {length} samples must be >= 1; give a length")
    if engine is None:
        engine = engine_in_force(kind, length, data.size // here, data.dtype)
    if engine == "scipy":
        return np.asarray(getattr(scipy.fft, kind)(data, length, axis))
    if kind == "rfft" and np.iscomplexobj(data):
        raise TypeError(f"x is {data.dtype}, must be real; use fft")
    if axis in (-1, data.ndim - 1):
        return _by_fftw(kind, data, length)
    return np.moveaxis(_by_fftw(kind, np.moveaxis(data, axis, -1), length), -1, axis)


@lru_cache(maxsize=256)
def _smooth(n: int) -> bool:
    for factor in FFTW_FACTORS:
        while n % factor == 0:
            n //= factor
    return n == 1


@cache
def fft_mode() -> str:
    """Mode in force: ``WEARSTATE_FFT``, read once.

    Returns
    -------
    {"auto", "measure", "scipy"}
        "auto": the rule of `choose_engine` with reproducible plans; "measure": the same rule with
        plans that are timed once and kept; "scipy": scipy alone.

    Raises
    ------
    FFTModeError
        If the variable holds any other value.

    Examples
    --------
    >>> fft_mode() in MODES
    True
    """
    mode = os.environ.get("WEARSTATE_FFT") or MODES[0]
    if mode not in MODES:
        raise FFTModeError(
            f"WEARSTATE_FFT = {mode!r} must be one of {', '.join(MODES)}; correct or unset it"
        )
    return mode


@cache
def fftw_library() -> Any | None:
    """Module ``pyfftw``, imported at its first use, or None if it is not installed."""
    try:
        import pyfftw
    except ImportError:
        return None
    return pyfftw


# --- plans of FFTW


class _Plan:
    """One FFTW transform between its own two aligned buffers."""

    def __init__(self, kind: Kind, n: int, double: bool) -> None:
        library = fftw_library()
        if library is None:
            raise ImportError("pyfftw is not installed; install it, or leave the engine open")
        real, lines = ("float64", "complex128") if double else ("float32", "complex64")
        one_sided = n // 2 + 1
        shapes = {"rfft": ((n, real), (one_sided, lines)), "irfft": ((one_sided, lines), (n, real))}
        given, wanted = shapes.get(kind, ((n, lines), (n, lines)))
        self.source: NDArray[Any] = library.empty_aligned(*given)
        self.target: NDArray[Any] = library.empty_aligned(*wanted)
        self.scale = self.target.real.dtype.type(1 / n) if kind in ("irfft", "ifft") else None
        direction = "FFTW_FORWARD" if self.scale is None else "FFTW_BACKWARD"
        with _PLANNING:
            self.execute = _planned(library, self.source, self.target, direction).execute


def _planned(library: Any, source: NDArray[Any], target: NDArray[Any], direction: str) -> Any:
    """Plan in the mode in force; the buffers may be overwritten."""

    def plan(effort: str) -> Any:
        flags = (effort, "FFTW_DESTROY_INPUT")
        return library.FFTW(source, target, direction=direction, flags=flags, threads=1)

    if fft_mode() == "measure":
        _recall(library)
        made = plan("FFTW_MEASURE")
        _remember(library)
        return made
    # Wisdom of a timed plan made elsewhere in this process would change the estimate too.
    wisdom = library.export_wisdom()
    library.forget_wisdom()
    try:
        return plan("FFTW_ESTIMATE")
    finally:
        library.forget_wisdom()
        library.import_wisdom(wisdom)


class _Plans(threading.local):
    """Latest plans of one thread: two threads must not share a buffer."""

    def __init__(self) -> None:
        self.kept: OrderedDict[tuple[Kind, int, bool], _Plan] = OrderedDict()

    def of(self, kind: Kind, n: int, double: bool) -> _Plan:
        key = (kind, n, double)
        if key not in self.kept:
            self.kept[key] = _Plan(*key)
            if len(self.kept) > _MOST_PLANS:
                self.kept.popitem(last=False)
        self.kept.move_to_end(key)
        return self.kept[key]


_PLANS = _Plans()


def _by_fftw(kind: Kind, data: NDArray[Any], n: int) -> NDArray[Any]:
    """Transform along the last axis, row by row through the buffers of the plan."""
    plan = _PLANS.of(kind, n, data.dtype.char not in "fF")
    source, target = plan.source, plan.target
    taken = min(data.shape[-1], source.size)
    result = np.empty((*data.shape[:-1], target.size), target.dtype)
    pairs = zip(data.reshape(-1, data.shape[-1]), result.reshape(-1, target.size), strict=True)
    for row, transformed in pairs:
        source[:taken] = row[:taken]
        source[taken:] = 0  # the previous transform may have left data there
        plan.execute()
        if plan.scale is None:
            transformed[:] = target
        else:
            np.multiply(target, plan.scale, out=transformed)
    return result


# --- wisdom


def wisdom_file() -> Path | None:
    """File of this user's timed plans, or None without a home directory.

    The folder is ``$WEARSTATE_CACHE``, else ``$XDG_CACHE_HOME/wearstate``, else
    ``~/.cache/wearstate``. Only the mode "measure" reads or writes it.

    Examples
    --------
    >>> wisdom_file().name
    'fftw-wisdom.json'
    """
    name = "fftw-wisdom.json"
    if "WEARSTATE_CACHE" in os.environ:
        return Path(os.environ["WEARSTATE_CACHE"]) / name
    if "XDG_CACHE_HOME" in os.environ:
        return Path(os.environ["XDG_CACHE_HOME"]) / "wearstate" / name
    try:
        return Path.home() / ".cache" / "wearstate" / name
    except RuntimeError:
        return None


def _digest(wisdom: list[str]) -> str:
    return hashlib.sha256("\n".join(wisdom).encode()).hexdigest()


def _recall(library: Any) -> bool:
    """Load the wisdom of earlier processes; return False if there is none or it is damaged."""
    path = wisdom_file()
    try:
        held = json.loads(path.read_text(encoding="ascii")) if path else {}
        wisdom = [str(text) for text in held["wisdom"]]
        sound = len(wisdom) == 2 and held["sha256"] == _digest(wisdom)
    except (OSError, ValueError, KeyError, TypeError):
        return False
    if not sound:  # truncated or edited: keep it from FFTW's parser
        return False
    double, single = (text.encode() for text in wisdom)
    return all(library.import_wisdom((double, single, library.export_wisdom()[2])))


def _remember(library: Any) -> bool:
    """Save the wisdom of this process atomically; return False if it cannot be written."""
    path = wisdom_file()
    if path is None:
        return False
    wisdom = [part.decode() for part in library.export_wisdom()[:2]]
    text = json.dumps({"sha256": _digest(wisdom), "wisdom": wisdom})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=path.stem) as folder:
            file = Path(folder, path.name)
            file.write_text(text, encoding="ascii")
            file.replace(path)
    except OSError:
        return False
    return True
