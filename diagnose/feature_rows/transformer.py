"""The catalogue as a scikit-learn transformer: an array of records in, a named table out."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils import Tags
from sklearn.utils.validation import check_is_fitted

from ...features.catalogue.analysis import STANDARD, Settings
from ...features.catalogue.catalogue import SetName
from ...features.catalogue.row import feature_names, feature_row


class SignalFeatures(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Features of every record of an array.

    Parameters
    ----------
    fs : float
        Sample rate [Hz].
    channel_names : sequence of str, optional
        Names of the channels but the tacho; ``ch_0``, ``ch_1``, … by default.
    quantities : sequence of str, optional
        Quantity of each; all ``acceleration`` by default.
    tacho : int, optional
        Channel that holds the tacho.
    pulses_per_revolution : int
        Its pulses in one revolution.
    feature_set : {"standard", "core", "complete"}
        Which rows of the catalogue; those whose needs are not met are absent.
    only : sequence of str, optional
        Names of features, or of single columns, from any set; nothing else is computed.
    settings : Settings
        Bands, bins and orders; kind of machine, geometry of a bearing.

    Attributes
    ----------
    n_channels_in_, n_samples_in_ : int
        Shape of the records seen by `fit`.
    feature_names_out_ : tuple of str
        Columns.

    Notes
    -----
    Nothing is learned: `fit` settles which columns there are. All features of a record share its
    transforms, each made at most once, and only those that a wanted feature needs are made. The
    output is a pandas DataFrame; ``set_output(transform="default")`` changes nothing.

    Examples
    --------
    >>> records = np.random.default_rng(0).standard_normal((3, 2, 4096))
    >>> table = SignalFeatures(8192.0, only=["rms", "kurtosis"]).fit_transform(records)
    >>> table.shape, list(table.columns)
    ((3, 4), ['ch_0.rms', 'ch_1.rms', 'ch_0.kurtosis', 'ch_1.kurtosis'])
    """

    def __init__(
        self,
        fs: float,
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

    def fit(self, X: ArrayLike, y: Any = None) -> Self:  # noqa: ARG002 - scikit-learn's signature
        """Settle the columns.

        Parameters
        ----------
        X : array_like, shape (n_records, n_channels, n_samples)
            Signals [units of the channels].
        y : Any
            Ignored.

        Returns
        -------
        SignalFeatures
            Itself.

        Raises
        ------
        ValueError
            If the shape or an argument does not fit, or as
            :func:`wearstate.features.catalogue.row.feature_names`.
        """
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

    def transform(self, X: ArrayLike) -> pd.DataFrame:
        """Features of every record.

        Parameters
        ----------
        X : array_like, shape (n_records, n_channels, n_samples)
            Signals [units of the channels], as many channels and samples as in `fit`.

        Returns
        -------
        pandas.DataFrame, shape (n_records, n_features)
            float64.

        Raises
        ------
        ValueError
            If the shape is another one, or as :func:`wearstate.features.catalogue.row.feature_row`;
            then the record is named.
        """
        check_is_fitted(self)
        signals = self._records(X)
        expected = (self.n_channels_in_, self.n_samples_in_)
        if signals.shape[1:] != expected:
            raise ValueError(
                f"X has records of shape {signals.shape[1:]}, must have {expected} as in fit; cut "
                "or resample them"
            )
        columns = list(self.feature_names_out_)
        table = np.empty((len(signals), len(columns)))
        for number, (row, record) in enumerate(zip(table, signals, strict=True)):
            try:
                row[:] = self._row(record)
            except ValueError as error:
                raise ValueError(f"record {number}: {error}") from error
        return pd.DataFrame(table, columns=columns)

    def narrowed(self, columns: Sequence[str]) -> "SignalFeatures":
        """Unfitted transformer of the same kind that computes these columns only.

        Parameters
        ----------
        columns : sequence of str
            Names of columns or features, such as those a model has come to use.

        Returns
        -------
        SignalFeatures
            Its columns come in the order of the catalogue.

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
            As :func:`wearstate.features.catalogue.row.feature_names`.
        """
        check_is_fitted(self)
        return np.array(self.feature_names_out_, dtype=object)

    def _records(self, X: ArrayLike) -> NDArray[Any]:
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
