"""Sags of a line whose films may rupture differently from its scene.

The rupture condition of a real film is unknown: zero pressure and slope (``periodic``), or
truncation of negative pressure (``guembel``). Both are evaluated, and the results are weighted by
how well they explain the measurements.

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
"""Possible rupture conditions of the films of a shaft line."""

_NEAR = 2.0  # standard deviations between a reaction and zero


def estimate_over_films(
    scene: ShaftScene,
    transfers: Sequence[MeasuredTransfer] = (),
    measured: MeasuredReactions | None = None,
    *,
    prior: Prior | None = None,
) -> SagPosterior:
    """Posterior of the sags over the rupture conditions, with equal prior probabilities.

    Parameters
    ----------
    scene, transfers, measured, prior
        As in :func:`.shaft_tests.sags.estimate_sags`.

    Returns
    -------
    SagPosterior
        Mean and covariance of the mixture, everything else for the likelier condition; ``films``
        holds the probabilities. Reactions alone involve no film: then as in the scene.

    Raises
    ------
    SagError, ShaftFilmError
        As in :func:`.shaft_tests.sags.estimate_sags`, for the scene's own condition.

    Notes
    -----
    The evidence of a condition is ``exp(-cost / 2) sqrt(det spread)``, by Laplace's method and up
    to a factor common to all conditions.
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
    """Mixture of posteriors, weighted by their evidence.

    Parameters
    ----------
    found : dict
        Condition -> posterior; at least one.
    """
    evidence = np.array([_evidence(one) for one in found.values()])
    share = np.exp(evidence - evidence.max())
    share /= share.sum()
    best = list(found.values())[int(np.argmax(share))]
    means = np.array([one.mean for one in found.values()])
    mean = share @ means
    offsets = means - mean
    within = np.tensordot(share, [one.covariance for one in found.values()], axes=1)
    between = np.einsum("c,ca,cb->ab", share, offsets, offsets)
    films = dict(zip(found, share.tolist(), strict=True))
    return replace(best, mean=mean, covariance=within + between, films=films)


def _evidence(found: SagPosterior) -> float:
    """Logarithm of the evidence, up to a common constant."""
    volume = np.linalg.slogdet(found.spread / np.outer(found.scale, found.scale))[1]
    return float(-found.misfit * found.freedom + volume) / 2


def nearly_unloaded(scene: ShaftScene, found: SagPosterior) -> tuple[str, ...]:
    """Bearings that may be unloaded at the estimated sags, so that two sags explain one test.

    Parameters
    ----------
    scene : ShaftScene
    found : SagPosterior

    Returns
    -------
    tuple of str
        Bearings whose reaction is less than two standard deviations above zero.

    Notes
    -----
    A film responds to the size of its load, whatever the direction: transfer functions hardly
    distinguish a journal pressed down lightly from one pressed up as lightly.
    """
    line = alignment_line(scene)
    line = line.moved({name: -sag for name, sag in zip(found.bearings, found.mean, strict=True)})
    state = reactions(line)
    own = [line.seat(name) for name in found.bearings]
    slopes = influence(line, state)[own]  # by the sags (k, n)
    deviation = np.sqrt(np.einsum("an,ab,bn->n", slopes, found.covariance, slopes))
    near = state.reactions < _NEAR * deviation
    return tuple(name for name, flag in zip(line.names, near, strict=True) if flag)
