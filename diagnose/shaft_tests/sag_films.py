"""Sags of a line whose films may rupture otherwise than its scene says.

Where a film ends is not known of a machine: at no pressure and no slope (``periodic``), or where
the pressure of the whole film would fall below the atmosphere (``guembel``). Each is asked, and
their answers are weighted by how well they explain what was measured.

References
----------
MacKay (2003), Information Theory, Inference and Learning Algorithms, Cambridge, chapters 27 and 28,
for evidence by Laplace's method.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...sim.alignment.alignment import influence, reactions
from ...sim.scene.shaft import ShaftScene
from ...sim.shaft.line_alignment import alignment_line
from ...sim.shaft_films.status import ShaftFilmError
from .sag_model import MeasuredReactions, MeasuredTransfer, Prior, SagError
from .sags import SagPosterior, estimate_sags

CONDITIONS = ("periodic", "guembel")
"""How a film may rupture on a shaft line."""

_NEAR = 2.0  # deviations of a reaction from none


def estimate_over_films(
    scene: ShaftScene,
    transfers: Sequence[MeasuredTransfer] = (),
    measured: MeasuredReactions | None = None,
    *,
    prior: Prior | None = None,
) -> SagPosterior:
    """Posterior of the sags over the conditions of rupture, equally likely beforehand.

    Parameters
    ----------
    scene, transfers, measured, prior
        As of :func:`.shaft_tests.sags.estimate_sags`.

    Returns
    -------
    SagPosterior
        Mean and covariance of the mixture; all else of the likelier condition; ``films`` their
        probabilities. Reactions alone know no film: then as of the scene.

    Raises
    ------
    SagError, ShaftFilmError
        As of :func:`.shaft_tests.sags.estimate_sags`, of the scene's own condition.

    Notes
    -----
    The evidence of a condition is ``exp(-cost / 2) sqrt(det spread)``, by Laplace's method and up
    to a factor that all conditions share.
    """
    if not transfers or scene.film.rung != "direct":
        return estimate_sags(scene, transfers, measured, prior=prior)
    found = {}
    for condition in CONDITIONS:
        film = scene.film.model_copy(update={"condition": condition})
        other = scene.model_copy(update={"film": film})
        try:
            found[condition] = estimate_sags(other, transfers, measured, prior=prior)
        except (SagError, ShaftFilmError):
            if condition == scene.film.condition:
                raise
    return mixed(found)


def mixed(found: dict[str, SagPosterior]) -> SagPosterior:
    """Mixture of posteriors of one question, by their evidence.

    Parameters
    ----------
    found : dict
        Condition -> posterior; one or more.
    """
    evidence = np.array([_evidence(one) for one in found.values()])
    share = np.exp(evidence - evidence.max())
    share /= share.sum()
    best = list(found.values())[int(np.argmax(share))]
    means = np.array([one.mean for one in found.values()])
    mean = share @ means
    apart = means - mean
    within = np.tensordot(share, [one.covariance for one in found.values()], axes=1)
    between = np.einsum("c,ca,cb->ab", share, apart, apart)
    films = dict(zip(found, share.tolist(), strict=True))
    return replace(best, mean=mean, covariance=within + between, films=films)


def _evidence(found: SagPosterior) -> float:
    """Logarithm, up to a constant that all have."""
    volume = np.linalg.slogdet(found.spread / np.outer(found.scale, found.scale))[1]
    return float(-found.misfit * found.freedom + volume) / 2


def nearly_unloaded(scene: ShaftScene, found: SagPosterior) -> tuple[str, ...]:
    """Bearings that, by the sags found, may carry nothing: there two sags explain one test.

    Parameters
    ----------
    scene : ShaftScene
    found : SagPosterior

    Returns
    -------
    tuple of str
        Those whose reaction is less than two of its deviations from none, or is none.

    Notes
    -----
    A film answers the load it carries whichever way it acts: transfer functions tell a journal that
    is pressed down lightly hardly from one pressed up as lightly.
    """
    line = alignment_line(scene)
    line = line.moved({name: -sag for name, sag in zip(found.bearings, found.mean, strict=True)})
    state = reactions(line)
    own = [line.seat(name) for name in found.bearings]
    slopes = influence(line, state)[own]  # by the sags (k, n)
    deviation = np.sqrt(np.einsum("an,ab,bn->n", slopes, found.covariance, slopes))
    near = state.reactions < _NEAR * deviation
    return tuple(name for name, flag in zip(line.names, near, strict=True) if flag)
