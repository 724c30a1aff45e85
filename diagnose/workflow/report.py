"""From a recording and a wear model to the verdict, as text, table and page."""

import html
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.file.writer import refuse_output
from ...datasets.measured.recording import read_recording
from ...sim.output.recording import DataError, Recording, Table
from ..healthy_reference.healthy import Baseline, Baselines
from ..nameplate.nameplate import Nameplate, nameplate_of
from ..pages.page import save_page
from ..report.batch import informed_estimate
from ..report.figures import draw_gauge
from ..report.page import report_html
from ..report.second_estimate import ModelOpinion
from ..report.text import report_text
from ..report.verdict import known_machine, model_table, report_table
from ..twin.opinion import TwinOpinion, second_opinion
from ..wear_model.estimate import WearModel
from ..wear_model.file import load_model
from ..wear_model.verdict import Estimate


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Report:
    """Verdict of a model on a recording, from :func:`wearstate.report`.

    Attributes
    ----------
    recording : Recording
        Recording that was judged.
    model : WearModel
        Model that judged it.
    estimate : Estimate
        Verdict, wear [m] with its interval, grade.
    table : dict
        Full content of the report, ready for JSON.
    baseline : Baseline or None
        Healthy recordings of the machine.
    plate : Nameplate or None
        Known machine data besides the signals.
    """

    recording: Recording
    model: WearModel
    estimate: Estimate
    table: dict[str, Any]
    baseline: Baseline | None = None
    plate: Nameplate | None = None

    @property
    def text(self) -> str:
        """Text as printed by ``wearstate report``."""
        return report_text(self.table)

    def html(self, *, interactive: bool = False) -> str:
        """Self-contained page with pictures, optionally with curves to zoom and measure.

        Parameters
        ----------
        interactive : bool
            Add the curves.

        Returns
        -------
        str
            HTML.

        Raises
        ------
        DataError
            If Bokeh is not installed for an interactive page.
        """
        return report_html(
            self.table,
            self.recording,
            self.model,
            baseline=self.baseline,
            plate=self.plate,
            interactive=interactive,
        )

    def save(self, path: str | Path, *, force: bool = False, interactive: bool = False) -> None:
        """Write the page.

        Parameters
        ----------
        path : str or Path
            HTML file.
        force : bool
            Replace an existing file.
        interactive : bool
            Add the signals as curves to zoom and measure.

        Raises
        ------
        DataError
            If the file exists, its folder does not, or Bokeh is not installed for an interactive
            page.
        """
        file = Path(path).absolute()
        refuse_output(file, force)
        save_page(self.html(interactive=interactive), file, force=force)

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the estimate on the scale of grades, and every channel over time below it.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            Axes for the estimate and for each channel; a new figure by default.

        Returns
        -------
        numpy.ndarray of matplotlib.axes.Axes, shape (1 + n_channels,)
            The first shows only the verdict if no grade is given.

        Examples
        --------
        >>> import wearstate
        >>> found = wearstate.report(wearstate.simulate("bilge-pump"), "pump.wsm")
        >>> found.plot()[0].get_title()
        'Grade 0 of 3: as new'
        """
        if ax is None:
            from matplotlib import pyplot as plt

            rows = 1 + len(self.recording.channels)
            _, ax = plt.subplots(rows, figsize=(8.0, 1.2 + 1.3 * rows), layout="constrained")
        axes = np.ravel(ax)
        axes[0].set_title(self.table["headline"])
        if self.estimate.severity is None:
            axes[0].set_axis_off()
        else:
            draw_gauge(axes[0], self.table["estimate"], self.table["limits"])
        self.recording.plot(ax=axes[1:])
        return axes

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<Report on {self.recording.source or 'a recording'}: {self.table['headline']}>"

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"


def report(
    recording: Recording | str | Path | NDArray[Any] | Table,
    model: WearModel | str | Path,
    *,
    fs: float | None = None,
    baseline: str | Path | None = None,
    scene: str | None = None,
    values: Mapping[str, Any] | None = None,
    machine: str | None = None,
    twin: str | Path | None = None,
    also: WearModel | str | Path | None = None,
    seed: int = 0,
) -> Report:
    """Judge one recording: wear with an interval, grade and advice, or why there is none.

    Parameters
    ----------
    recording : Recording, str, Path, numpy.ndarray or pandas.DataFrame
        Recording; file that :func:`wearstate.read_recording` reads without options; array
        [shape=(n_channels, n_samples)] with the channels of the model in their order and units; or
        table with a column for each channel.
    model : WearModel, str or Path
        A model or its file.
    fs : float, optional
        Sample rate of an array or a table [Hz].
    baseline : str or Path, optional
        Data set of healthy recordings of the machine.
    scene : str, optional
        Nameplate of the machine: a built-in scene or a TOML file.
    values : mapping, optional
        Values by dotted path that replace the nameplate's, as ``{"load.static": "4 kN +- 5 %"}``.
    machine : str, optional
        Kind of machine, for its ISO zone.
    twin : str or Path, optional
        Calibrated scene of this machine, from :func:`wearstate.calibrate`, which gives a second
        wear estimate by simulation.
    also : WearModel, str or Path, optional
        A second wear model, trained on other assumptions, whose estimate is shown next to this one.
    seed : int
        Seed of the twin's draws, >= 0.

    Returns
    -------
    Report
        Its ``estimate`` holds the numbers, ``text`` is the output of the command, ``save`` writes
        the page.

    Raises
    ------
    DataError
        If the recording cannot be read or turned into features, an array has no rate or other
        channels than the model, or there is no such kind of machine.
    ModelError
        If the model file cannot be used.
    TypeError
        If recording and model are swapped.

    Examples
    --------
    >>> import wearstate
    >>> found = wearstate.report(wearstate.simulate("bilge-pump"), "pump.wsm")
    >>> found.save("report.html")
    >>> found.estimate.grade_name
    'as new'
    """
    known_machine(machine)
    if isinstance(model, Recording):
        raise TypeError("model = a recording must be a model or its file; recording comes first")
    known = model if isinstance(model, WearModel) else load_model(model)
    source = Path(recording) if isinstance(recording, str | Path) else None
    if isinstance(recording, str | Path):
        read = read_recording(recording)
    else:
        read = known.card.recording_of(recording, fs)
    usual = known.card.trained_on.scene
    return judged(
        read,
        known,
        baselines=None if baseline is None else Baselines(baseline, known.card),
        plate=nameplate_of(source, scene, values or {}, usual=usual),
        machine=machine,
        twin=None
        if twin is None
        else second_opinion(twin, read, wear=known.card.severity, seed=seed),
        also=also,
        files={"recording": source} if source else None,
    )


def judged(
    recording: Recording,
    model: WearModel,
    *,
    baselines: Baselines | None,
    plate: Nameplate | None,
    machine: str | None,
    twin: TwinOpinion | None = None,
    also: WearModel | str | Path | None = None,
    files: Mapping[str, Path] | None,
) -> Report:
    """Report on a recording with known machine data, all of it already read."""
    baseline = baselines.of(recording) if baselines else None
    estimate = informed_estimate(recording, model, baseline, plate)
    table = report_table(
        recording,
        model,
        estimate,
        machine=machine,
        baseline=baseline,
        plate=plate,
        twin=twin,
        other=None
        if also is None
        else _other_opinion(recording, model, estimate, also, plate, baselines),
        files=files,
    )
    return Report(
        recording=recording,
        model=model,
        estimate=_also_contradicted(estimate, table["estimate"]),
        table=table,
        baseline=baseline,
        plate=plate,
    )


def _other_opinion(
    recording: Recording,
    model: WearModel,
    first: Estimate,
    also: WearModel | str | Path,
    plate: Nameplate | None,
    baselines: Baselines | None,
) -> ModelOpinion:
    """Estimate of another model for a recording."""
    other = also if isinstance(also, WearModel) else load_model(also)
    wanted, found = model.card.severity, other.card.severity
    if found != wanted:
        raise DataError(f"also: its wear = {found} must be {wanted}, as of the model; name another")
    trained = other.card.trained_on
    if other.card == model.card:
        raise DataError(
            f"also: it is the same model of {trained.recipe or trained.scene}, must be another; "
            "name one that was trained on other assumptions"
        )
    healthy = Baselines(baselines.source, other.card).of(recording) if baselines else None
    estimate = informed_estimate(recording, other, healthy, plate)
    return ModelOpinion(
        trained_on=trained.recipe or trained.scene or "another training set",
        severity=estimate.severity,
        low=estimate.low,
        high=estimate.high,
        coverage=estimate.coverage,
        grade=estimate.grade,
        grade_name=estimate.grade_name,
        reasons=estimate.reasons,
        cautions=tuple(each for each in estimate.cautions if each not in first.cautions),
        origin=model_table(other, None if isinstance(also, WearModel) else Path(also)),
    )


def _also_contradicted(estimate: Estimate, said: Mapping[str, Any]) -> Estimate:
    """The estimate with the contradictions of the second estimates before its cautions."""
    return replace(estimate, verdict=said["verdict"], cautions=tuple(said["cautions"]))
