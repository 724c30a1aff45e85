"""Records of the independent programs as data sets, labelled and laid out like the library's own.

A program is a function of a job that returns a signal and its row of the manifest; this file knows
no physics. Machines are told by name, so that healthy records of the same machines can be paired.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.diagnose.learning.grades import grades_of

RECORDS_PER_MACHINE = 2  # as the standard recipes have


@dataclass(frozen=True, kw_only=True)
class Job:
    """One record to be made.

    Attributes
    ----------
    seed : int
        Of the data set.
    machine, record : int
        Numbers that decide the draws.
    healthy : bool
        As new.
    on : frozenset of str
        Differences from the library that are switched on.
    """

    seed: int
    machine: int
    record: int
    healthy: bool
    on: frozenset[str]


@dataclass(frozen=True, kw_only=True)
class Program:
    """An independent program and what its records are.

    Attributes
    ----------
    name : str
        Of the machines.
    differences : tuple of str
        That can be switched off.
    make : callable
        Job -> signal [shape=(n_channels, n_samples)], manifest values.
    columns : tuple of str
        Further manifest columns, the severity first.
    head : mapping
        Attributes of the file: rate, channels, tacho, limits.
    n_samples : int
        Of a record.
    """

    name: str
    differences: tuple[str, ...]
    make: Callable[[Job], tuple[np.ndarray, dict[str, float]]]
    columns: tuple[str, ...]
    head: Mapping[str, Any]
    n_samples: int


def write_records(
    program: Program,
    path: Path,
    n: int,
    *,
    seed: int,
    on: frozenset[str],
    healthy: int = 0,
) -> Path:
    """Make a data set unless it is there; an unfinished one is gone on with.

    Parameters
    ----------
    program : Program
    path : Path
    n : int
        Records, two of each machine.
    seed : int
        Decides machines and conditions.
    on : frozenset of str
        Differences.
    healthy : int
        Instead of the worn records, so many healthy ones of each of their machines.
    """
    if path.exists():
        return path
    per_machine = healthy or RECORDS_PER_MACHINE
    count = -(-n // RECORDS_PER_MACHINE) * healthy if healthy else n
    head = Attributes(
        origin="simulated",
        severities=program.columns[:1],
        scene=f'name = "{program.name}"\ndifferences = {json.dumps(sorted(on))}\n',
        seed=seed,
        **program.head,
    )
    columns = {"group_name": "S48", **dict.fromkeys(program.columns, "<f8")}
    path.parent.mkdir(parents=True, exist_ok=True)
    with DataSetWriter(
        path, head, n_records=count, n_samples=program.n_samples, columns=columns
    ) as writer:
        for index in np.flatnonzero(~writer.done):
            job = Job(
                seed=seed,
                machine=int(index) // per_machine,
                record=int(index),
                healthy=healthy > 0,
                on=on,
            )
            signal, values = program.make(job)
            row = {**identity(program, job), **values, **grade(head, values)}
            writer.write(int(index), signal, row)
        writer.finish()
    return path


def identity(program: Program, job: Job) -> dict[str, Any]:
    """Names of a record and its machine."""
    return {
        "record_id": f"{'new' if job.healthy else 'worn'}{job.record:06d}",
        "group": job.machine,
        "group_name": f"{program.name}, seed {job.seed}, {job.machine}",
        "seed": job.record,
        "status": "ok",
    }


def grade(head: Attributes, values: Mapping[str, float]) -> dict[str, int]:
    """Wear grade of a record by its severity."""
    return {"grade": int(grades_of(values[head.severities[0]], head.grade_edges))}
