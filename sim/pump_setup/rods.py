"""Modes of elastic rods, from the scene's data of their section."""

import math

import numpy as np
from numpy.typing import NDArray

from ..mechanism.layout import ROD_MODES
from ..scene.pump import PumpScene
from .joints import cached_by_scene


def buckling_load(scene: PumpScene) -> float:
    """Euler's load of a rod between its pins [N]; infinite if rods are rigid."""
    rod = scene.rod
    if rod.rung == "rigid" or rod.section_area is None or rod.section_radius is None:
        return math.inf
    bending = rod.elastic_modulus * rod.section_area * rod.section_radius**2
    return math.pi**2 * bending / rod.length**2


@cached_by_scene
def rod_table(scene: PumpScene) -> NDArray[np.void]:
    """Modes of the rod of every throw, all equal; empty if rods are rigid.

    The axial shape is a uniform stretch: its stiffness is that of the shank under a steady force,
    its mass follows from the rod's inertia for any mass distribution. The bending shape is the half
    sine of a beam between two pins, less its rigid-body part.

    Returns
    -------
    numpy.ndarray [shape=(0 or n_throws,), dtype=ROD_MODES]
        Read-only.

    Examples
    --------
    A bar between two heavy pins bends at the frequency of a simply supported beam:

    >>> from wearstate.sim.scene.load import load_scene
    >>> bar = {"rod.rung": "elastic", "rod.section_area": "1 cm^2", "rod.section_radius": "5 mm",
    ...     "rod.mass": 0.2, "rod.length": 0.25, "rod.centre_of_mass": 0.125,
    ...     "rod.inertia": 0.2 * 0.25**2 / 12, "crank.radius": 0.05}
    >>> modes = rod_table(load_scene("bilge-pump", bar))[0]
    >>> held = 1 / (1 / modes["inverse_bow_mass"] + 0.2 * modes["crank_shape"] ** 2)
    >>> beam = math.pi**2 * math.sqrt(206e9 * 1e-4 * 0.005**2 / (0.2 / 0.25) / 0.25**4)
    >>> bool(abs(math.sqrt(modes["bow_stiffness"] * held) / beam - 1) < 1e-12)
    True
    """
    rod = scene.rod
    if rod.rung == "rigid" or rod.section_area is None or rod.section_radius is None:
        return np.zeros(0, ROD_MODES)
    length, centre, shank = rod.length, rod.centre_of_mass, rod.shank_mass
    pull = rod.elastic_modulus * rod.section_area
    lift = 2 / math.pi * shank  # for the half sine: its mass, and its first moment of mass
    tilt = lift * (length / 2 - centre)
    moved, turned = lift / rod.mass, tilt / rod.inertia
    stretch_mass = rod.inertia / length**2
    bow_mass = shank / 2 - lift * moved - tilt * turned
    stiff = pull / length
    bending = pull * rod.section_radius**2 * math.pi**4 / (2 * length**3)
    row = (
        length,
        1 / stretch_mass,
        1 / bow_mass,
        stiff,
        bending,
        2 * rod.damping_ratio * math.sqrt(stiff * stretch_mass),
        2 * rod.damping_ratio * math.sqrt(bending * bow_mass),
        -moved - turned * (length - centre),
        -moved + turned * centre,
        -math.pi / length - turned,
        math.pi / length - turned,
    )
    table = np.array([row] * len(scene.throws), ROD_MODES)
    table.flags.writeable = False
    return table
