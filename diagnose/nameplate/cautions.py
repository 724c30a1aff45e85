"""Where a nameplate is not what a model was trained on: nothing in the signals need show it."""

from collections.abc import Mapping
from typing import Any

from ...sim.output.recording import Recording
from ...sim.scene.load import load_scene, scene_names
from ...sim.scene.parts import si_unit
from ..feature_rows.healthy import Baseline
from ..machines.registry import presentation_of
from .nameplate import Nameplate, day_of

_SAME = 0.02  # over the trained value: nameplates are rounded


def known_beside(
    plate: Nameplate | None,
    recording: Recording,
    card: Mapping[str, Any],
    baseline: Baseline | None = None,
) -> dict[str, Any]:
    """What a model should be told of a recording beside its signals.

    Parameters
    ----------
    plate : Nameplate or None
    recording : Recording
    card : mapping
        Of the model.
    baseline : Baseline, optional
        Healthy recordings of the same machine.

    Returns
    -------
    dict
        ``conditions`` and ``told`` of :meth:`~.wear_model.estimate.WearModel.estimate`.
    """
    told = nameplate_cautions(plate, recording.row, card)
    return {
        "conditions": day_of(plate, recording.row),
        "told": (*told, *_gap_cautions(plate, recording, baseline)),
    }


def _gap_cautions(
    plate: Nameplate | None, recording: Recording, baseline: Baseline | None
) -> list[str]:
    """Where a shaft runs is read from gap voltages, whose zero nobody knows by itself."""
    if baseline is not None or not any(
        channel.quantity == "displacement" for channel in recording.vibration_channels
    ):
        return []
    if plate is not None and any(path.endswith((".offset", ".gap")) for path in plate.told):
        return []
    return [
        "no healthy recording of this machine tells the offsets of its probes, which are taken to "
        "be as small as where the model was trained, and its estimate leans on them: give "
        "--baseline HEALTHY, or what is known: --set 'sensors.0.offset=0 um +- 5 um'"
    ]


def nameplate_cautions(
    plate: Nameplate | None, row: Mapping[str, Any], card: Mapping[str, Any]
) -> tuple[str, ...]:
    """What a person should know before trusting a model on a machine.

    Parameters
    ----------
    plate : Nameplate or None
    row : mapping
        What was noted beside the recording.
    card : mapping
        Of the model.

    Returns
    -------
    tuple of str
        Of each size that is not that of the machine that the model was trained on.
    """
    if plate is None:
        return ()
    day = plate.on_the_day(row, None)
    return tuple(_otherwise_built(day, card["trained_on"]["scene"]))


def _otherwise_built(day: Any, trained: str) -> list[str]:
    """Sizes that differ from those of the scene that the model was trained on."""
    if trained not in scene_names():
        return []
    usual: Any = load_scene(trained)
    if usual.machine != day.machine:
        return [f"the nameplate is of a {day.machine}, the model of a {usual.machine}"]
    found = []
    for path in presentation_of(day).sizes:
        unit = si_unit(type(day), path)
        mine, theirs = _value(day, path), _value(usual, path)
        if mine is None or theirs is None:
            continue  # a rig has no propeller
        scale = max(abs(theirs), _LEAST_FORCE if unit == "N" else 0.0)
        if abs(mine - theirs) > _SAME * scale:
            found.append(
                f"{path} = {mine:.4g} {unit} by the nameplate, the model was trained at "
                f"{theirs:.4g} {unit} and knows no other: see the film equilibrium"
            )
    return found


_LEAST_FORCE = 1e3  # N: a component that the trained scene has none of is told from 20 N on


def _value(scene: Any, path: str) -> float | None:
    """None where the scene has no such part."""
    for name in path.split("."):
        scene = getattr(scene, name, None)
    return None if scene is None else float(scene)
