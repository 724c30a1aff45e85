"""What gives work out and takes it back: here or on a cluster, the same."""

from typing import Any, Protocol

AHEAD_PER_JOB = 2
"""Items handed out and not yet taken back, per worker; bounds the memory of a run."""


class WorkersError(RuntimeError):
    """Workers were lost; names which, why, and the cure. The input is not at fault."""


class Pool(Protocol):
    """Takes work and gives results back, oldest first."""

    def submit(self, item: Any) -> None:
        """Hand out one more item."""

    def take(self) -> Any:
        """Wait for the oldest result; raises what the function raised, or WorkersError."""

    @property
    def waiting(self) -> int:
        """Items handed out and not taken back."""

    @property
    def most(self) -> int:
        """Items to hand out at most."""


def first_line(error: BaseException) -> str:
    r"""First line of what an error says, or its name.

    Examples
    --------
    >>> first_line(ValueError("one\ntwo")), first_line(KeyError())
    ('one', 'KeyError')
    """
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
