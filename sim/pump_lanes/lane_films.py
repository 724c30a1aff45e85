"""Oil films of all lanes: forces on the film, its velocity, its load on rod and crank."""

import math
from typing import Any

from ..contact.asperities import SEPARATION
from ..film.map_look_up import RADIAL, TANGENTIAL, MapPlace, map_patches, map_place, map_tensor
from ..film.short import short_resistance
from ..jit import kernel, subroutine
from ..mechanism.oiled_joint import (
    NEWTON_STEPS,
    FilmPull,
    film_gap,
    film_load,
    film_pull,
    newton_damping,
    newton_step,
    peaks_of,
)
from ..mechanism.throw_motion import crank_offset
from .fields import fields_of, put_fields
from .lane_layout import BETA, CRANK, LANES, OilLane, contact_of, lane_pose, oil_of, throw_of


@kernel
def _film_pull_of(s: Any, lane: int) -> Any:
    return fields_of(FilmPull, s.pull, lane)


@kernel
def _map_place_of(s: Any, lane: int) -> Any:
    return fields_of(MapPlace, s.place, lane)


@kernel
def _turns_of(s: Any, lane: int) -> Any:
    """Mean of the angular velocities of crank pin and eye, and their difference [rad/s]."""
    pin, eye = s.v[CRANK, lane], -s.v[BETA, lane]
    return 0.5 * (pin + eye), pin - eye


@subroutine
def _look_into_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        c = contact_of(p, 0, lane)
        d_x, d_y, v_x, v_y = crank_offset(
            lane_pose(s, lane),
            s.v[CRANK, lane],
            throw_of(p, lane),
            s.turned[0, lane],
            s.turned[1, lane],
            s.turned[2, lane],
            s.turned[3, lane],
        )
        put_fields(s.offset, lane, (d_x, d_y, v_x, v_y))
        s.overlap[0, lane] = math.sqrt(d_x * d_x + d_y * d_y) - c.clearance
        s.gap[lane] = film_gap(s.film[0, lane], s.film[1, lane], c)
        s.rough[0, lane] = s.rough[1, lane] = 0.0
    for lane in range(LANES):  # asperities seldom touch, and need a power function of the library
        o = oil_of(p, lane)
        if o.roughness > 0.0 and not s.gap[lane] >= SEPARATION * o.roughness:
            s.rough[0, lane], s.rough[1, lane] = peaks_of(s.gap[lane], o)


@subroutine
def _pull_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        mean, _ = _turns_of(s, lane)
        found = film_pull(
            s.film[0, lane],
            s.film[1, lane],
            s.offset[0, lane],
            s.offset[1, lane],
            s.offset[2, lane],
            s.offset[3, lane],
            mean,
            s.rough[0, lane],
            s.rough[1, lane],
            contact_of(p, 0, lane),
            oil_of(p, lane),
        )
        put_fields(s.pull, lane, found)
        s.settled[lane] = 0.0


@kernel
def _squeeze(
    s: Any, lane: int, r_xx: float, r_xy: float, r_yx: float, r_yy: float, damped: float
) -> None:
    """Take a Newton step, unless converged or no longer finite."""
    v_x, v_y = s.squeeze[0, lane], s.squeeze[1, lane]
    new_x, new_y, enough = newton_step(
        r_xx, r_xy, r_yx, r_yy, _film_pull_of(s, lane), v_x, v_y, damped
    )
    done = s.settled[lane] != 0.0
    s.squeeze[0, lane], s.squeeze[1, lane] = v_x if done else new_x, v_y if done else new_y
    s.settled[lane] = 1.0 if done or enough or new_x - new_x != 0.0 else 0.0


@subroutine
def _squeeze_short(p: Any, s: Any, damped: float) -> None:
    for lane in range(LANES):
        f, o = _film_pull_of(s, lane), oil_of(p, lane)
        xx, xy, yy = short_resistance(f.x, f.y, s.squeeze[0, lane], s.squeeze[1, lane], o.filled)
        _squeeze(s, lane, o.short * xx, o.short * xy, o.short * xy, o.short * yy, damped)


@subroutine
def _squeeze_mapped(p: Any, s: Any, maps: Any, damped: float) -> None:
    """Take a Newton step with the map, lane by lane: aliasing prevents vectorisation."""
    for lane in range(LANES):
        f, o = _film_pull_of(s, lane), oil_of(p, lane)
        found = map_place(o, o.roots, o.angles, f.x, f.y, s.squeeze[0, lane], s.squeeze[1, lane])
        put_fields(s.place, lane, found)
    for lane in range(LANES):
        if s.settled[lane] == 0.0 and p.oil[_MAP, lane] > 0.0:
            o, m = oil_of(p, lane), _map_place_of(s, lane)
            begin, roots, angles = int(o.offset), int(o.roots), int(o.angles)
            c = maps[begin : begin + 3 * roots * angles].reshape(3, roots, angles)
            found = map_patches(c[RADIAL], c[TANGENTIAL], m.i, m.j, m.p, m.q)
            put_fields(s.patch, lane, found)
    for lane in range(LANES):
        o = oil_of(p, lane)
        xx, xy, yx, yy = map_tensor(
            _map_place_of(s, lane),
            o.per_radian,
            s.patch[0, lane],
            s.patch[1, lane],
            s.patch[2, lane],
            s.patch[3, lane],
        )
        _squeeze(s, lane, o.map * xx, o.map * xy, o.map * yx, o.map * yy, damped)


_MAP = OilLane._fields.index("map")


@subroutine
def _load_films(p: Any, s: Any) -> None:
    for lane in range(LANES):
        mean, slip = _turns_of(s, lane)
        x, y, on_pin, on_eye, rate_x, rate_y, _, peaks = film_load(
            s.film[0, lane],
            s.film[1, lane],
            s.offset[0, lane],
            s.offset[1, lane],
            mean,
            slip,
            s.squeeze[0, lane],
            s.squeeze[1, lane],
            s.gap[lane],
            s.rough[0, lane],
            s.rough[1, lane],
            _film_pull_of(s, lane),
            contact_of(p, 0, lane),
            oil_of(p, lane),
        )
        put_fields(s.pin, lane, (x, y, on_pin, on_eye))
        s.film_rate[0, lane], s.film_rate[1, lane] = rate_x, rate_y
        s.carried[lane], s.normal[lane] = peaks, math.sqrt(x * x + y * y)


@subroutine
def at_oiled_crankpin(p: Any, s: Any, maps: Any, mapped: bool) -> None:
    """Solve for the films of all lanes together, until the last has converged."""
    _look_into_films(p, s)
    _pull_films(p, s)
    for step in range(NEWTON_STEPS):
        if mapped:
            _squeeze_mapped(p, s, maps, newton_damping(step))
        else:
            _squeeze_short(p, s, newton_damping(step))
        found = 0.0
        for lane in range(LANES):
            found += s.settled[lane]
        if found == LANES:
            break
    _load_films(p, s)
