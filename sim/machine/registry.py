"""Registration of each machine's physics, and its look-up by scene."""

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..output.recording import Recorder, Recording
from ..output.transfer import SceneTransfer
from ..scene.rungs import Effect, Rung
from ..scene.scene import Scene, SceneError

Many = Callable[
    [Sequence[tuple[Scene, int]], Collection[str]], Iterator[tuple[int, Recording | SceneError]]
]


@dataclass(frozen=True, kw_only=True)
class MachinePhysics:
    """Physics of a machine: the value ``MACHINE`` of the module named by its scene type.

    Attributes
    ----------
    scene : type
        Type of its scenes.
    simulate : callable
        Makes one recording from scene, seed, with truth, raise on failure.
    check : callable
        Raises SceneError for faults that need the physics: rungs, step, sampling.
    cost : callable
        Scene -> time of a run by the tables [s], for ranking.
    recorder : callable, optional
        Scene -> a `simulate` that shares the work common to all starts of the scene.
    many : callable, optional
        Sequence of (scene, seed), names of truth -> (number, recording with at least that truth, or
        SceneError) of each, in any order: the same as `simulate` one by one, but faster.
    alike : callable, optional
        Scene -> key of scenes that `many` simulates faster together than mixed; needed with
        `many`.
    transfer : callable, optional
        Scene, frequency [Hz, shape=(n_lines,)] -> transfer functions.
    ladders : mapping of str to tuple of Rung
        Effect -> its rungs, cheapest first.
    effects : callable
        Scene -> its effects, each with its rungs; none for a machine with a single model.
    step : callable, optional
        Scene -> step of its run [s]; needed if ``numerics.step`` is an effect.
    """

    scene: type[Scene]
    simulate: Recorder
    check: Callable[[Scene], None]
    cost: Callable[[Scene], float]
    recorder: Callable[[Scene], Recorder] | None = None
    many: Many | None = None
    alike: Callable[[Scene], Hashable] = lambda _scene: None
    transfer: Callable[[Scene, NDArray[np.float64]], SceneTransfer] | None = None
    ladders: Mapping[str, tuple[Rung, ...]] = field(default_factory=dict)
    effects: Callable[[Scene], Iterable[Effect]] = lambda _scene: ()
    step: Callable[[Scene], float] | None = None


def machine_of(scene: Scene) -> MachinePhysics:
    """Physics of a scene's machine.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    MachinePhysics

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> sorted(machine_of(load_scene("shaft-rig")).ladders)
    ['beam', 'film']
    """
    return cast(MachinePhysics, import_module(scene.physics).MACHINE)
