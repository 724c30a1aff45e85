"""Alignment model of a line: seats, conditions, the hull's shape."""

from ..alignment.alignment import AlignmentLine, Condition
from ..scene.shaft import ShaftScene
from ..scene.shaft_parts import ShaftCondition
from .line_beam import seat_of, shaft_beam, thrust_loads


def alignment_line(scene: ShaftScene) -> AlignmentLine:
    """Alignment model of a line: the beam on elastic, unilateral seats.

    Parameters
    ----------
    scene : ShaftScene
        A propulsion shaft or a shaft rig.

    Returns
    -------
    AlignmentLine
        Offsets as aligned, less sag and wear-down; without thermal rise and hull deflection, which
        belong to a condition.

    Raises
    ------
    ValueError
        As in :func:`shaft_beam`.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> line = alignment_line(load_scene("propulsion-shaft", {"bearings.2.sag": "1 mm"}))
    >>> line.seats[2].name, line.seats[2].offset
    ('intermediate_aft', -0.001)
    """
    return AlignmentLine(
        beam=shaft_beam(scene), seats=tuple(seat_of(bearing) for bearing in scene.bearings)
    )


def alignment_conditions(scene: ShaftScene) -> dict[str, Condition]:
    """States in which the alignment must be within its limits.

    Parameters
    ----------
    scene : ShaftScene
        A propulsion shaft or a shaft rig.

    Returns
    -------
    dict of str to Condition
        ``cold``, ``hot`` and ``running``.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> found = alignment_conditions(load_scene("propulsion-shaft"))
    >>> list(found), round(1e3 * found["hot"].rises[-1], 3)
    (['cold', 'hot', 'running'], 0.2)
    """
    return {
        name: _condition(scene, name, getattr(scene.conditions, name))
        for name in type(scene.conditions).model_fields
    }


def _condition(scene: ShaftScene, name: str, part: ShaftCondition) -> Condition:
    hull = hull_deflection(scene, part)
    rises = tuple(
        part.rise_share * bearing.rise
        + part.lift_share * bearing.lift
        + hull * hull_shape(scene, bearing.station)[0]
        for bearing in scene.bearings
    )
    return Condition(
        name=name,
        rises=rises,
        slopes=tuple(hull * hull_shape(scene, b.station)[1] for b in scene.bearings),
        loads=thrust_loads(scene, part.thrust_share),
    )


def hull_deflection(scene: ShaftScene, part: ShaftCondition) -> float:
    """Hull deflection of the condition, by default the hull's own [m]."""
    return scene.hull.deflection if part.hull_deflection is None else part.hull_deflection


def hull_shape(scene: ShaftScene, station: float) -> tuple[float, float]:
    """Height and slope of the hull for a rise of its middle by one.

    Parameters
    ----------
    scene : ShaftScene
    station : float
        Distance from the aft end [m].

    Returns
    -------
    height : float
        Over the height of the middle: a parabola, zero at the first and at the last bearing [-].
    slope : float
        Over the height of the middle [1/m].

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> height, slope = hull_shape(load_scene("propulsion-shaft"), (1.25 + 15.6) / 2)
    >>> round(height, 9), abs(slope) < 1e-9
    (1.0, True)
    """
    first, last = scene.bearings[0].station, scene.bearings[-1].station
    share = (station - first) / (last - first)
    return 4 * share * (1 - share), 4 * (1 - 2 * share) / (last - first)
