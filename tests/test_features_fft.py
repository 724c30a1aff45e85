"""Both engines against the definition of the transform, and the rule that chooses one."""

import json
import os
import re
import subprocess
import sys
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from wearstate.features.signal import fft

KINDS = ("rfft", "irfft", "fft", "ifft")
ENGINES = ("scipy", "fftw")

# Rounding grows with the logarithm of the length: measured 3 eps of the largest line at most, up
# to 25,600 samples; three times that.
ROUNDING = 9


def data(kind, shape, double=True, seed=0):
    """Random input of a transform."""
    random = np.random.default_rng(seed)
    x = random.standard_normal(shape)
    if kind == "rfft":
        return x.astype(np.float64 if double else np.float32)
    return (x + 1j * random.standard_normal(shape)).astype(
        np.complex128 if double else np.complex64
    )


def by_definition(kind, x, n):
    """The transform as a matrix product, of data cut or filled up to what n asks for."""
    needed = n // 2 + 1 if kind == "irfft" else n
    x = np.concatenate([x, np.zeros((*x.shape[:-1], max(0, needed - x.shape[-1])))], axis=-1)
    x = x[..., :needed].astype(np.complex128)
    if kind == "irfft":
        x[..., 0] = x[..., 0].real
        if n % 2 == 0:
            x[..., -1] = x[..., -1].real
        x = np.concatenate([x, np.conj(x[..., 1 : (n + 1) // 2][..., ::-1])], axis=-1)
    sign = -1 if kind in ("rfft", "fft") else 1
    matrix = np.exp(sign * 2j * np.pi * np.outer(np.arange(n), np.arange(n)) / n)
    y = x @ matrix / (n if sign > 0 else 1)
    return {"rfft": y[..., : n // 2 + 1], "irfft": y.real}.get(kind, y)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("double", [True, False])
@pytest.mark.parametrize(("size", "n"), [(48, 48), (45, 45), (48, 30), (30, 49), (1, 1), (3, 8)])
def test_definition(engine, kind, double, size, n):
    x = data(kind, (2, 3, size), double)
    y = fft.transform(kind, x, n, engine=engine)
    expected = by_definition(kind, x, n)
    eps = np.finfo(y.dtype).eps
    assert y.shape == expected.shape
    assert y.real.dtype == (np.float64 if double else np.float32)
    assert_allclose(y, expected, atol=ROUNDING * eps * max(1.0, abs(expected).max()))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("double", [True, False])
def test_what_fftw_is_chosen_for_agrees_with_scipy(kind, double):
    x = data(kind, (3, 2401 if kind == "irfft" else 4800), double)
    n = 4800
    assert fft.choose_engine(kind, n, 3, x.dtype) == "fftw"
    before = x.copy()
    y, expected = getattr(fft, kind)(x, n), fft.transform(kind, x, n, engine="scipy")
    assert y.dtype == expected.dtype
    assert_allclose(y, expected, atol=ROUNDING * np.finfo(y.dtype).eps * abs(expected).max())
    assert_array_equal(x, before)  # FFTW works in buffers of its own
    # A row has the same bits alone, in company and along another axis: one plan for all.
    assert_array_equal(getattr(fft, kind)(x[1], n), y[1])
    assert_array_equal(getattr(fft, kind)(np.ascontiguousarray(x.T), n, axis=0), y.T)
    assert_array_equal(getattr(fft, kind)(x[::-1], n), y[::-1])


def test_inverses():
    x = data("rfft", (2, 6000))
    # There and back: a few units in the last place of the largest sample, 4.
    assert_allclose(fft.irfft(fft.rfft(x), 6000), x, atol=1e-14)
    z = data("fft", (2, 6000))
    assert_allclose(fft.ifft(fft.fft(z)), z, atol=1e-14)


def test_results_do_not_share_memory():
    first = fft.rfft(data("rfft", (1, 4096), seed=1))
    kept = first.copy()
    fft.rfft(data("rfft", (1, 4096), seed=2))
    assert_array_equal(first, kept)


@pytest.mark.parametrize(
    ("kind", "n", "rows", "dtype", "engine"),
    [
        ("rfft", 8192, 3, "float32", "fftw"),
        ("rfft", 8192, 4, "float32", "scipy"),  # scipy transforms four side by side
        ("rfft", 1024, 1, "float32", "scipy"),  # a call of FFTW costs more than it saves
        ("rfft", 262_144, 1, "float32", "scipy"),  # bound by memory
        ("rfft", 25_601, 1, "float32", "scipy"),  # a prime
        ("rfft", 22_528, 1, "float32", "scipy"),  # 11 * 2048
        ("rfft", 25_600, 3, "int16", "scipy"),
        ("fft", 25_600, 3, "float32", "scipy"),
        ("fft", 25_600, 3, "complex64", "fftw"),
        ("irfft", 25_600, 1, "complex128", "fftw"),
    ],
)
def test_rule(kind, n, rows, dtype, engine):
    assert fft.choose_engine(kind, n, rows, dtype) == engine


def test_types_that_need_a_conversion():
    integers = np.arange(4096)
    assert_array_equal(fft.rfft(integers), fft.transform("rfft", integers * 1.0, engine="scipy"))
    swapped = data("rfft", 4096).astype(">f8")
    assert_allclose(fft.rfft(swapped), fft.rfft(swapped.astype("<f8")), rtol=1e-13)


@settings(max_examples=50, deadline=None)
@given(n=st.integers(2, 10**6))
def test_fast_lengths(n):
    def rough(length, factors):
        for factor in factors:
            while length % factor == 0:
                length //= factor
        return length

    above, below = fft.fast_length(n), fft.fast_length_within(n)
    assert below <= n <= above
    assert rough(above, (2, 3, 5)) == rough(below, (2, 3, 5, 7)) == 1
    assert below % 2 == 0
    if n >= 500:
        assert below >= 0.938 * n  # as its docstring says


def test_threads_do_not_share_buffers():
    x = [data("rfft", (1, 8192), seed=seed) for seed in range(4)]
    expected = [fft.rfft(one) for one in x]
    wrong = []

    def work(index):
        for _ in range(100):
            if not np.array_equal(fft.rfft(x[index]), expected[index]):
                wrong.append(index)

    threads = [threading.Thread(target=work, args=(index,)) for index in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


def test_the_number_of_plans_is_bounded():
    plans = fft._Plans()
    for n in range(10, 60):
        plans.of("rfft", n, True)
    assert len(plans.kept) == fft._MOST_PLANS
    latest = next(reversed(plans.kept.values()))
    assert plans.of("rfft", 59, True) is latest


# --- processes

HASH = """
import hashlib, numpy as np
from wearstate.features.signal import fft
x = np.random.default_rng(0).standard_normal((3, 2400)).astype(np.float32)
assert fft.engine_in_force("rfft", 2400, 3, "float32") == {engine!r}
print(hashlib.sha256(fft.rfft(x).tobytes()).hexdigest())
"""

FOREIGN = """
import pyfftw
pair = pyfftw.empty_aligned(2400, "float32"), pyfftw.empty_aligned(1201, "complex64")
pyfftw.FFTW(*pair, flags=("FFTW_MEASURE", "FFTW_DESTROY_INPUT"))
kept = pyfftw.export_wisdom()
"""


def in_a_process(code, cache, mode="auto"):
    environment = os.environ | {"WEARSTATE_CACHE": str(cache), "WEARSTATE_FFT": mode}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_processes_agree_to_the_last_bit_whatever_else_they_planned(tmp_path):
    code = HASH.format(engine="fftw")
    first = in_a_process(code, tmp_path)
    after = "assert pyfftw.export_wisdom()[1].count(b'codelet') == kept[1].count(b'codelet')\n"
    assert in_a_process(FOREIGN + code + after, tmp_path) == first
    assert not list(tmp_path.iterdir())  # the default mode keeps nothing


def test_plans_are_estimates_unless_measured_ones_are_asked_for(tmp_path):
    # A timed plan may be the estimated one by chance, so the bits alone would not tell.
    code = (
        "from wearstate.features.signal import fft\n"
        "print(fft._PLANS.of('rfft', 2048, False).execute.__self__.flags)"
    )
    assert "'FFTW_ESTIMATE'" in in_a_process(code, tmp_path)
    assert "'FFTW_MEASURE'" in in_a_process(code, tmp_path, "measure")


def test_scipy_alone(tmp_path):
    code = HASH.format(engine="scipy")
    assert in_a_process(code, tmp_path, "scipy") == in_a_process(code, tmp_path, "scipy")


def test_without_pyfftw_scipy_serves(tmp_path):
    code = "import sys\nsys.modules['pyfftw'] = None\n" + HASH.format(engine="scipy")
    assert in_a_process(code, tmp_path) == in_a_process(HASH.format(engine="scipy"), "", "scipy")


SMALL = """
import numpy as np, sys
from wearstate.features.signal import fft
known = fft._recall(fft.fftw_library())
x = np.random.default_rng(0).standard_normal(2048).astype(np.float32)
error = np.abs(fft.rfft(x) - fft.transform("rfft", x, engine="scipy")).max()
assert error < 1e-4, error  # 9 eps of the largest line, 90
print(known)
"""

DAMAGED = """
import importlib, json
import pyfftw
from wearstate.features.signal import fft
file = fft.wisdom_file()
for text in {texts!r}:
    file.write_bytes(text)
    pyfftw.forget_wisdom()  # and no plan is left either: as at the start of a process
    importlib.reload(fft)
    begun = dict(print=lambda known: None)
    exec({code!r}, begun)
    assert begun["known"] is False, text
    assert json.loads(file.read_text()).keys() == {{"sha256", "wisdom"}}, text
print("mended")
"""


def test_wisdom_is_kept_and_a_damaged_file_ignored(tmp_path):
    assert in_a_process(SMALL, tmp_path, "measure") == "False"
    assert in_a_process(SMALL, tmp_path, "measure") == "True"
    file = tmp_path / "fftw-wisdom.json"
    sound = file.read_text()
    held = json.loads(sound)
    # One plan less is wisdom too for FFTW, but not what was written.
    fewer = re.sub(r"\(fftwf_codelet[^()]*\)", "", held["wisdom"][1], count=1)
    assert fewer != held["wisdom"][1]
    edited = [json.dumps(held | {"wisdom": pair}) for pair in (["(", fewer], ["", ""])]
    edited.append(json.dumps(held | {"wisdom": [held["wisdom"][0], fewer]}))
    damaged = [sound[:-40], "", "[]", *edited, '{"wisdom": 3, "sha256": ""}']
    texts = [*(text.encode() for text in damaged), b"\xff\xfe\x00"]
    assert in_a_process(DAMAGED.format(texts=texts, code=SMALL), tmp_path, "measure") == "mended"
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_an_unwritable_cache_is_no_error(tmp_path):
    (tmp_path / "file").write_text("")
    assert in_a_process(SMALL, tmp_path / "file" / "cache", "measure") == "False"


# --- faults


@pytest.mark.parametrize(
    ("call", "fault", "message"),
    [
        (lambda: fft.rfft(np.empty((2, 0))), ValueError, r"shape \(2, 0\) must have samples"),
        (lambda: fft.rfft(3.0), ValueError, r"shape \(\) must have samples"),
        (lambda: fft.rfft([1.0, 2.0], axis=1), ValueError, r"along axis 1"),
        (lambda: fft.rfft([1.0, 2.0], 0), ValueError, r"n = 0 samples must be >= 1"),
        (lambda: fft.irfft([1.0]), ValueError, r"n = 0 samples must be >= 1"),
        (lambda: fft.rfft(np.ones(8, complex)), TypeError, r"real"),
        (lambda: fft.transform("rfft", [1j], engine="fftw"), TypeError, r"must be real; use fft"),
        (lambda: fft.fast_length(0), ValueError, r"n = 0 samples must be >= 1"),
        (lambda: fft.fast_length_within(1), ValueError, r"n = 1 samples must be >= 2"),
    ],
)
def test_faults_are_named(call, fault, message):
    with pytest.raises(fault, match=message):
        call()


def test_an_unknown_mode_is_refused(monkeypatch):
    monkeypatch.setenv("WEARSTATE_FFT", "fastest")
    fft.fft_mode.cache_clear()
    try:
        with pytest.raises(fft.FFTModeError, match=r"'fastest' must be one of auto, measure"):
            fft.rfft(data("rfft", 4096))
    finally:
        fft.fft_mode.cache_clear()


def test_nan_comes_through():
    x = data("rfft", 4096)
    x[7] = np.nan
    assert np.isnan(fft.rfft(x)).all()
    assert np.isfinite(fft.rfft(data("rfft", 4096))).all()  # and leaves nothing behind
