"""Slider-crank of a reciprocating pump: motion, joint forces, flow, and sliding in its joints.

Examples
--------
>>> import numpy as np
>>> from wearstate import crank
>>> ripple = crank.flow_ripple(0.2, crank.even_phases(3))
>>> round(ripple.total, 3)
0.253
"""

from .sim.contact.closed_forms import IdealCrank, ideal_crank
from .sim.hydraulics.flow_ripple import (
    FlowRipple,
    acceleration_constant,
    even_phases,
    flow_ripple,
    flow_shape,
)
from .sim.wear.rate import JointWear, joint_wear

__all__ = [
    "FlowRipple",
    "IdealCrank",
    "JointWear",
    "acceleration_constant",
    "even_phases",
    "flow_ripple",
    "flow_shape",
    "ideal_crank",
    "joint_wear",
]
