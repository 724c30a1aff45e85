"""Interactive trends for a page: estimates over time, and the recording behind each."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

from ..pages.points import DrawnLine, Mark, PointAxes, Series
from .batch import Batch, BatchRow
from .trend import Trend

_MS = 3_600_000.0  # in an hour
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def trend_points(batch: Batch, machine: str, heading: str) -> PointAxes:
    """Axes of one machine's trend.

    Parameters
    ----------
    batch : Batch
    machine : str
        Key in the batch's trends.
    heading : str
        Heading of the machine.

    Returns
    -------
    PointAxes
    """
    trend, limits = batch.trends[machine], batch.limits
    factor = 1.0 if trend.clock == "operating" else _MS
    limit = 1e3 * limits["condemning_limit_m"]
    rows = [row for row in batch.rows if row.machine == machine]
    marks = tuple(_mark(row, factor, trend) for row in rows if _is_drawn(row))
    ahead = tuple((factor * trend.ahead_h).tolist())
    lines: tuple[DrawnLine, ...] = ()
    if ahead:
        y = tuple((1e3 * trend.line).tolist())
        lines = (DrawnLine(name="trend", x=ahead, y=y, colour="#1f5a94"),)
    return PointAxes(
        title=heading,
        x_name="operating hours [h]" if trend.clock == "operating" else "date (UTC)",
        y_name=_quantity(limits),
        x_kind="linear" if trend.clock == "operating" else "datetime",
        series=(
            Series(
                name=f"estimate, {100 * trend.coverage:.3g} % interval",
                marks=marks,
                colour="#1c232b",
            ),
        ),
        lines=lines,
        band=_band(trend, ahead) if ahead else (),
        band_name=f"{100 * trend.coverage:.3g} % band of the trend",
        level=(f"condemning limit {limit:.3g} mm", limit),
        moments=tuple((factor * trend.maintenances_h).tolist()),
        moments_name="maintenance",
    )


def _quantity(limits: Mapping[str, Any]) -> str:
    return f"{limits['quantity'].split(',')[0]} [mm]"


def _band(trend: Trend, ahead: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    low, high = (tuple((1e3 * line).tolist()) for line in (trend.line_low, trend.line_high))
    return ahead, low, high


def _is_drawn(row: BatchRow) -> bool:
    """Whether a row has a time, an estimate and its interval, as the trend requires."""
    return None not in row.point


def _mark(row: BatchRow, factor: float, trend: Trend) -> Mark:
    hours, value, low, high = (float(number or 0.0) for number in row.point)
    when = f"{hours:.6g} h" if trend.clock == "operating" else _date(hours)
    lines = [
        f"recording: {row.name}",
        f"time: {when}",
        f"estimate: {1e3 * value:.3f} mm ({1e3 * low:.3f} to {1e3 * high:.3f})",
        f"verdict: {row.headline}",
    ]
    if row.note:
        lines.append(row.note)
    text = "\n".join(lines)
    return Mark(
        x=factor * hours, y=1e3 * value, low=1e3 * low, high=1e3 * high, hover=text, block=text
    )


def _date(hours: float) -> str:
    return f"{_EPOCH + timedelta(hours=hours):%Y-%m-%d %H:%M} UTC"
