"""Work of a worker: records of a data set, simulated one by one or in parallel lanes.

Workers import this module, which imports only what a simulation needs, to save memory.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...sim.machine.simulate import simulate, simulate_many
from ...sim.output.recording import Recording
from ...sim.scene.scene import Scene, SceneError, channels_of

NUMERICS = {
    "rung_joint": "S16",
    "rung_wristpin": "S16",
    "rung_guide": "S16",
    "rung_mainbearing": "S16",
    "rung_rod": "S16",
    "rung_pressure": "S16",
    "rung_drive": "S16",
    "rung_casing": "S16",
    "rung_film": "S16",
    "contact_law": "S24",
    "frf_sha256": "S64",
    "mean_speed_hz": "<f8",
    "step_s": "<f8",
    "steps": "<i8",
    "step_per_contact_time": "<f8",
    "contact_changes": "<i8",
    "cuts_refused": "<i8",
    "peak_normal_force_n": "<f8",
    "min_film_m": "<f8",
    "peak_eccentricity": "<f8",
    "least_reaction_n": "<f8",
    "motion_share": "<f8",
    "cavitating_share": "<f8",
    "lift_left": "<f8",
    "tension_share": "<f8",
    "floored_share": "<f8",
    "residual": "<f8",
    "estimated_error": "<f8",
    "stability_margin": "<f8",
    "least_damping_ratio": "<f8",
    "least_damped_hz": "<f8",
    "clipped_samples": "<i8",
}
"""Manifest columns taken from a solution; -1, NaN or empty if it does not provide them."""

REFUSED = "refused"
"""Status of a record whose drawn scene the simulation does not accept."""


@dataclass(frozen=True)
class RecordJob:
    """One record to make: its number, seed, scene, and the manifest values known before."""

    index: int
    seed: int
    row: dict[str, Any]
    scene: Scene


@dataclass(frozen=True)
class RecordOutcome:
    """Result returned by a worker: arrays and plain values only."""

    index: int
    signal: NDArray[np.float32]
    row: dict[str, Any]
    truth: dict[str, NDArray[np.float32]]
    fault: str
    refused: RecordJob | None = None


def each_alone(
    work: Callable[[RecordJob], RecordOutcome], jobs: tuple[RecordJob, ...]
) -> list[RecordOutcome]:
    """Simulate records one after the other."""
    return [work(job) for job in jobs]


def together(jobs: tuple[RecordJob, ...], *, error: float | None) -> list[RecordOutcome]:
    """Simulate records in parallel lanes; runs in a worker."""
    scenes = [(each.scene, each.seed) for each in jobs]
    found = {
        number: _refused(jobs[number], str(solution))
        if isinstance(solution, SceneError)
        else outcome_of(jobs[number], solution, error)
        for number, solution in simulate_many(scenes, doubts=False)  # data sets do not keep doubts
    }
    return [found[number] for number in range(len(jobs))]


def simulated(job: RecordJob, *, truth: bool, error: float | None) -> RecordOutcome:
    """Simulate one record; runs in a worker."""
    try:
        solution = simulate(job.scene, seed=job.seed, truth=truth, raise_on_failure=False)
    except SceneError as fault:
        return _refused(job, str(fault))
    return outcome_of(job, solution, error)


def outcome_of(job: RecordJob, solution: Recording, error: float | None) -> RecordOutcome:
    """Outcome of a solved job; an error measured on pilots replaces the record's own estimate."""
    status = solution.status
    row = {**job.row, "status": status.name.lower(), **numerics_of(solution)}
    return RecordOutcome(
        index=job.index,
        signal=solution.signal,
        row=row if error is None else {**row, "estimated_error": error},
        truth={name: array.astype(np.float32) for name, array in solution.truth.items()},
        fault="" if status.ok else status.text,
    )


def _refused(job: RecordJob, text: str) -> RecordOutcome:
    return RecordOutcome(
        index=job.index,
        signal=silence(job.scene),
        row={**job.row, "status": REFUSED},
        truth={},
        fault=text,
        refused=job,
    )


def silence(scene: Scene) -> NDArray[np.float32]:
    """Signal of a record that could not be simulated."""
    n_samples = round(scene.duration * scene.sample_rate)
    return np.zeros((len(channels_of(scene)), n_samples), dtype=np.float32)


def numerics_of(solution: Recording) -> dict[str, Any]:
    """Numerics of a solution for the manifest."""
    return {name: value for name, value in solution.numerics.items() if name in NUMERICS}
