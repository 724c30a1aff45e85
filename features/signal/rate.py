"""Sample rates that are believed: one check for every function that takes one.

Of the standard library only.
"""

RATE_LEAST, RATE_MOST = 1e-3, 1e8
"""Sample rates [Hz]: a level every quarter of an hour, acoustic emission. Beyond them a unit or an
exponent has slipped."""


def rate_fault(fs: float) -> str:
    """What is wrong with a sample rate; empty where nothing is.

    Parameters
    ----------
    fs : float
        [Hz]

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
    """Refuse a sample rate that is not believed.

    Parameters
    ----------
    fs : float
        [Hz]

    Raises
    ------
    ValueError
        It is below 1 mHz, above 100 MHz, or no number.
    """
    if fault := rate_fault(fs):
        raise ValueError(fault)
