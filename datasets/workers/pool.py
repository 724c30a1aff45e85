"""Common interface of worker pools, local or on a cluster."""

from typing import Any, Protocol

AHEAD_PER_JOB = 2
"""Items submitted and not yet taken, per worker; bounds the memory of a run."""


class WorkersError(RuntimeError):
    """Workers were lost; names which, why, and the cure. The input is not the cause."""


class Pool(Protocol):
    """Takes items and returns results, oldest first."""

    def submit(self, item: Any) -> None:
        """Submit one more item."""

    def take(self) -> Any:
        """Wait for the oldest result; raises the error of the function, or WorkersError."""

    @property
    def waiting(self) -> int:
        """Number of items submitted and not taken."""

    @property
    def most(self) -> int:
        """Largest number of items to submit ahead."""


def first_line(error: BaseException) -> str:
    r"""First line of an error's message, or the name of its type.

    Examples
    --------
    >>> first_line(ValueError("one\ntwo")), first_line(KeyError())
    ('one', 'KeyError')
    """
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
