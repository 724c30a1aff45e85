"""Classes and namings in words."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from .train import Naming


def classes_text(result: Mapping[str, Any]) -> list[str]:
    """An evaluation as lines for a terminal.

    Parameters
    ----------
    result : mapping
        From :func:`score_votes`.

    Returns
    -------
    list of str
    """
    right, of = result["recordings_right"], result["recordings_judged"]
    low, high = (100 * end for end in result["recordings_interval"])
    promised = ", ".join(f"{v:.2f} {name}" for name, v in result["nominal_coverage"].items())
    lines = [
        f"Evaluated on recordings left out of the fit: {right} of {of} named correctly "
        f"(95 % interval {low:.0f} to {high:.0f} %)",
        f"  record accuracy  {_between(result, 'accuracy')}; the largest class alone is "
        f"{result['majority']:.2f}",
        f"  set coverage     {_between(result, 'coverage')} (promised {promised})",
        f"  set size         {_between(result, 'mean_set_size')}",
        f"  refused          {_between(result, 'called_unfamiliar')} of them, as unfamiliar",
        "  named            " + " ".join(f"{name:>10}" for name in result["classes"]),
    ]
    for name, row in zip(result["classes"], result["confusion"], strict=True):
        judged = "" if name in result["judged"] else "  (too few recordings to evaluate)"
        lines.append(f"    {name:15}" + " ".join(f"{count:10d}" for count in row) + judged)
    return [*lines, "  brackets         95 % intervals over recordings"]


def _between(result: Mapping[str, Any], name: str) -> str:
    low, high = result["intervals"][name]
    return f"{result[name]:.2f} [{low:.2f}, {high:.2f}]"


def namings_summary(namings: Sequence[Naming]) -> str:
    """Number of recordings, and the conditions found in them.

    Parameters
    ----------
    namings : sequence of Naming

    Examples
    --------
    >>> strange = Naming(verdict="unfamiliar", shares={})
    >>> namings_summary([strange, strange])
    'no condition is named, 2 recordings: 2 unfamiliar'
    """
    words = Counter(naming.name or naming.verdict for naming in namings)
    counts = ", ".join(f"{count} {word}" for word, count in words.most_common())
    none = "" if any(naming.name for naming in namings) else "no condition is named, "
    return f"{none}{len(namings)} recordings: {counts}"


def naming_text(naming: Naming) -> str:
    """Result of a model for one recording, as lines.

    Parameters
    ----------
    naming : Naming

    Examples
    --------
    >>> told = Naming(verdict="named", name="a", possible=("a", "b"), shares={"a": 0.8, "b": 0.2})
    >>> print(naming_text(told))
    a; cannot be excluded: a, b
      votes  a 0.80, b 0.20
    """
    cautions = "".join(f"\n  caution: {text}" for text in naming.cautions)
    if naming.verdict != "named":
        return f"{naming.verdict}: {'; '.join(naming.reasons)}{cautions}"
    votes = ", ".join(f"{name} {share:.2f}" for name, share in naming.shares.items())
    known = ""
    if naming.p_value is not None and naming.p_limit is not None:
        known = (
            f"\n  familiar: p = {naming.p_value:.2g} (unfamiliar at {naming.p_limit:.2g} or less)"
        )
    possible = ", ".join(naming.possible)
    return f"{naming.name}; cannot be excluded: {possible}\n  votes  {votes}{known}{cautions}"
