"""Alignment of a shaft line as a table for JSON."""

from typing import Any

from ...sim.alignment.alignment import AlignmentLine, LineState, check, influence
from ...sim.alignment.calibration import Calibration
from ...sim.alignment.jacking import Jacking
from .align import Alignment, states_after
from .films import film_rows, film_states
from .margins import jack_rows, margin_rows
from .quiet_moves import QuietMoves

ALIGN_SCHEMA = 1


def align_table(found: Alignment) -> dict[str, Any]:
    """Results of `wearstate align` in SI, ready for JSON.

    Returns
    -------
    dict
        ``schema_version``, ``scene``, ``verdict``, ``bearings``, ``conditions`` (the line as set),
        ``influence_n_per_m``, ``margins``, ``jacks``, ``films`` at three speeds, ``calibration``,
        ``vibration`` and ``jacking``, the last three null if not requested.
    """
    return {
        "schema_version": ALIGN_SCHEMA,
        "scene": found.name,
        "verdict": found.verdict,
        "weight_n": found.line.beam.weight,
        "bearings": [_seat_row(found.line, i) for i in range(len(found.line.seats))],
        "conditions": [_state_rows(state) for state in found.states],
        "influence_n_per_m": influence(found.line, found.states[0]).tolist(),
        "margins": margin_rows(found.states, states_after(found)),
        "jacks": jack_rows(found.states, found.calibration),
        "films": film_rows(film_states(found.scene, *found.proposed)),
        "calibration": _calibration_table(found.calibration),
        "vibration": None if found.quiet is None else _quiet_table(found.quiet),
        "jacking": None if found.jacking is None else _jacking_table(found.jacking),
    }


def _seat_row(line: AlignmentLine, i: int) -> dict[str, Any]:
    seat = line.seats[i]
    return {
        "name": seat.name,
        "station_m": seat.station,
        "offset_m": seat.offset,
        "slope_rad": seat.slope,
        "points": seat.points,
        "least_load_n": seat.least_load,
        "most_load_n": seat.highest_load,
        "most_pressure_pa": seat.most_pressure,
        "most_slope_rad": seat.most_slope,
        "least_move_m": seat.least_move,
        "most_move_m": seat.most_move,
    }


def _state_rows(state: LineState) -> dict[str, Any]:
    unmet = [limit for limit in check(state) if not limit.met]
    owner = state.line.held.owner
    whole = float(state.reactions.sum())
    return {
        "name": state.condition.name,
        "load_n": whole,
        "bearings": [
            {
                "name": name,
                "reaction_n": float(state.reactions[i]),
                "share": float(state.reactions[i]) / whole,
                "point_reactions_n": state.point_reactions[owner == i].tolist(),
                "mean_pressure_pa": float(state.pressures[i]),
                "edge_pressure_pa": float(state.edge_pressures[i]),
                "slope_rad": float(state.relative_slopes[i]),
                "lifted": name in state.lifted,
                "unmet": [limit.text for limit in unmet if limit.bearing == name],
            }
            for i, name in enumerate(state.line.names)
        ],
    }


def _calibration_table(found: Calibration | None) -> dict[str, Any] | None:
    if found is None:
        return None
    names = found.line.names
    return {
        "status": found.status.name.lower(),
        "text": found.status.text,
        "moves_m": dict(zip(names, found.moves.tolist(), strict=True)),
        "turns_rad": dict(zip(names, found.turns.tolist(), strict=True)),
        "total_move_m": found.total_move,
        "conditions": [_state_rows(state) for state in found.after],
        "unmet": [limit.text for limit in found.unmet],
        "blocks": [block.text for block in found.blocks],
        "margin": found.margin,
        "touched": [limit.text for limit in found.touched],
    }


def _quiet_table(found: QuietMoves) -> dict[str, Any]:
    return {
        "text": found.text,
        "before_rms_m_per_s2": found.before.tolist(),
        "after_rms_m_per_s2": found.after.tolist(),
    }


def _jacking_table(found: Jacking) -> dict[str, Any]:
    return {
        "bearing": found.bearing,
        "station_m": found.station,
        "lifts_m": found.lifts.tolist(),
        "loads_n": found.loads.tolist(),
        "first_slope_n_per_m": found.first_slope,
        "second_slope_n_per_m": found.second_slope,
        "free_lift_m": found.free_lift,
        "free_load_n": found.free_load,
        "zero_load_n": found.zero_load,
        "correction_factor": found.correction_factor,
        "estimate_n": found.estimate,
        "reaction_n": found.reaction,
        "others": list(found.others),
    }
