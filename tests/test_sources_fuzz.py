"""Damaged files: every reader refuses them in words or reads them; a sample of the campaign."""

import importlib.util
import sys
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

_SPEC = importlib.util.spec_from_file_location(
    "fuzz_readers", Path(__file__).with_name("fuzz_readers.py")
)
fuzz = importlib.util.module_from_spec(_SPEC)
sys.modules["fuzz_readers"] = fuzz  # dataclasses look their module up
_SPEC.loader.exec_module(fuzz)

MOST_MEMORY = 2**24  # byte, for files of some kilobyte

CHANGES = st.lists(
    st.tuples(st.integers(0, 6), st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=4
)


# texts of variable length cost a process each time: the campaign has them, and a test of its own
@pytest.fixture(scope="module", params=[name for name in fuzz.SEEDS if name != "hdf5-text"])
def seeds(request, tmp_path_factory):
    """Contents, path and options of the valid files of one reader."""
    if request.param == "tdms":
        pytest.importorskip("nptdms")
    found = []
    for seed in fuzz.SEEDS[request.param]:
        path = tmp_path_factory.mktemp("fuzz") / f"x{seed.suffix}"
        seed.build(path)
        assert fuzz.attempt(path, seed.options) == "read"
        found.append((path.read_bytes(), path, seed.options))
    return found


@settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data(), changes=CHANGES)
def test_damage_is_refused_or_read(seeds, data, changes):
    content, path, options = data.draw(st.sampled_from(seeds))
    path.write_bytes(fuzz.changed(content, changes))
    tracemalloc.start()
    try:
        assert fuzz.attempt(path, options) in ("read", "refused")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < MOST_MEMORY
