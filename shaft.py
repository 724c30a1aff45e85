"""Shaft lines: beam, supports, natural frequencies, Campbell diagram, response, oil films.

Examples
--------
>>> import numpy as np
>>> from wearstate import shaft
>>> steel = {"young": 206e9, "shear_modulus": 79e9, "density": 7850.0}
>>> round_bar = shaft.Section(length=1.0, outer_diameter=0.05, **steel)
>>> beam = shaft.assemble_beam([round_bar], longest_element=0.1, shear_coefficient="cowper")
>>> springs = np.diag([1e7, 1e7])
>>> ends = {"aft": 0.0, "forward": 1.0}
>>> held = [shaft.Support(name=n, station=s, stiffness=springs) for n, s in ends.items()]
>>> shaft.natural_frequencies(shaft.Rotor(beam=beam, supports=held), count=2).round(1)
array([89.3, 89.3])
"""

from .sim.beam.beam import Beam, assemble_beam
from .sim.beam.beam_matrices import cowper_coefficient
from .sim.beam.beam_parts import Disc, DistributedLoad, PointLoad, Section
from .sim.beam.campbell import Campbell, CriticalSpeeds, campbell, critical_speeds
from .sim.beam.modes import RotorModes, modes, natural_frequencies
from .sim.beam.rotor import Rotor, Support, Unbalance, orbit_axes, unbalance_response
from .sim.shaft.at_rest import ShaftState, shaft_state
from .sim.shaft.line_beam import shaft_beam
from .sim.shaft_films.film_bearing import FilmBearing
from .sim.shaft_films.on_oil_films import BeamFilm, beam_film, supports
from .sim.shaft_response.receptance import accelerance, receptance

__all__ = [
    "Beam",
    "BeamFilm",
    "Campbell",
    "CriticalSpeeds",
    "Disc",
    "DistributedLoad",
    "FilmBearing",
    "PointLoad",
    "Rotor",
    "RotorModes",
    "Section",
    "ShaftState",
    "Support",
    "Unbalance",
    "accelerance",
    "assemble_beam",
    "beam_film",
    "campbell",
    "cowper_coefficient",
    "critical_speeds",
    "modes",
    "natural_frequencies",
    "orbit_axes",
    "receptance",
    "shaft_beam",
    "shaft_state",
    "supports",
    "unbalance_response",
]
