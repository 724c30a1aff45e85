"""Fixtures shared by all tests."""

import fcntl
import gc
import os
import pickle
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("results", deadline=None)  # seconds are the business of benchmarks
settings.load_profile("results")


DEAR = (
    "test_same_bytes",
    "test_chart",
    "test_generate",
    "test_stability",
    "test_fidelity",
    "test_lanes",
    "test_page_commands",
    "test_evaluate",
    "test_site",
    "test_shaft_road",
    "test_looks",
    "test_twin",
    "test_doctests",
    "test_strangers",
    "test_recipes_shipped",
    "test_report",
    "test_kill",
    "test_picture",
    "test_cli",
    "test_foreign",
    "test_oiled_joint",
    "test_journal_road",
    "test_assemble",
)
"""Files of 15 s and more: begun first, so that no process is left alone with one of them. The
first ones ask for no model, which one process makes while the others wait."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Half a million objects of modules stay: the garbage collector need not look at them.

    Those that tests import stay as well, and it need not look at them every 700 objects.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()
        gc.set_threshold(50_000, 20, 20)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Dear files first; campaigns run where they are asked for by ``-m slow``."""
    items.sort(key=lambda item: DEAR.index(item.path.stem) if item.path.stem in DEAR else len(DEAR))
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
    from wearstate.datasets.generation.generate import generate

    return made_once(
        common / "small.h5", lambda path: generate("bilge-pump-small", None, path, seed=0, jobs=1)
    )


def trained_once(path: Path, data: Path, seed: int = 0) -> Any:
    """What `train_model` returns of a set, kept in a file for all test processes."""
    from wearstate.diagnose.wear_model.train import train_model

    def train(path: Path) -> None:
        path.write_bytes(pickle.dumps(train_model(data, seed=seed)))

    return pickle.loads(made_once(path, train).read_bytes())


@pytest.fixture(scope="module")
def small_trained(common: Path, small_set: Path) -> Any:
    """What `train_model` returns of `small_set`: model, feature table and rows held out."""
    return trained_once(common / "trained.pickle", small_set)


@pytest.fixture(scope="session")
def journal_set(common: Path) -> Path:
    """Data set of the recipe journal-bearing-small: 120 simulated records."""
    from wearstate.datasets.generation.generate import generate

    return made_once(
        common / "journal.h5",
        lambda path: generate("journal-bearing-small", 120, path, seed=3, jobs=1),
    )


@pytest.fixture(scope="module")
def journal_trained(common: Path, journal_set: Path) -> Any:
    """What `train_model` returns of `journal_set`."""
    return trained_once(common / "journal-trained.pickle", journal_set, seed=3)


@pytest.fixture(scope="session")
def rig_sets(common: Path) -> Path:
    """Folder of shaker tests of 16 shaft rigs, ``test.h5``, and of the rigs running, short."""
    from wearstate.datasets.generation.generate import generate
    from wearstate.datasets.recipe.load import load_recipe

    short = {"duration": "18 s", "sample_rate": "512 Hz", "exciters.0.high": "200 Hz"}
    (common / "rig").mkdir(exist_ok=True)
    for name, view in (("test", ""), ("running", "running")):
        recipe = load_recipe("shaft-rig-small", short, view=view)
        made_once(common / "rig" / f"{name}.h5", partial(generate, recipe, 16, seed=3, jobs=1))
    return common / "rig"


@pytest.fixture(scope="session")
def few_set(common: Path) -> Path:
    """The first 24 records of `small_set`, of 12 machine draws: where no accuracy is asked."""
    from wearstate.datasets.generation.generate import generate

    return made_once(
        common / "few.h5", lambda path: generate("bilge-pump-small", 24, path, seed=0, jobs=1)
    )


@pytest.fixture(scope="module")
def few_trained(common: Path, few_set: Path) -> Any:
    """What `train_model` returns of `few_set`."""
    return trained_once(common / "few-trained.pickle", few_set)


@pytest.fixture(scope="module")
def small_model(common: Path, small_trained: Any) -> Path:
    """Model file trained on `small_set`."""
    from wearstate.diagnose.wear_model.file import save_model

    return made_once(common / "model.wsm", lambda path: save_model(small_trained[0], path))
