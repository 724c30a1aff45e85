"""Checks of the length and sample rate of a recording; faults as sentences."""

import math

from .scene import Scene

MEMORY = 4e9  # byte, limit of one run: a data set runs one per core


def duration_faults(scene: Scene, revolution: float) -> list[str]:
    """Find a recording shorter than one revolution [s]."""
    if scene.duration >= revolution:
        return []
    return [
        f"duration = {scene.duration:g} s must be >= one revolution = {revolution:g} s; "
        "record longer"
    ]


def tacho_faults(scene: Scene, revolution: float) -> list[str]:
    """Find a tacho pulse shorter than two samples, given the time of a revolution [s]."""
    if not scene.tacho or scene.tacho.pulse_width / math.tau * revolution >= 2 / scene.sample_rate:
        return []
    return [
        f"tacho.pulse_width = {scene.tacho.pulse_width:g} rad must last >= 2 samples; "
        "widen the pulse or raise sample_rate"
    ]


def memory_faults(scene: Scene, needed: float) -> list[str]:
    """Find a recording whose memory [byte] exceeds the limit."""
    if needed <= MEMORY:
        return []
    return [
        f"duration = {scene.duration:g} s at sample_rate = {scene.sample_rate:g} Hz needs "
        f"{needed / 1e9:.3g} GB, must be <= {MEMORY / 1e9:g} GB; shorten it or lower the rate"
    ]
