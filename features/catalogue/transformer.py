"""The catalogue as a scikit-learn transformer: recordings or an array in, a named table out."""

from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils import Tags
from sklearn.utils.validation import check_is_fitted

from .analysis import STANDARD, Settings
from .catalogue import SetName
from .needs import struck
from .row import Recorded, feature_names, feature_row

Records = Sequence[Recorded] | ArrayLike
"""Recordings, or an array of records."""


class SignalFeatures(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Features of recordings, or of every record of an array, as a step of a scikit-learn pipeline.

    Takes a list of recordings, an open :class:`wearstate.DataSet`, or an array. For recordings,
    `fs` to `pulses_per_revolution` are their own.

    Parameters
    ----------
    fs : float, optional
        Sample rate of an array [Hz].
    channel_names : sequence of str, optional
        Names of the channels but the tacho; ``ch_0``, ``ch_1``, … by default.
    quantities : sequence of str, optional
        Quantity of each channel; all ``acceleration`` by default.
    tacho : int, optional
        Index of the tacho channel.
    pulses_per_revolution : int
        Pulses of the tacho in one revolution.
    feature_set : {"standard", "core", "complete"}
        Rows of the catalogue; those whose requirements are not met are absent.
    only : sequence of str, optional
        Names of features, or of single columns, from any set; nothing else is computed.
    settings : Settings
        Bands, bins and orders; kind of machine, geometry of a bearing.

    Attributes
    ----------
    n_channels_in_, n_samples_in_ : int
        Shape of the records seen by `fit`; for recordings, that of the shortest.
    layout_ : tuple or None
        Sample rate, channels, quantities, whether there is a tacho, and its pulses per revolution,
        of the recordings seen by `fit`; None for an array.
    feature_names_out_ : tuple of str
        Columns.

    Notes
    -----
    Nothing is learned: `fit` determines the columns. All features of a record share its transforms,
    each computed at most once, and only if a requested feature needs it. The output is a pandas
    DataFrame; ``set_output(transform="default")`` changes nothing.

    Examples
    --------
    >>> records = np.random.default_rng(0).standard_normal((3, 2, 4096))
    >>> table = SignalFeatures(8192.0, only=["rms", "kurtosis"]).fit_transform(records)
    >>> table.shape, list(table.columns)
    ((3, 4), ['ch_0.rms', 'ch_1.rms', 'ch_0.kurtosis', 'ch_1.kurtosis'])
    >>> import wearstate
    >>> recordings = [wearstate.Recording.from_array(r, 8192.0, ["a", "b"]) for r in records]
    >>> SignalFeatures(only=["rms"]).fit_transform(recordings).shape
    (3, 2)
    """

    def __init__(
        self,
        fs: float | None = None,
        *,
        channel_names: Sequence[str] | None = None,
        quantities: Sequence[str] | None = None,
        tacho: int | None = None,
        pulses_per_revolution: int = 1,
        feature_set: SetName = "core",
        only: Sequence[str] | None = None,
        settings: Settings = STANDARD,
    ) -> None:
        self.fs = fs
        self.channel_names = channel_names
        self.quantities = quantities
        self.tacho = tacho
        self.pulses_per_revolution = pulses_per_revolution
        self.feature_set = feature_set
        self.only = only
        self.settings = settings

    def fit(self, X: Records, y: Any = None) -> Self:  # noqa: ARG002 - scikit-learn's signature
        """Determine the columns.

        Parameters
        ----------
        X : sequence of Recording, DataSet, or array_like
            Signals [units of the channels], arrays of shape (n_records, n_channels, n_samples).
            Recordings must share sample rate, channels and tacho.
        y : Any
            Ignored.

        Returns
        -------
        SignalFeatures
            Itself.

        Raises
        ------
        ValueError
            If the shape or an argument does not fit, recordings differ in more than their length,
            or as for :func:`wearstate.features.catalogue.row.feature_names`.
        """
        recordings = _recordings(X)
        self.layout_: _Layout | None = None
        if recordings is not None:
            return self._fit_recordings(recordings)
        if self.fs is None:
            raise ValueError("fs = None must be given with an array; give the sample rate in Hz")
        signals = self._records(X)
        self.n_channels_in_, self.n_samples_in_ = signals.shape[1:]
        n_vibration = self.n_channels_in_ - (self.tacho is not None)
        if self.channel_names is not None and len(self.channel_names) != n_vibration:
            raise ValueError(
                f"channel_names has {len(self.channel_names)} names, must have {n_vibration}; name "
                "every channel but the tacho"
            )
        names = self.channel_names or tuple(f"ch_{i}" for i in range(n_vibration))
        self.feature_names_out_ = feature_names(
            names,
            self.fs,
            tacho=self.tacho is not None,
            pulses_per_revolution=self.pulses_per_revolution,
            quantities=self.quantities,
            n_samples=self.n_samples_in_,
            settings=self.settings,
            feature_set=self.feature_set,
            only=self.only,
        )
        return self

    def _fit_recordings(self, recordings: Sequence[Recorded]) -> Self:
        arguments = {
            name: getattr(self, name) for name in ("fs", "channel_names", "quantities", "tacho")
        }
        if given := [name for name, value in arguments.items() if value is not None]:
            raise ValueError(f"{', '.join(given)} must be left out; the recordings have their own")
        first = recordings[0]
        self.layout_ = _layout(first)
        self.n_channels_in_ = len(first.vibration_names) + (first.tacho_signal is not None)
        self.n_samples_in_ = first.vibration.shape[-1]
        if isinstance(recordings, list | tuple):  # the records of a file all have the same layout
            for number in range(1, len(recordings)):
                one = self._alike(recordings, number)
                self.n_samples_in_ = min(self.n_samples_in_, one.vibration.shape[-1])
        self.feature_names_out_ = feature_names(
            first.vibration_names,
            first.sample_rate,
            tacho=first.tacho_signal is not None,
            pulses_per_revolution=first.pulses_per_revolution,
            quantities=first.vibration_quantities,
            n_samples=self.n_samples_in_,
            impact=struck(first.vibration, first.vibration_quantities),
            settings=self.settings,
            feature_set=self.feature_set,
            only=self.only,
        )
        return self

    def _alike(self, recordings: Sequence[Recorded], number: int) -> Recorded:
        """One of the recordings; refused if its layout differs from that of `fit`."""
        one = recordings[number]
        if (found := _layout(one)) != self.layout_:
            raise ValueError(
                f"sample rate, channels, quantities, tacho and pulses = {found} of recording "
                f"{number} must be {self.layout_} as of the first in fit; import them alike"
            )
        return one

    def transform(self, X: Records) -> pd.DataFrame:
        """Features of every record.

        Parameters
        ----------
        X : sequence of Recording, DataSet, or array_like
            As for `fit`, with the same channels, rate and tacho; arrays with as many samples,
            recordings long enough for the same features.

        Returns
        -------
        pandas.DataFrame, shape (n_records, n_features)
            Features, float64.

        Raises
        ------
        ValueError
            If the shape differs, or as for :func:`wearstate.features.catalogue.row.feature_row`,
            with the record named.
        """
        check_is_fitted(self)
        recordings = _recordings(X)
        if recordings is not None:
            if self.layout_ is None:
                raise ValueError("X = recordings must be an array as in fit; fit on recordings")
            return self._table(len(recordings), lambda i: self._recording_row(recordings, i))
        if self.layout_ is not None:
            raise ValueError("X = array must be recordings as in fit; fit on an array")
        signals = self._records(X)
        expected = (self.n_channels_in_, self.n_samples_in_)
        if signals.shape[1:] != expected:
            raise ValueError(
                f"X has records of shape {signals.shape[1:]}, must have {expected} as in fit; cut "
                "or resample them"
            )
        return self._table(len(signals), lambda i: self._row(signals[i]))

    def _table(self, n_records: int, row_of: Callable[[int], NDArray[np.float64]]) -> pd.DataFrame:
        columns = list(self.feature_names_out_)
        table = np.empty((n_records, len(columns)))
        for number, row in enumerate(table):
            try:
                row[:] = row_of(number)
            except ValueError as error:
                raise ValueError(f"record {number}: {error}") from error
        return pd.DataFrame(table, columns=columns)

    def _recording_row(self, recordings: Sequence[Recorded], number: int) -> NDArray[np.float64]:
        one = self._alike(recordings, number)
        names, values = feature_row(
            one, settings=self.settings, feature_set=self.feature_set, only=self.only
        )
        if names == self.feature_names_out_:
            return values
        known = dict(zip(names, values, strict=True))  # a longer recording may have more of them
        if lacking := [name for name in self.feature_names_out_ if name not in known]:
            raise ValueError(
                f"{one.vibration.shape[-1]} samples must be >= {self.n_samples_in_} as in fit for "
                f"{lacking[0]}; record longer"
            )
        return np.array([known[name] for name in self.feature_names_out_])

    def narrowed(self, columns: Sequence[str]) -> "SignalFeatures":
        """Unfitted transformer of the same kind that computes only the given columns.

        Parameters
        ----------
        columns : sequence of str
            Names of columns or features, such as those used by a model.

        Returns
        -------
        SignalFeatures
            Transformer whose columns are in the order of the catalogue.

        Examples
        --------
        >>> SignalFeatures(8192.0).narrowed(["ch_0.rms"]).only
        ('ch_0.rms',)
        """
        return type(self)(**{**self.get_params(deep=False), "only": tuple(columns)})

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[np.object_]:  # noqa: ARG002
        """Names of the columns.

        Parameters
        ----------
        input_features : Any
            Ignored.

        Returns
        -------
        ndarray of object, shape (n_features,)
            As for :func:`wearstate.features.catalogue.row.feature_names`.
        """
        check_is_fitted(self)
        return np.array(self.feature_names_out_, dtype=object)

    def _records(self, X: Any) -> NDArray[Any]:
        signals = np.asarray(X)
        if signals.ndim != 3 or signals.dtype.kind not in "fiu":
            raise ValueError(
                f"X has shape {signals.shape} and type {signals.dtype}, must be real numbers of "
                "shape (n_records, n_channels, n_samples); stack the records"
            )
        if self.tacho is not None and not 0 <= self.tacho < signals.shape[1]:
            raise ValueError(
                f"tacho = {self.tacho} must be >= 0 and < n_channels = {signals.shape[1]}; count "
                "from 0"
            )
        return signals

    def _row(self, record: NDArray[Any]) -> NDArray[np.float64]:
        vibration, tacho = record, None
        if self.tacho is not None:
            vibration, tacho = np.delete(record, self.tacho, axis=0), record[self.tacho]
        _, values = feature_row(
            vibration,
            self.fs,
            tacho=tacho,
            pulses_per_revolution=self.pulses_per_revolution,
            channel_names=self.channel_names,
            quantities=self.quantities,
            settings=self.settings,
            feature_set=self.feature_set,
            only=self.only,
        )
        return values

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags


_Layout = tuple[float, tuple[str, ...], tuple[str, ...], bool, int]


def _layout(one: Recorded) -> _Layout:
    """Properties that the recordings of one table must share."""
    tacho = one.tacho_signal is not None
    return (
        float(one.sample_rate),
        tuple(one.vibration_names),
        tuple(one.vibration_quantities),
        tacho,
        one.pulses_per_revolution if tacho else 1,
    )


def _recordings(X: Any) -> Sequence[Recorded] | None:
    """The recordings; None for an array."""
    if isinstance(X, np.ndarray) and X.dtype != object:
        return None
    if isinstance(X, Recorded):
        raise ValueError("X = one recording must be a list of recordings; put it into brackets")
    if not hasattr(X, "__getitem__") or not len(X):
        return None
    return X if isinstance(X[0], Recorded) else None
