"""Transfer functions of the healthy machine, as reference of later tests."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...datasets.file.record import DataSet
from ...features.catalogue.analysis import STANDARD, Analysis
from ...features.response.modal_model import Modes
from ...features.response.transfer import FrfReference
from ...sim.output.recording import Recording
from ..feature_rows.feature_table import FeatureSelection, recording_analysis


def transfer_reference(
    recordings: Iterable[Recording], *, modes: bool = False
) -> FrfReference | None:
    """Mean transfer functions of healthy recordings of one machine.

    Parameters
    ----------
    recordings : iterable of Recording
        Tests with the same forces and responses; only impact tests with the block length of the
        first are averaged.
    modes : bool
        Whether to fit the modes of the mean as well.

    Returns
    -------
    FrfReference or None
        None if no recording is a test.
    """
    tests = [recording_analysis(recording, STANDARD) for recording in recordings]
    known = [test for test in tests if test is not None]
    if not known:
        return None
    first = known[0].transfer_functions
    alike = [
        test.transfer_functions
        for test in known
        if np.array_equal(test.transfer_functions.frequency, first.frequency)
    ]
    whole = replace(
        first,
        value=np.mean([each.value for each in alike], axis=0),
        coherence=np.mean([each.coherence for each in alike], axis=0),
        averages=sum(each.averages for each in alike),
    )
    fitted = _modes(known[0], whole) if modes else None
    return FrfReference(whole.frequency, whole.value, fitted)


_OF_MODES = (
    *("mode_changes", "resonance_shift", ".frequency_shift", ".shift_deviation"),
    *(".damping_change", ".level_change_db", ".mac"),
)
_OF_FUNCTIONS = ("frf_assurance", ".frf.assurance", *_OF_MODES)


def told_against_modes(choice: FeatureSelection) -> bool:
    """Whether a feature of a choice is relative to the modes of a reference.

    Examples
    --------
    >>> told_against_modes(FeatureSelection(only=("mode_changes",)))
    True
    """
    if choice.only is None:
        return choice.feature_set == "complete"
    return any(part in name for name in choice.only for part in _OF_MODES)


def told_against(choice: FeatureSelection) -> bool:
    """Whether a feature of a choice is relative to a reference, given a force.

    Examples
    --------
    >>> told_against(FeatureSelection()), told_against(FeatureSelection(feature_set="core"))
    (False, True)
    """
    if choice.only is None:
        return choice.feature_set != "standard"
    return any(part in name for name in choice.only for part in _OF_FUNCTIONS)


def _modes(test: Analysis, whole: Any) -> Modes:
    """Modes of the mean functions; empty if no pole is stable."""
    found = test.modes_of(whole)
    if found is not None:
        return found
    empty, paths = np.zeros(0), len(test.modal_paths)
    nothing = np.zeros((paths, 0))
    return Modes(
        frequency=empty,
        damping_ratio=empty,
        residue=nothing.astype(np.complex128),
        lower=np.zeros(paths, dtype=np.complex128),
        upper=np.zeros(paths, dtype=np.complex128),
        quantity=test.modal_quantity,
        frequency_deviation=empty,
        damping_deviation=empty,
        residue_deviation=nothing,
        fit_error=np.zeros(paths),
    )


@dataclass(frozen=True, kw_only=True)
class HealthyTransfer:
    """Reference of each machine of a healthy data set, computed on first use.

    Attributes
    ----------
    path : Path
        Data set of healthy records.
    modes : bool
        As in :func:`transfer_reference`.
    """

    path: Path
    modes: bool
    _found: dict[str, FrfReference | None] = field(default_factory=dict, repr=False, compare=False)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle without the references: a worker process computes those it needs."""
        return partial(HealthyTransfer, path=self.path, modes=self.modes), ()

    def of(self, machine: str) -> FrfReference | None:
        """Reference of a machine; None if it has no healthy test."""
        if machine not in self._found:
            with DataSet(self.path) as data:
                mine = np.array(data.machines, dtype=str) == machine
                usable = np.flatnonzero(mine & (data.manifest["status"] == "ok").to_numpy())
                tests = (data[int(index)] for index in usable)
                self._found[machine] = transfer_reference(tests, modes=self.modes)
        return self._found[machine]


def healthy_transfer(
    path: str | Path | None, choices: Sequence[FeatureSelection]
) -> HealthyTransfer | None:
    """References of a healthy data set; None if no feature is relative to them.

    Parameters
    ----------
    path : str or Path, optional
        Data set of healthy records.
    choices : sequence of FeatureSelection
        Features.
    """
    if path is None or not any(told_against(choice) for choice in choices):
        return None
    return HealthyTransfer(path=Path(path), modes=any(map(told_against_modes, choices)))
