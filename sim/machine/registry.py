"""What a machine registers beside its scene, and where any other code asks for it."""

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
    """The physics of a machine: the value ``MACHINE`` of the module that its scene type names.

    Attributes
    ----------
    scene : type
        Of its scenes.
    simulate : callable
        Makes one recording: scene, seed, with its truth, error where it fails.
    check : callable
        Raises SceneError for what only the physics can tell: rungs, step, sampling.
    cost : callable
        Scene -> time of a run by the tables, for ranking [s].
    recorder : callable, optional
        Scene -> a `simulate` that has done what all starts of the scene share.
    many : callable, optional
        Sequence of (scene, seed), names of truth -> (number, recording with no truth but that, or
        SceneError) of each, in any order: as `simulate` one by one, but faster. One that knows more
        may say so.
    alike : callable, optional
        Scene -> what scenes have in common that `many` makes faster together than mixed; needed
        beside `many`.
    transfer : callable, optional
        Scene, frequency [Hz, shape=(n_lines,)] -> its transfer functions.
    ladders : mapping of str to tuple of Rung
        Effect -> its rungs, cheapest first.
    effects : callable
        Scene -> its effects, each with its rungs; a machine with one model of everything has none.
    step : callable, optional
        Scene -> step that it runs with [s]; needed where ``numerics.step`` is an effect.
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
    """The machine of a scene.

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
