"""From a wear model and a labelled data set to its errors on machines that it has not seen."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...datasets.file.views import views_of
from ...datasets.file.writer import refuse_output
from ...sim.output.recording import html_table
from ..evaluation.evaluate import evaluate_model
from ..evaluation.figure import save_evaluation
from ..evaluation.protocol import one_split
from ..evaluation.text import score_lines
from ..feature_rows.feature_table import Progress
from ..wear_model.estimate import WearModel
from ..wear_model.file import load_model


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Evaluation:
    """Errors and coverage of a model on a data set, of :func:`wearstate.evaluate`.

    Attributes
    ----------
    model : WearModel
        What was judged.
    data : Path
        Labelled data set.
    result : dict
        Errors, coverage, baselines; see :func:`wearstate.diagnose.evaluation.evaluate.score`.
    seed : int
        Of the resamples.
    """

    model: WearModel
    data: Path
    result: dict[str, Any]
    seed: int = 0

    @property
    def text(self) -> str:
        """What ``wearstate evaluate`` prints."""
        return "\n".join(score_lines(self.result, self.model.card))

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a page, a picture or JSON, by the suffix.

        Parameters
        ----------
        path : str or Path
            ``.html``, ``.png``, ``.svg``, ``.pdf`` or ``.json``.
        force : bool
            Replace an existing file.

        Raises
        ------
        DataError
            The file exists, or its folder does not.
        """
        file = Path(path).absolute()
        refuse_output(file, force)
        whole = one_split(self.result, self.model, self.data, self.seed)
        save_evaluation(whole, file, notice=self.model.notice, force=force)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<Evaluation of {self.model.card.severity} on {self.data.name}>"

    def _repr_html_(self) -> str:
        return html_table(
            repr(self)[1:-1], ("result",), [(line,) for line in self.text.split("\n")]
        )


def evaluate(
    model: WearModel | str | Path,
    data: str | Path,
    *,
    trained_on: str | Path | None = None,
    baseline: str | Path | None = None,
    split: str | None = None,
    joined: Sequence[str] = (),
    quick: bool = False,
    cache: Path | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Evaluation:
    """Judge a wear model on machines that it has not seen, beside baselines.

    Parameters
    ----------
    model : WearModel, str or Path
        A model or its file.
    data : str or Path
        Labelled data set. Where it is the training set, only what was held out is used.
    trained_on : str or Path, optional
        Training set of the model, for the baselines.
    baseline : str or Path, optional
        Healthy records of the same machines, for a model that needs them.
    split : str, optional
        A split that the data set holds: all of its test side is judged.
    joined : sequence of str
        ``NAME=FILE`` of data sets that complete the records, as the model needs them.
    quick : bool
        Leave out the baselines that need packages of others.
    cache : Path, optional
        Folder in which features of such packages are kept.
    seed : int
        Of the resamples, and of the baselines.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    Evaluation
        Its ``result`` is a mapping, ``text`` what the command prints.

    Raises
    ------
    DataError
        The wear is not labelled, the features are others, or no machine is unseen.
    ModelError
        The file cannot be used.

    Examples
    --------
    >>> import wearstate
    >>> found = wearstate.evaluate("pump.wsm", "pump.h5", quick=True)
    >>> found, found.text[:12]
    (<Evaluation of diametral_clearance_crankpin_m on pump.h5>, 'Evaluated on')
    """
    known = model if isinstance(model, WearModel) else load_model(model)
    result = evaluate_model(
        known,
        data,
        views=views_of(joined),
        trained_on=trained_on,
        healthy=baseline,
        split=split,
        quick=quick,
        cache=cache,
        jobs=jobs,
        seed=seed,
        progress=progress,
    )
    return Evaluation(model=known, data=Path(data), result=result, seed=seed)
