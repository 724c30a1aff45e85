"""Panel of transfer functions from a measured force: level with confidence, phase, coherence."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...features.catalogue.analysis import FORCE
from ...features.catalogue.row import FEWEST_SAMPLES
from ...features.response import frf, transfer
from ...features.signal.spectrum import decibel
from ..pages.page import short_name
from .panel import COLOURS, LackError, Panel, first_rows, name_inside, refuse_short, stack
from .view import Trace, View, number

_BLOCKS = 10  # whole blocks in a continuous force, overlapped by half
_FINEST_HZ = 0.25  # between lines
_DEPTH_DB = 20.0  # shown of a confidence disc that includes zero
_CONFIDENCE = 0.95
_SHOWN_SHARE = 1 / 2.56  # of the sample rate; above lies the slope of the anti-alias filter


def frf_panel(view: View) -> Panel:
    """Level with confidence, phase and coherence of each response to the force."""
    force = view.excitation
    if force is None:
        count = sum(channel.quantity == FORCE for channel in view.recording.vibration_channels)
        raise LackError(f"needs a force channel, has {count} in N; name the one that excites")
    responses, others = first_rows([trace for trace in view.motions if trace.name != force.name])
    if not responses:
        raise LackError("needs a response besides the force; record one")
    refuse_short(view, FEWEST_SAMPLES)
    rows = np.stack([trace.values for trace in responses])
    spectra, words = _averaged(force.values, rows, view.rate, view.exponential)
    # the line at 0 Hz holds the drift of the sensors, the last lines the anti-alias filter
    kept = spectra.between(float(spectra.frequency[1]), _SHOWN_SHARE * view.rate)
    estimate = _estimate(kept)
    return Panel(
        kind="frf",
        caption=(
            f"Transfer function over {force.name}: H1 of {words}, lines of "
            f"{number(float(spectra.frequency[1]))} Hz"
            + (f"; shaded: {100 * _CONFIDENCE:.0f} % confidence" if kept.blocks > 1 else "")
            + others
        ),
        height=3.6 * len(responses) + 0.6,
        draw=partial(_draw_frf, responses=responses, force=force, estimate=estimate),
    )


def _averaged(
    force: NDArray[np.float32], responses: NDArray[np.float32], fs: float, last: float
) -> tuple[frf.Spectra, str]:
    """Spectra of a hammer's blows or of a continuous force, and text about the averages."""
    longest = min(force.size / _BLOCKS, fs / _FINEST_HZ)
    nperseg = 1 << int(np.log2(max(longest, 8)))
    return transfer.excited_spectra(force, responses, fs, nperseg=nperseg, last=last)


def _estimate(spectra: frf.Spectra) -> frf.Frf:
    """H1 with its confidence, which is unknown for one blow."""
    if spectra.blocks > 1:
        return frf.estimate_frf(spectra, confidence=_CONFIDENCE)
    unknown = np.full(spectra.response.shape, np.nan)
    return frf.Frf(
        frequency=spectra.frequency,
        value=frf.h1(spectra),
        coherence=unknown,
        radius=np.zeros(spectra.response.shape),
        averages=spectra.averages,
        estimator="h1",
        confidence=_CONFIDENCE,
        decay=spectra.decay,
    )


def _draw_frf(place: Any, *, responses: Sequence[Trace], force: Trace, estimate: frf.Frf) -> None:
    axes = stack(place, 3 * len(responses), height_ratios=[3, 1.3, 1.3] * len(responses))
    x = estimate.frequency
    low, high = estimate.magnitude_interval
    known = bool(np.isfinite(estimate.coherence).all())
    for i, trace in enumerate(responses):
        colour = COLOURS[i % len(COLOURS)]
        level, phase, share = axes[3 * i : 3 * i + 3]
        value = decibel(np.abs(estimate.value[i]) ** 2)
        # a disc that includes zero has no lower bound
        floor = np.maximum(decibel(low[i] ** 2), value - _DEPTH_DB)
        if known:
            level.fill_between(x, floor, decibel(high[i] ** 2), color=colour, alpha=0.3, lw=0)
        level.plot(x, value, lw=0.8, color=colour, label=short_name(trace.name))
        level.set_ylabel(f"[dB re 1 {_ratio(trace, force)}]", fontsize=8)
        name_inside(level, trace)
        angle = np.angle(estimate.value[i], deg=True)
        phase.plot(x, angle, ".", ms=1.5, color=colour)
        phase.set(ylim=(-190, 190), yticks=[-180, -90, 0, 90, 180])
        phase.set_ylabel("phase\n[deg]", fontsize=8)
        if known:
            share.plot(x, estimate.coherence[i], lw=0.8, color=colour)
        else:
            share.text(0.5, 0.5, "one blow: not defined", transform=share.transAxes, ha="center")
        share.set(ylim=(0, 1.05))
        share.set_ylabel("coherence\n[-]", fontsize=8)
    axes[-1].set_xlabel("frequency [Hz]")


def _ratio(trace: Trace, force: Trace) -> str:
    above = f"({trace.unit})" if set(trace.unit) & set("/ ") else trace.unit
    return f"{above}/{force.unit}"
