"""The feature sets of the catalogue: standard, core and complete.

Their rows are in :mod:`.catalogue.standard_rows`, :mod:`.catalogue.core_rows` and
:mod:`.catalogue.complete_rows`.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, get_args

from .complete_rows import COMPLETE_ROWS
from .core_rows import CORE_ROWS
from .feature import Feature
from .orbit_rows import ORBIT_CATALOGUE
from .standard_rows import CATALOGUE, CYLINDER_CATALOGUE, TEST_CATALOGUE

SetName = Literal["standard", "core", "complete"]

_STANDARD = (*CATALOGUE, *ORBIT_CATALOGUE, *TEST_CATALOGUE, *CYLINDER_CATALOGUE)

SETS: Mapping[SetName, tuple[Feature, ...]] = MappingProxyType(
    {
        "standard": _STANDARD,
        "core": (*_STANDARD, *CORE_ROWS),
        "complete": (*_STANDARD, *CORE_ROWS, *COMPLETE_ROWS),
    }
)
"""Rows of each set: default for training, all that is fast to compute, and everything."""


def smallest_set(feature: Feature) -> SetName:
    """Smallest set that contains a feature.

    Examples
    --------
    >>> smallest_set(CATALOGUE[0]), smallest_set(COMPLETE_ROWS[0])
    ('standard', 'complete')
    """
    return next(name for name in get_args(SetName) if feature in SETS[name])
