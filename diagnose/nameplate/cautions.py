"""Differences between a nameplate and a model's training, which the signals need not show."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from ...datasets.draws.draws import Vector
from ...datasets.draws.options import Alternatives
from ...datasets.recipe.load import load_recipe
from ...datasets.recipe.text import recipe_names
from ...sim.output.recording import Recording
from ...sim.parts.wording import si_unit
from ...sim.scene.load import load_scene, scene_names
from ..feature_rows.model_card import ModelCard
from ..healthy_reference.healthy import Baseline
from ..machines.registry import presentation_of
from ..pages.si_text import si_text
from .nameplate import Nameplate, day_of
from .sensors import known_zeros, path_of_zero

_SAME = 0.02  # relative to the trained value: nameplates are rounded


def recording_context(
    plate: Nameplate | None,
    recording: Recording,
    card: ModelCard,
    baseline: Baseline | None = None,
) -> dict[str, Any]:
    """Input of a model in addition to the signals of a recording.

    Parameters
    ----------
    plate : Nameplate or None
    recording : Recording
    card : ModelCard
        Card of the model.
    baseline : Baseline, optional
        Healthy recordings of the same machine.

    Returns
    -------
    dict
        ``conditions`` and ``told`` of :meth:`~.wear_model.estimate.WearModel.estimate`.
    """
    simulated = recording.origin == "simulated"  # in memory: the caller knows its scene
    known = plate is None and simulated
    cautions = () if known else nameplate_cautions(plate, recording.row, card)
    return {
        "conditions": day_of(plate, recording.row),
        "told": (
            *untrained_wear(card),
            *cautions,
            *_gap_cautions(plate, recording, baseline, card.trained_on.scene),
        ),
    }


def untrained_wear(card: ModelCard) -> tuple[str, ...]:
    """Caution of a model that never learnt how a condemned machine sounds.

    Parameters
    ----------
    card : ModelCard

    Returns
    -------
    tuple of str
        Empty if training reached the condemning limit.
    """
    worst, limit = card.severity_range_m[1], card.condemning_limit_m
    if worst >= limit:
        return ()
    return (
        f"no machine in training was worn beyond {1e3 * worst:.3g} mm, the condemning limit is "
        f"{1e3 * limit:.3g} mm: a condemned one may be graded as less worn; train on machines up "
        "to the limit",
    )


def _gap_cautions(
    plate: Nameplate | None, recording: Recording, baseline: Baseline | None, trained: str
) -> list[str]:
    """Caution if the zero of a gap voltage, which gives the shaft position, is unknown."""
    probes = [
        channel.name
        for channel in recording.vibration_channels
        if channel.quantity == "displacement"
    ]
    unknown = [name for name in probes if name not in known_zeros(plate)]
    if baseline is not None or not unknown:
        return []
    usual = load_scene(trained) if trained in scene_names() else None
    path = path_of_zero(plate.scene if plate else usual, unknown[0])
    return [
        f"no healthy recording of this machine shows the offsets of {', '.join(unknown)}, which "
        "are assumed to be as small as in the training of the model, and sensitivities as near to "
        "the nominal, and its estimate depends on them: "
        f"give --baseline HEALTHY, or the known offset of each: --set '{path}=0 um +- 5 um'"
    ]


def unseen_texts(card: ModelCard, also_drawn: str = "") -> list[str]:
    """Effects that mislead a model without a warning: its built-in recipe does not vary them.

    Parameters
    ----------
    card : ModelCard
    also_drawn : str
        Recipe of a second model of the same recording: what it varies is no longer unseen.

    Returns
    -------
    list of str
        Empty for recipes that are not built in, whose variation is unknown.
    """
    trained = card.trained_on
    if trained.recipe not in recipe_names() or trained.scene not in scene_names():
        return []
    drawn = {*_drawn_by(trained.recipe), *_drawn_by(also_drawn)}
    shown = {kind.name for kind in card.strangers}
    return [
        each.text
        for each in presentation_of(load_scene(trained.scene)).unseen
        if each.path not in drawn
        and each.shown not in shown
        and card.severity.startswith(each.severity)
    ]


def nameplate_cautions(
    plate: Nameplate | None, row: Mapping[str, Any], card: ModelCard
) -> tuple[str, ...]:
    """Cautions before trusting a model on a machine.

    Parameters
    ----------
    plate : Nameplate or None
    row : mapping
        Conditions noted with the recording.
    card : ModelCard
        Card of the model.

    Returns
    -------
    tuple of str
        One for each size that differs from the machines of the training, or one for all sizes if
        there is no nameplate.
    """
    trained = card.trained_on.scene
    if trained not in scene_names():
        return ()
    usual: Any = load_scene(trained)
    drawn = _drawn_by(card.trained_on.recipe)
    if plate is None:
        return tuple(_assumed_sizes(usual, drawn, frozenset()))
    day: Any = plate.on_the_day(row, None)
    if usual.machine != day.machine:
        return (f"the nameplate is for a {day.machine}, the model for a {usual.machine}",)
    granted = _assumed_sizes(usual, drawn, plate.set_paths) if plate.assumed else ()
    return (*granted, *_otherwise_built(day, usual, drawn))


@cache
def _drawn_by(recipe: str) -> Mapping[str, tuple[float, float]]:
    """Smallest and largest value of each number that a built-in recipe draws, by path."""
    if recipe not in recipe_names():
        return {}
    found = load_recipe(recipe)
    ends: dict[str, list[float]] = {}
    for axis in (*found.machine, *found.record):
        if not isinstance(axis, Vector):
            ends.setdefault(axis.path, []).extend(axis.extremes())
    for choice in found.choices:
        for path, low, high in _chosen(choice, found.scene):
            ends.setdefault(path, []).extend((low, high))
    return {path: (min(values), max(values)) for path, values in ends.items()}


def _chosen(choice: Alternatives, scene: Any) -> Iterator[tuple[str, float, float]]:
    """Path, smallest and largest value of each number that the options of a choice set or draw.

    An option without a number keeps that of the scene.
    """
    for option in choice.options:
        drawn = {a.path: a.extremes() for a in option.axes if not isinstance(a, Vector)}
        for path in choice.paths:
            value = option.values.get(path, _value(scene, path))
            if path in drawn:
                yield (path, *drawn[path])
            elif isinstance(value, int | float):
                yield path, float(value), float(value)


def _assumed_sizes(usual: Any, drawn: Mapping[str, Any], known: frozenset[str]) -> Iterator[str]:
    """Caution that a model assumes machines of one size, and that of this machine is unknown."""
    sizes = {
        path: value
        for path in presentation_of(usual).sizes
        if path not in drawn and path not in known and (value := _value(usual, path))
    }
    if sizes:
        words = [
            f"{path} = {si_text(value, si_unit(type(usual), path))}"
            for path, value in sizes.items()
        ]
        yield (
            f"no nameplate: the model assumes {', '.join(words)}, which no signal can confirm: "
            f"give --scene MINE.toml, or --scene {usual.name} if this is correct"
        )


def _otherwise_built(
    day: Any, usual: Any, drawn: Mapping[str, tuple[float, float]]
) -> Iterator[str]:
    """Cautions on sizes that differ from those of the machines in the training."""
    for path in presentation_of(day).sizes:
        unit = si_unit(type(day), path)
        mine, theirs = _value(day, path), _value(usual, path)
        if mine is None or theirs is None:
            continue  # a rig has no propeller
        low, high = drawn.get(path, (theirs, theirs))
        scale = max(abs(theirs), _LEAST_FORCE if unit == "N" else 0.0)
        if max(low - mine, mine - high) > _SAME * scale:
            trained = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
            yield (
                f"{path} = {mine:.4g} {unit} by the nameplate, the model was trained at "
                f"{trained} {unit} only"
            )


_LEAST_FORCE = 1e3  # N: a component absent from the trained scene is reported from 20 N on


def _value(scene: Any, path: str) -> float | None:
    """Number at a path of a scene; None if the part is absent or is not a number."""
    for name in path.split("."):
        scene = getattr(scene, name, None)
    return float(scene) if isinstance(scene, int | float) else None
