"""Faults of how long and how often a machine is recorded, as sentences."""

import math

from .scene import Scene

MEMORY = 4e9  # byte, what one run may take: a data set runs one on every core


def duration_faults(scene: Scene, revolution: float) -> list[str]:
    """Fault of a recording shorter than a revolution [s]."""
    if scene.duration >= revolution:
        return []
    return [
        f"duration = {scene.duration:g} s must be >= one revolution = {revolution:g} s; "
        "record longer"
    ]


def tacho_faults(scene: Scene, revolution: float) -> list[str]:
    """Fault of a tacho pulse shorter than two samples, by the time of a revolution [s]."""
    if not scene.tacho or scene.tacho.pulse_width / math.tau * revolution >= 2 / scene.sample_rate:
        return []
    return [
        f"tacho.pulse_width = {scene.tacho.pulse_width:g} rad must last >= 2 samples; "
        "widen the pulse or raise sample_rate"
    ]


def memory_faults(scene: Scene, needed: float) -> list[str]:
    """Fault of a recording that needs so many bytes."""
    if needed <= MEMORY:
        return []
    return [
        f"duration = {scene.duration:g} s at sample_rate = {scene.sample_rate:g} Hz needs "
        f"{needed / 1e9:.3g} GB, must be <= {MEMORY / 1e9:g} GB; shorten it or lower the rate"
    ]
