"""Errors leave a worker process as they were: the caller sees the cure, and the pool lives on."""

import importlib
import inspect
import pickle
import pkgutil
from pathlib import Path

import pytest
import wearstate
from wearstate.diagnose.sweep.axes import SweepError
from wearstate.sim.bearing.bearing_status import BearingError, BearingStatus
from wearstate.sim.output.status import SimulationError, Status
from wearstate.sim.pump.run_plan import LimitError
from wearstate.sim.scene.scene import SceneError
from wearstate.sim.shaft_films.status import ShaftFilmError, ShaftFilmStatus

ERRORS = [
    SceneError("pump", ["drive.speed = 0 rpm must be > 0"]),
    LimitError("pump", ["step = 1 s is too long"], list(Status)[1]),
    SweepError(["nothing to vary"]),
    SimulationError(list(Status)[1], "pump"),
    BearingError(list(BearingStatus)[1], "bearing"),
    ShaftFilmError(list(ShaftFilmStatus)[1], "stern"),
]


def with_own_arguments():
    """Errors of the package whose texts are made of their arguments."""
    root = Path(wearstate.__file__).parent
    found = set()
    for module in pkgutil.walk_packages([str(root)], "wearstate."):
        if module.name.split(".")[1] in ("sim", "features", "datasets", "diagnose"):
            content = importlib.import_module(module.name)
            found |= {
                item
                for item in vars(content).values()
                if inspect.isclass(item)
                and issubclass(item, Exception)
                and item.__module__.startswith("wearstate")
                and "__init__" in vars(item)
            }
    return found


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_survives_the_way_out_of_a_worker(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_all_errors_with_arguments_of_their_own_are_tried():
    assert with_own_arguments() <= {type(error) for error in ERRORS}
