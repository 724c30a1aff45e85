"""Every public function of features that takes a sample rate refuses one that is not believed."""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
import wearstate.features
from wearstate.features.catalogue.analysis import Settings
from wearstate.features.signal.rate import RATE_LEAST, RATE_MOST
from wearstate.sim.output import sensor

FS, N = 4096.0, 16384
_RNG = np.random.default_rng(0)
_TIME = np.arange(N) / FS
_TACHO = (np.arange(N) % 64 < 8) * 5.0
_BLOWS = np.where(np.arange(N) % 4096 == 800, 100.0, 0.0)
_BLOWS = np.convolve(_BLOWS, np.hanning(8), "same")

VALUES = {
    "x": _RNG.standard_normal(N),
    "z": np.exp(2j * np.pi * 16 * _TIME),
    "lines": np.abs(_RNG.standard_normal(129)),
    "force": _BLOWS + 1e-3 * _RNG.standard_normal(N),
    "response": _RNG.standard_normal((2, N)),
    "acceleration": _RNG.standard_normal(N),
    "vibration": _RNG.standard_normal((1, N)),
    "tacho": _TACHO,
    "pulses": np.arange(1, 64) / 16.0,
    "phase": 16 * _TIME,
    "times": _TIME[::512],
    "speed_hz": 16.0,
    "n_samples": N,
    "n_lines": 129,
    "n_averages": 8.0,
    "per_revolution": 1,
    "marks": np.arange(1, 64) / 16.0,
    "low_hz": 100.0,
    "nperseg": 256,
    "hop": 64,
    "span": 50.0,
    "low": 10.0,
    "high": 100.0,
    "end": 0.01,
    "fall": 0.01,
    "band": (20.0, 200.0),
    "band_hz": (10.0, 30.0),
    "bands": [(20.0, 200.0)],
    "edges": [20.0, 100.0, 200.0],
    "integrations": 1,
    "cyclic_hz": [16.0],
    "channel_names": ("a",),
    "data": _RNG.standard_normal((2, N)),
}
"""An argument for every name."""

OTHER = {
    "array_signals": {"channel_names": ("a", "b")},
    "multiple_h1": {"force": _RNG.standard_normal((2, N))},
    "other_rate": {"x": _RNG.standard_normal((1, N))},
    "transmissibility": {"x": _RNG.standard_normal((2, N))},
    "crank_angle_map": {"edges": [50.0, 100.0, 400.0]},
    "welch_spectra": {"force": _RNG.standard_normal(N)},
    "block_spectra": {
        "force": _RNG.standard_normal((4, 256)),
        "response": _RNG.standard_normal((4, 2, 256)),
    },
    "order_spectrum": {"tacho": (np.sin(2 * np.pi * 16 * _TIME) > 0).astype(float)},
    "tacholess_speed": {"x": sum(np.cos(2 * np.pi * 16 * k * _TIME) for k in range(1, 6))},
}
"""Arguments that differ."""


def functions():
    found = {}
    for module in pkgutil.walk_packages(wearstate.features.__path__, "wearstate.features."):
        content = importlib.import_module(module.name)
        for name, item in vars(content).items():
            own = inspect.isfunction(item) and item.__module__ == content.__name__
            if own and not name.startswith("_") and "fs" in inspect.signature(item).parameters:
                found[name] = item
    return {k: v for k, v in found.items() if k not in ("rate_fault", "check_rate")}


FUNCTIONS = functions()


def called(name, fs):
    function = FUNCTIONS[name]
    values = {**VALUES, **OTHER.get(name, {})}
    parameters = inspect.signature(function).parameters
    wanted = [n for n, p in parameters.items() if p.default is p.empty and n != "fs"]
    given = {n: values[n] for n in wanted} | OTHER.get(name, {})
    return function(**given, fs=fs)


def test_there_are_many():
    assert len(FUNCTIONS) > 45


@pytest.mark.parametrize("name", FUNCTIONS)
def test_only_rates_that_are_believed_are_taken(name):
    called(name, FS)
    for fs in (8e98, 1e-12, float("nan"), float("inf"), -FS, 0.0):
        with pytest.raises(ValueError, match=r"fs = .* Hz must be >= 0\.001 Hz and <= 1e\+08 Hz"):
            called(name, fs)


def test_the_bounds_are_those_of_files():
    assert (RATE_LEAST, RATE_MOST) == (sensor.RATE_LEAST, sensor.RATE_MOST)
    assert Settings().band_edges(FS).size > 0
