"""Fixtures shared by all tests."""

import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("results", deadline=None)  # seconds are the business of benchmarks
settings.load_profile("results")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Campaigns run where they are asked for by ``-m slow``."""
    if "slow" in config.option.markexpr:
        return
    for item in items:
        if item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.skip(reason="a campaign of minutes: run it with -m slow"))


@pytest.fixture(scope="session")
def realdata() -> Path:
    """Folder of measured recordings, beside the checkout; tests that need it skip without."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "realdata"
    if not folder.is_dir():
        pytest.skip("the measured recordings are not here")
    return folder


@pytest.fixture(scope="session")
def common(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of all test processes of this run."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "common"
    folder.mkdir(exist_ok=True)
    return folder


def made_once(path: Path, make: Callable[[Path], object]) -> Path:
    """A file that the first test process to ask for it makes while the others wait."""
    with path.with_suffix(".wait").open("w") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)
        if not path.exists():
            make(path)
    return path


@pytest.fixture(scope="session")
def small_set(common: Path) -> Path:
    """Data set of the recipe bilge-pump-small: 120 simulated records of 60 machine draws."""
    from wearstate.datasets.generate import generate

    return made_once(
        common / "small.h5", lambda path: generate("bilge-pump-small", None, path, seed=0, jobs=2)
    )


@pytest.fixture(scope="session")
def small_model(common: Path, small_set: Path) -> Path:
    """Model file trained on `small_set`."""
    from wearstate.diagnose.modelfile import save_model
    from wearstate.diagnose.train import train_model

    return made_once(
        common / "model.wsm", lambda path: save_model(train_model(small_set, seed=0)[0], path)
    )
