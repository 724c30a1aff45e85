"""Length and steps of a pump's run, or why it is refused."""

import math
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..casing.decimation import edge_samples
from ..excitation.forces import Push
from ..output.status import Status
from ..scene.exciters import pushing_faults
from ..scene.pump import PumpScene
from ..scene.recorded import MEMORY, duration_faults, memory_faults, tacho_faults
from ..scene.scene import SceneError
from .push import casing_pushes
from .validity import FEWEST_STEPS, MOST_STEPS, joint_faults, knock_limits, limits, pump_step

_BYTES_PER_STEP = 3 * 10 * 8  # for one throw: forces and chamber as doubles, two passes over them


def planned(scene: PumpScene) -> "RunPlan":
    """Plan steps and samples of a running scene.

    Raises
    ------
    SceneError, LimitError
        As in :func:`steps_per_sample`.
    """
    return RunPlan(scene, steps_per_sample(scene))


def rest_faults(scene: PumpScene) -> list[str]:
    """Faults of a recording with the pump at rest: memory, exciters."""
    needed = scene.duration * scene.sample_rate * FEWEST_STEPS * _BYTES_PER_STEP
    return [*memory_faults(scene, needed), *pushing_faults(scene, scene.exciters)]


def refuse(scene: PumpScene, faults: list[str]) -> None:
    """Raise the faults, if there are any."""
    if faults:
        raise SceneError(scene.name, faults)


class RunPlan:
    """Steps of a scene's run, and the samples that are kept."""

    def __init__(self, scene: PumpScene, factor: int) -> None:
        rate, speed = scene.sample_rate, scene.drive.speed
        edge = edge_samples(factor)
        settling = math.ceil(scene.settling_revolutions / speed * rate) + edge
        self.scene = scene
        self.factor = factor
        self.step = 1 / (rate * factor)
        self.n_samples = round(scene.duration * rate)
        self.n_steps = (settling + self.n_samples + edge) * factor
        self.kept = slice(settling, settling + self.n_samples)
        # a sample represents the middle of its first step, see decimate
        before = (settling * factor + 0.5) / (rate * factor)
        self.first_angle = scene.drive.start_angle - 2 * math.pi * speed * before

    def pushes(self, seed: int) -> tuple[Push, ...]:
        """Forces of the mounted exciters at all steps."""
        first, last = self.kept.start * self.factor, self.kept.stop * self.factor
        return casing_pushes(
            self.scene,
            n_steps=self.n_steps,
            first=first,
            last=last,
            factor=self.factor,
            seed=seed,
        )

    @property
    def angle(self) -> NDArray[np.float64]:
        """Crank angle at the samples [rad], at constant speed; not stored, to save memory."""
        scene = self.scene
        seconds = np.arange(self.n_samples) / scene.sample_rate
        return np.asarray(scene.drive.start_angle + 2 * math.pi * scene.drive.speed * seconds)

    def turned(self, made: NDArray[np.float64]) -> NDArray[np.float64]:
        """Crank angle at the samples [rad]: exact at constant speed, else as computed."""
        return made if self.scene.drive.rung != "constant-speed" else self.angle

    def at_samples(self, ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the samples from those at the ends of all steps, with time as first axis.

        A sample represents the middle of a step: its value is the mean of the step's two ends.
        """
        first, step = self.kept.start * self.factor, self.factor
        last = first + self.n_samples * step
        return np.asarray(0.5 * (ends[first:last:step] + ends[first + 1 : last + 1 : step]))


class LimitError(SceneError):
    """A scene beyond the limits of its methods; the status gives the reason."""

    def __init__(self, name: str, faults: list[str], status: Status) -> None:
        self.status = status
        super().__init__(name, faults)

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:
        """How it leaves a worker process."""
        return type(self), (self.name, self.faults, self.status)


def steps_per_sample(scene: PumpScene) -> int:
    """Integration steps per sample: as the contact needs, or as set in the scene.

    Raises
    ------
    SceneError
        Collected faults: an invalid rung, a recording shorter than a revolution or two samples, a
        pulse shorter than two samples. Or: a step shorter than a thousandth of a sample, a run that
        needs more than 4 GB.
    LimitError
        A step too long for the contact, a contact too soft for its law or its clearance, a
        pressure below that of the vapour, also in a trial of two revolutions; its status goes into
        the recording.
    """
    faults = joint_faults(scene)
    if faults:
        raise SceneError(scene.name, [*faults, *_sampling_faults(scene)])
    faults = _sampling_faults(scene)
    beyond = limits(scene)
    step = pump_step(scene)
    if faults:
        raise SceneError(scene.name, [*faults, *(fault for _, fault in beyond)])
    if beyond:
        raise LimitError(scene.name, [fault for _, fault in beyond], beyond[0][0])
    wanted = 1 / (scene.sample_rate * step)
    faults = [fault for fault in (_step_fault(scene, wanted), _size_fault(scene, wanted)) if fault]
    if faults:
        raise SceneError(scene.name, faults)
    beyond = knock_limits(scene)
    if beyond:
        raise LimitError(scene.name, [fault for _, fault in beyond], beyond[0][0])
    return max(FEWEST_STEPS, math.ceil(wanted - 1e-9))


def _step_fault(scene: PumpScene, steps: float) -> str | None:
    if steps - 1e-9 <= MOST_STEPS:  # the bound itself, allowing for rounding
        return None
    shortest = 1 / (scene.sample_rate * MOST_STEPS)
    if scene.numerics.step is not None:
        return (
            f"numerics.step = {scene.numerics.step:g} s must be >= {shortest:.3g} s, "
            f"{MOST_STEPS} steps a sample; lengthen it, or raise sample_rate"
        )
    return (
        f"the contact needs steps of {shortest * MOST_STEPS / steps:.3g} s, must be >= "
        f"{shortest:.3g} s, {MOST_STEPS} steps a sample; raise sample_rate, lower stiffness and "
        "damping of the joints, or raise their speed_floor or restitution_speed"
    )


def _size_fault(scene: PumpScene, steps: float) -> str | None:
    """Refuse a run that would exceed the memory, before any is allocated."""
    time = scene.duration + scene.settling_revolutions / scene.drive.speed
    per_step = _BYTES_PER_STEP * len(scene.throws)
    needed = time * scene.sample_rate * max(steps, FEWEST_STEPS) * per_step
    if needed <= MEMORY:
        return None
    return (
        f"duration = {scene.duration:g} s at sample_rate = {scene.sample_rate:g} Hz with "
        f"{max(steps, FEWEST_STEPS):.0f} steps a sample needs {needed / 1e9:.3g} GB, must be <= "
        f"{MEMORY / 1e9:g} GB; shorten duration or settling_revolutions, lower sample_rate, "
        "lengthen numerics.step, or raise a joint's speed_floor or restitution_speed"
    )


def _sampling_faults(scene: PumpScene) -> list[str]:
    revolution = 1 / scene.drive.speed
    faults = pushing_faults(scene, scene.exciters)
    faults += duration_faults(scene, revolution)
    if scene.duration * scene.sample_rate < 2:
        faults.append(
            f"duration = {scene.duration:g} s must be >= 2 samples = {2 / scene.sample_rate:g} s; "
            "raise sample_rate or record longer"
        )
    return faults + tacho_faults(scene, revolution)
