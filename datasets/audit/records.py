"""Duplicate signals: copies, overlapping windows, copies with a little noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from ...sim.output.recording import Recording
from ..file.record import DataSet
from ..workers.local import in_order
from .table import Float, usable_records

Hashes = NDArray[np.uint64]

ANCHORS = 128
"""Number of remembered positions in a record. A tenth of a record holds 13 of them on average; a
copy is missed if two records share fewer than `AGREEING`."""

AGREEING = 3
"""Anchors that must agree at one shift before two records are compared sample by sample."""

LEFT_OVER = 3e-3
"""Largest share of the energy by which a copy may differ: -25 dB."""

_WINDOW = 64  # samples whose rises and falls form one number
_LEAST_TURNS = 12  # of these, or else the pattern is too simple to mark a position
_COMMON = 50  # records with a pattern before it is attributed to the machine
_BUCKETS = 256  # numbers of a sketch; correlations are good to 1 / sqrt(256)
_CLOSE = 4.0  # times the energy left over, to allow for the sketch's own error
_CANDIDATES = 5_000  # largest number of pairs compared sample by sample
_FEWEST_SHARED = 256  # samples, four windows: less is a coincidence
_BATCH = 16  # records that a worker reads at a time
_BLOCK = 1024  # sketches compared at a time

MEASURES: dict[str, Callable[[Float], Float]] = {
    "mean": lambda x: x.mean(axis=1),
    "rms": lambda x: np.sqrt((x**2).mean(axis=1)),
    "smallest": lambda x: x.min(axis=1),
    "largest": lambda x: x.max(axis=1),
}
"""Statistics of every channel, audited like the columns of a table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sketches:
    """Data kept of each usable record of a data set.

    Attributes
    ----------
    records : numpy.ndarray [shape=(n,)]
        Record numbers.
    hashes, places : numpy.ndarray [shape=(n, ANCHORS)]
        Pattern of the first channel, and the sample at which it begins; place -1 if there are no
        more.
    outline : numpy.ndarray [shape=(n, 256)]
        Random projection of the differences of the first channel, of unit energy on average; zero
        for a constant signal.
    names : tuple of str
        Names of the columns of `measures`.
    measures : numpy.ndarray [shape=(n, n_measures)]
        `MEASURES` of every channel but the tacho.
    """

    records: NDArray[np.intp]
    hashes: Hashes
    places: NDArray[np.int64]
    outline: Float
    names: tuple[str, ...]
    measures: Float


@dataclass(frozen=True, kw_only=True)
class Copy:
    """Two records that share samples.

    Attributes
    ----------
    first, second : (int, int)
        Number of the data set, and record in it.
    shift : int
        Sample of the first at which the second begins; may be negative.
    share : float
        Share of the shorter record's samples.
    exact : bool
        True if the samples are equal; otherwise equal except for gain, offset and a little noise.
    """

    first: tuple[int, int]
    second: tuple[int, int]
    shift: int
    share: float
    exact: bool


def sketch(
    data: DataSet, *, jobs: int = 1, progress: Callable[[int, int], None] | None = None
) -> Sketches:
    """Read every usable record once and keep the data needed to find copies.

    Parameters
    ----------
    data : DataSet
        Data set of any size; a batch of records is in memory at a time.
    jobs : int
        Worker processes; the result does not depend on it.
    progress : callable, optional
        Called with (records done, records).

    Returns
    -------
    Sketches
        Sketches, 6 kB per record.

    Raises
    ------
    DataError
        If a record is damaged.
    """
    usable = usable_records(data)
    batches = [usable[i : i + _BATCH] for i in range(0, usable.size, _BATCH)]
    found: list[tuple[Hashes, NDArray[np.int64], Float, Float]] = []
    for part in in_order(partial(_batch, data), batches, jobs=jobs):
        found += part
        if progress is not None:
            progress(len(found), usable.size)
    channels = [c.name for c in data.attributes.channels if c.name != data.attributes.tacho]
    hashes, places, outline, measures = (np.array(column) for column in zip(*found, strict=True))
    return Sketches(
        records=usable,
        hashes=hashes,
        places=places,
        outline=outline,
        names=tuple(f"{channel} {measure}" for measure in MEASURES for channel in channels),
        measures=measures,
    )


def _batch(
    data: DataSet, records: NDArray[np.intp]
) -> list[tuple[Hashes, NDArray[np.int64], Float, Float]]:
    found = []
    for number in records:
        recording = data[int(number)]
        first = _first(recording)
        vibration = recording.vibration.astype(float)
        measures = np.concatenate([measure(vibration) for measure in MEASURES.values()])
        found.append((*anchors(first), outline(first), measures))
    data.close()
    return found


def _first(recording: Recording) -> NDArray[np.float32]:
    """The first channel but the tacho: a recording is cut or copied in all channels alike."""
    signal = recording.vibration if recording.vibration_names else recording.signal
    found: NDArray[np.float32] = signal[0]
    return found


def anchors(x: NDArray[np.float32]) -> tuple[Hashes, NDArray[np.int64]]:
    """Positions that a copy of a signal shares, whatever its gain, offset and cut.

    Parameters
    ----------
    x : numpy.ndarray [shape=(n_samples,)]

    Returns
    -------
    hashes : numpy.ndarray [shape=(ANCHORS,)]
        Mixed bits of which of 63 differences of neighbours are rises; the smallest of the record.
    places : numpy.ndarray [shape=(ANCHORS,)]
        Sample at which each pattern begins; -1 for none.

    Notes
    -----
    The smallest hashes are a sample of all patterns that another record with the same patterns
    selects too, because the order of the hashes depends on the patterns and not on their positions.
    Patterns that occur twice in the record are left out, since they do not mark a position.

    References
    ----------
    A. Z. Broder, "On the resemblance and containment of documents", Proc. Compression and
    Complexity of Sequences (1997) 21-29, doi:10.1109/SEQUEN.1997.666900.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal(4000).astype(np.float32)
    >>> whole, part = anchors(x), anchors(3 * x[2000:] + 1)
    >>> shared, i, j = np.intersect1d(whole[0], part[0], return_indices=True)
    >>> set((whole[1][i] - part[1][j]).tolist())
    {2000}
    """
    hashes = np.zeros(ANCHORS, dtype=np.uint64)
    places = np.full(ANCHORS, -1, dtype=np.int64)
    pattern = _ups(x)
    turns = np.bitwise_count(pattern ^ (pattern >> np.uint64(1)))
    telling = np.flatnonzero((turns >= _LEAST_TURNS) & (turns <= _WINDOW - _LEAST_TURNS // 2))
    mixed = _mixed(pattern[telling])
    # twice as many as are kept, so that those that occur twice can be left out
    lowest = np.argsort(mixed)[: 4 * ANCHORS] if mixed.size < 8 * ANCHORS else _lowest(mixed)
    unique, first, count = np.unique(mixed[lowest], return_index=True, return_counts=True)
    kept = np.flatnonzero(count == 1)[:ANCHORS]
    hashes[: kept.size] = unique[kept]
    places[: kept.size] = telling[lowest[first[kept]]]
    return hashes, places


def _lowest(mixed: Hashes) -> NDArray[np.intp]:
    return np.argpartition(mixed, 4 * ANCHORS)[: 4 * ANCHORS]


def _ups(x: NDArray[np.float32]) -> Hashes:
    """Bit k of element i is set if sample i + k + 1 is above sample i + k."""
    found = (x[1:] > x[:-1]).astype(np.uint64)
    width = 1
    while width < _WINDOW and found.size > width:
        found = found[:-width] | (found[width:] << np.uint64(width))
        width *= 2
    whole: Hashes = found if width == _WINDOW else found[:0]
    return whole


def _mixed(pattern: Hashes) -> Hashes:
    """Hash of 64 bits without collisions: the finalizer of SplitMix64."""
    z = pattern ^ (pattern >> np.uint64(30))
    z = z * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed: Hashes = z ^ (z >> np.uint64(31))
    return mixed


def outline(x: NDArray[np.float32]) -> Float:
    """Short random projection of a signal's differences, which preserves correlations.

    Parameters
    ----------
    x : numpy.ndarray [shape=(n_samples,)]

    Returns
    -------
    numpy.ndarray [shape=(256,)]
        Projection, scaled to unit energy of the differences; zero for a constant signal.

    Notes
    -----
    Differences are used because slow components of two recordings, such as shaft orders, are
    naturally correlated.

    References
    ----------
    M. Charikar, K. Chen and M. Farach-Colton, "Finding frequent items in data streams", Theoretical
    Computer Science 312 (2004) 3-15, doi:10.1016/S0304-3975(03)00400-6.

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal(40_000).astype(np.float32)
    >>> bool(abs(outline(x) @ outline(x) - 1) < 0.3)
    True
    """
    step = np.diff(x.astype(float))
    energy = float(step @ step)
    if energy == 0:
        return np.zeros(_BUCKETS)
    padded = np.zeros(-(-step.size // _BUCKETS) * _BUCKETS)
    padded[: step.size] = step * _signs(step.size)
    folded: Float = padded.reshape(-1, _BUCKETS).sum(axis=0) / np.sqrt(energy)
    return folded


@lru_cache(maxsize=1)
def _signs(n: int) -> NDArray[np.int8]:
    """The same random signs for all records of a length."""
    found: NDArray[np.int8] = np.random.default_rng(0).integers(0, 2, n, dtype=np.int8) * 2 - 1
    return found


def copies(sets: Sequence[DataSet], kept: Sequence[Sketches]) -> list[Copy]:
    """All pairs of records that share samples, within and between data sets.

    Parameters
    ----------
    sets : sequence of DataSet
        Data sets, read again if a pair is to be compared.
    kept : sequence of Sketches
        Sketches of each set.

    Returns
    -------
    list of Copy
        Pairs in rising order, each compared sample by sample; for n equal records, the first with
        each other one.
    """
    owner = [(k, int(record)) for k, part in enumerate(kept) for record in part.records]
    sums = [int(sets[k].manifest["signal_crc32"].iloc[record]) for k, record in owner]
    first_of: dict[int, int] = {}
    equal = [
        (first_of[value], number)
        for number, value in enumerate(sums)
        if first_of.setdefault(value, number) != number
    ]
    # of equal records, one is enough to search for others
    single = np.array(sorted(first_of.values()), dtype=np.intp)
    wanted: dict[tuple[int, int], int] = dict.fromkeys(equal, 0)
    for i, j, shift in [*_shifted(kept, single), *_level(kept, single)]:
        wanted.setdefault((i, j), shift)
    pairs = list(wanted.items())[:_CANDIDATES]
    found = (_compared(sets, owner[i], owner[j], shift) for (i, j), shift in pairs)
    return sorted((c for c in found if c is not None), key=lambda c: (c.first, c.second, c.shift))


def _shifted(kept: Sequence[Sketches], single: NDArray[np.intp]) -> list[tuple[int, int, int]]:
    """Pairs of records with several anchors in common at one shift."""
    hashes = np.concatenate([part.hashes for part in kept])[single]
    places = np.concatenate([part.places for part in kept])[single]
    there = places >= 0
    record = np.repeat(single, there.sum(axis=1))
    order = np.lexsort((record, hashes[there]))
    value, place, record = hashes[there][order], places[there][order], record[order]
    starts = np.flatnonzero(np.r_[True, value[1:] != value[:-1]])
    sizes = np.diff(np.r_[starts, value.size])
    found = []
    for start, size in zip(starts[sizes > 1], sizes[sizes > 1], strict=True):
        if size > _COMMON:
            continue
        a, b = np.triu_indices(size, 1)
        a, b = a + start, b + start
        found.append(np.c_[record[a], record[b], place[a] - place[b]])
    if not found:
        return []
    triples, count = np.unique(np.concatenate(found), axis=0, return_counts=True)
    strong = np.argsort(-count, kind="stable")
    strong = strong[count[strong] >= AGREEING]
    return [(int(i), int(j), int(shift)) for i, j, shift in triples[strong]]


def _level(kept: Sequence[Sketches], single: NDArray[np.intp]) -> list[tuple[int, int, int]]:
    """Pairs of records whose outlines are nearly equal or opposite, without a shift."""
    lines = np.concatenate([part.outline for part in kept])[single]
    lines = lines / np.maximum(np.linalg.norm(lines, axis=1, keepdims=True), 1e-300)
    found = []
    for start in range(0, len(lines), _BLOCK):
        likeness = np.abs(lines[start : start + _BLOCK] @ lines.T)
        a, b = np.nonzero(likeness > 1 - _CLOSE * LEFT_OVER / 2)
        later = b > a + start
        found += [
            (int(single[i + start]), int(single[j]), 0)
            for i, j in zip(a[later], b[later], strict=True)
        ]
    return found


def _compared(
    sets: Sequence[DataSet], one: tuple[int, int], two: tuple[int, int], shift: int
) -> Copy | None:
    """The pair compared sample by sample where they overlap; None if they differ there."""
    x, y = (_first(sets[k][record]) for k, record in (one, two))
    part_x, part_y = overlap(x, y, shift)
    if part_x.size < _FEWEST_SHARED:
        return None
    exact = bool(np.array_equal(part_x, part_y))
    if not exact and _left_over(part_x.astype(float), part_y.astype(float)) > LEFT_OVER:
        return None
    share = part_x.size / min(x.size, y.size)
    return Copy(first=one, second=two, shift=shift, share=share, exact=exact)


def overlap(
    x: NDArray[np.float32], y: NDArray[np.float32], shift: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Parts of two signals that overlap if the second begins at a sample of the first.

    Examples
    --------
    >>> x = np.arange(5, dtype=np.float32)
    >>> [part.tolist() for part in overlap(x, x, 3)]
    [[3.0, 4.0], [0.0, 1.0]]
    """
    here, there = x[max(shift, 0) :], y[max(-shift, 0) :]
    size = min(here.size, there.size)
    return here[:size], there[:size]


def _left_over(x: Float, y: Float) -> float:
    """Share of the energy of differences that no gain explains; 1 for a constant signal."""
    a, b = np.diff(x), np.diff(y)
    energy = float((a @ a) * (b @ b))
    return 1.0 - float(a @ b) ** 2 / energy if energy > 0 else 1.0


def pairs_in(
    found: Sequence[Copy], number: int, kept: Sketches
) -> tuple[list[Copy], NDArray[np.intp]]:
    """Copies within one data set, and their rows in its table.

    Parameters
    ----------
    found : sequence of Copy
        Copies of all sets.
    number : int
        Number of the set.
    kept : Sketches
        Sketches of the set.

    Returns
    -------
    mine : list of Copy
        Copies within this set.
    rows : numpy.ndarray [shape=(n_copies, 2)]
        Rows among the usable records.
    """
    row: Mapping[int, int] = {int(record): i for i, record in enumerate(kept.records)}
    mine = [copy for copy in found if copy.first[0] == copy.second[0] == number]
    rows = [(row[copy.first[1]], row[copy.second[1]]) for copy in mine]
    return mine, np.array(rows, dtype=np.intp).reshape(-1, 2)
