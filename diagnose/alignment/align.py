"""Alignment of a shaft line in its conditions: limits, calibration, jacking."""

from dataclasses import dataclass

from ...sim.alignment.alignment import AlignmentLine, Check, Condition, LineState, check, reactions
from ...sim.alignment.calibration import Calibration, calibrate
from ...sim.alignment.jacking import Jacking, jacking
from ...sim.alignment.seats import AlignmentError
from ...sim.brief import brief
from ...sim.scene.scene import Scene
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.line_alignment import alignment_conditions, alignment_line
from .quiet_moves import QuietMoves, quiet_moves


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    """Result of `wearstate align`.

    Attributes
    ----------
    scene : ShaftScene
    line : AlignmentLine
    states : tuple of LineState
        One for each condition, with the line as set.
    calibration : Calibration or None
    jacking : Jacking or None
        Jacking in the first condition.
    margin : float
        Requested distance from each limit, as a share of it.
    quiet : QuietMoves or None
        Effect of the moves on the vibration, if that was the target.
    """

    scene: ShaftScene
    line: AlignmentLine
    states: tuple[LineState, ...]
    calibration: Calibration | None
    jacking: Jacking | None
    margin: float = 0.0
    quiet: QuietMoves | None = None

    __repr__ = brief("name", "verdict")

    @property
    def name(self) -> str:
        """Name of the scene."""
        return self.scene.name

    @property
    def proposed(self) -> tuple[dict[str, float], dict[str, float]]:
        """Moves [m] and turns [rad] by bearing; empty if none are proposed."""
        found = self.calibration
        if found is None or not found.moved:
            return {}, {}
        names = found.line.names
        moves, turns = (
            dict(zip(names, map(float, values), strict=True))
            for values in (found.moves, found.turns)
        )
        return moves, turns

    @property
    def unmet(self) -> tuple[Check, ...]:
        """Limits that the line does not meet as set."""
        return tuple(limit for state in self.states for limit in check(state) if not limit.met)

    @property
    def verdict(self) -> str:
        """``within``; ``alarm`` if a bearing lifts or no moves help; else ``warning``."""
        stuck = self.calibration is not None and not self.calibration.status.ok
        if stuck or any(state.lifted for state in self.states):
            return "alarm"
        return "warning" if self.unmet else "within"


def align(
    scene: Scene,
    *,
    condition: str = "all",
    mend: bool = True,
    prefer: str = "least",
    target: str = "limits",
    margin: float = 0.0,
    jack: str | None = None,
) -> Alignment:
    """Judge the alignment of a scene, and find moves that correct it.

    Parameters
    ----------
    scene : Scene
        Scene of the machine propulsion-shaft.
    condition : str
        Name of one of the scene's conditions, or "all".
    mend : bool
        Search for moves.
    prefer, target : str
        As in :func:`wearstate.sim.alignment.calibration.calibrate`; the target "vibration" is that
        of :func:`wearstate.diagnose.alignment.quiet_moves.quiet_moves`.
    margin : float
        As in :func:`wearstate.sim.alignment.calibration.calibrate`.
    jack : str, optional
        Bearing to jack.

    Returns
    -------
    Alignment
        States, moves and verdict.

    Raises
    ------
    AlignmentError
        The scene is not a shaft line, its line has no equilibrium, or a name is unknown.

    Examples
    --------
    >>> from wearstate.sim.scene.load import load_scene
    >>> align(load_scene("propulsion-shaft")).verdict
    'within'
    """
    if not isinstance(scene, Scene):
        raise AlignmentError(f"scene = {scene!r} must be a scene; wearstate.load_scene reads one")
    if not isinstance(scene, ShaftScene):
        raise AlignmentError(
            f"machine of scene '{scene.name}' = '{scene.machine}' must be 'propulsion-shaft'; "
            "only a shaft line has an alignment"
        )
    line, conditions = _line_of(scene), _conditions_of(scene, condition)
    states = tuple(reactions(line, one) for one in conditions)
    calibration = quiet = None
    if mend:
        aim = "limits" if target == "vibration" else target
        calibration = calibrate(line, conditions, prefer=prefer, target=aim, margin=margin)
    if calibration is not None and target == "vibration":
        quiet = quiet_moves(scene, calibration, margin=margin)
        calibration = quiet.calibration
    return Alignment(
        scene=scene,
        line=line,
        states=states,
        calibration=calibration,
        jacking=jacking(line, jack, conditions[0]) if jack is not None else None,
        margin=margin,
        quiet=quiet,
    )


def _line_of(scene: ShaftScene) -> AlignmentLine:
    try:
        return alignment_line(scene)
    except ValueError as error:  # from the beam: inconsistent stations
        raise AlignmentError(f"scene '{scene.name}': {error}") from None


def _conditions_of(scene: ShaftScene, name: str) -> list[Condition]:
    found = alignment_conditions(scene)
    if name == "all":
        return list(found.values())
    if name not in found:
        raise AlignmentError(
            f"condition = '{name}' must be 'all' or one of {', '.join(found)}; choose one of them"
        )
    return [found[name]]


def states_after(found: Alignment) -> tuple[LineState, ...]:
    """Conditions after the moves; empty without moves."""
    moved = found.calibration is not None and found.calibration.moved
    return found.calibration.after if found.calibration is not None and moved else ()
