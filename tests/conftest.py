"""Fixtures shared by all tests."""

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def realdata() -> Path:
    """Folder of measured recordings, beside the checkout; tests that need it skip without."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "realdata"
    if not folder.is_dir():
        pytest.skip("the measured recordings are not here")
    return folder


@pytest.fixture(scope="session")
def small_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Data set of the recipe bilge-pump-small: 120 simulated records of 60 machine draws."""
    from wearstate.datasets.generate import generate

    path = tmp_path_factory.mktemp("small") / "data.h5"
    generate("bilge-pump-small", None, path, seed=0, jobs=2)
    return path


@pytest.fixture(scope="session")
def small_model(small_set: Path) -> Path:
    """Model file trained on `small_set`."""
    from wearstate.diagnose.modelfile import save_model
    from wearstate.diagnose.train import train_model

    path = small_set.with_name("model.wsm")
    save_model(train_model(small_set, seed=0)[0], path)
    return path
