"""Table of all film models, from the cheapest to the best.

It determines what a scene may choose, how ladders rank films, and which films serve for bearing
characteristics, for shaft lines, or only for verification.
"""

from collections.abc import Callable
from dataclasses import dataclass

from .mass_conserving import mass_conserving
from .solve import FilmSolution, solve_direct, solve_finite, solve_long, solve_short


@dataclass(frozen=True, kw_only=True)
class FilmRung:
    """One model of an oil film.

    Attributes
    ----------
    name, assumes, valid, reference : str
    nanoseconds : float
        Time of one call on the mesh of 72 by 17, near a previous one, for ranking [ns].
    field : callable
        ``(geometry, state) -> FilmSolution``; for a table, the film that it is built from.
    scene : bool
        Whether a scene may choose it.
    bearing : bool
        Whether equilibrium and coefficients of a single bearing are computed with it.
    tilted : bool
        Whether it handles a journal that is tilted in its bearing.
    verification : bool
        For verification only: takes seconds where others take milliseconds. A line can use it
        when called from Python; no scene, ladder or command offers it.
    """

    name: str
    assumes: str
    valid: str
    reference: str
    nanoseconds: float
    field: Callable[..., FilmSolution]
    scene: bool = False
    bearing: bool = True
    tilted: bool = False
    verification: bool = False


FILM_RUNGS: tuple[FilmRung, ...] = (
    FilmRung(
        name="short",
        assumes="no pressure flow round the circle; pressure on the closing half (Guembel)",
        valid="L/D up to about 1/4 at low eccentricity; plain bore, aligned",
        reference="Ocvirk (1952), NACA TN 2808; Dubois, Ocvirk (1953), NACA TN 2809",
        nanoseconds=100.0,
        field=solve_short,
        scene=True,
    ),
    FilmRung(
        name="long",
        assumes="no flow to the ends",
        valid="L/D from about 4 on; aligned",
        reference="Sommerfeld (1904), Zeitschrift fuer Mathematik und Physik 50, 97-155",
        nanoseconds=8_000.0,
        field=solve_long,
    ),
    FilmRung(
        name="finite",
        assumes="a parabola along the length",
        valid="force within 2 % up to L/D = 1, 6 % up to L/D = 4, eccentricity up to 0.9; aligned",
        reference="Galerkin's method; the share of Warner (1963), ASLE Transactions 6(1)",
        nanoseconds=6_000.0,
        field=solve_finite,
    ),
    FilmRung(
        name="map",
        assumes="the direct film of a plain aligned bore, interpolated in a table",
        valid="a plain aligned bore without feed pressure",
        reference="Childs, Moes, van Leeuwen (1977) for the idea",
        nanoseconds=125.0,
        field=solve_direct,
        scene=True,
        bearing=False,
    ),
    FilmRung(
        name="direct",
        assumes="Reynolds' equation with cavitation, oil wherever it can be taken or by an inlet",
        valid="laminar, isothermal; any L/D, bore, grooves and tilt that the mesh resolves",
        reference="Reynolds (1886), Philosophical Transactions 177, 157-234; active sets",
        nanoseconds=17_000.0,
        field=solve_direct,
        scene=True,
        tilted=True,
    ),
    FilmRung(
        name="mass-conserving",
        assumes="thin laminar film, full or streamers without pressure; oil from the supply alone",
        valid="any L/D, bore, grooves and tilt that the mesh resolves; a motion by mass_step",
        reference="Elrod (1981), Journal of Lubrication Technology 103, 350-354",
        nanoseconds=600_000.0,
        field=mass_conserving,
        bearing=False,
        tilted=True,
        verification=True,
    ),
)
"""A new rung is one row. A line may use any of them."""
