"""Plausible sample rates: one check for every function that takes one.

It imports the standard library only.
"""

RATE_LEAST, RATE_MOST = 1e-3, 1e8
"""Plausible sample rates [Hz]: from one level every quarter of an hour to acoustic emission. A
value beyond them has a wrong unit or exponent."""


def rate_fault(fs: float) -> str:
    """Message about an implausible sample rate; empty if the rate is plausible.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].

    Examples
    --------
    >>> rate_fault(8e98)
    'fs = 8e+98 Hz must be >= 0.001 Hz and <= 1e+08 Hz; give the sample rate'
    """
    if RATE_LEAST <= fs <= RATE_MOST:
        return ""
    return (
        f"fs = {fs} Hz must be >= {RATE_LEAST:g} Hz and <= {RATE_MOST:g} Hz; give the sample rate"
    )


def check_rate(fs: float) -> None:
    """Refuse an implausible sample rate.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].

    Raises
    ------
    ValueError
        If it is below 1 mHz, above 100 MHz, or not a number.
    """
    if fault := rate_fault(fs):
        raise ValueError(fault)
