"""From a wear model and a labelled data set to its errors on unseen machines."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...datasets.audit.integrity import refuse_wrong_labels
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
    """Errors and coverage of a model on a data set, from :func:`wearstate.evaluate`.

    Attributes
    ----------
    model : WearModel
        Model that was judged.
    data : Path
        Labelled data set.
    result : dict
        Errors, coverage, baselines; see :func:`wearstate.diagnose.evaluation.evaluate.score`.
    seed : int
        Seed of the resamples.
    """

    model: WearModel
    data: Path
    result: dict[str, Any]
    seed: int = 0

    @property
    def text(self) -> str:
        """Text as printed by ``wearstate evaluate``."""
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
            If the file exists, or its folder does not.
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
    """Judge a wear model on unseen machines, in comparison with baselines.

    Parameters
    ----------
    model : WearModel, str or Path
        A model or its file.
    data : str or Path
        Labelled data set. If it is the training set, only the held-out part is used.
    trained_on : str or Path, optional
        Training set of the model, for the baselines.
    baseline : str or Path, optional
        Healthy records of the same machines, for a model that needs them.
    split : str, optional
        Split stored in the data set: its whole test side is judged.
    joined : sequence of str
        ``NAME=FILE`` of data sets that complete the records, as the model needs them.
    quick : bool
        Leave out the baselines that need third-party packages.
    cache : Path, optional
        Folder for features computed by such packages.
    seed : int
        Seed of the resamples, and of the baselines.
    jobs : int
        Worker processes for the features.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    Evaluation
        Its ``result`` is a mapping, ``text`` the output of the command.

    Raises
    ------
    DataError
        If the wear is not labelled, or labels contradict grades, limits or recipe; if the features
        differ, or no machine is unseen.
    ModelError
        If the model file cannot be used.

    Examples
    --------
    >>> import wearstate
    >>> found = wearstate.evaluate("pump.wsm", "pump.h5", quick=True)
    >>> found, found.text[:12]
    (<Evaluation of diametral_clearance_crankpin_m on pump.h5>, 'Evaluated on')
    """
    refuse_wrong_labels(data)
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
