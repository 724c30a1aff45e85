"""The scikit-learn transformer: columns, sharing, cloning, pickling, pipelines, refusals."""

import pickle

import numpy as np
import pandas as pd
import pytest
import wearstate
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import get_tags
from wearstate.features.catalogue.analysis import Settings
from wearstate.features.catalogue.row import feature_row
from wearstate.features.catalogue.transformer import SignalFeatures
from wearstate.features.signal import envelope, kurtogram

FS = 8192.0
N = 8192


def records(n=4, seed=0):
    """Noise of growing size on two channels, and the tacho of a shaft at 20 rev/s."""
    rng = np.random.default_rng(seed)
    tacho = 5.0 * ((20 * np.arange(N) / FS + 0.2) % 1 < 0.1)
    size = (1.0 + np.arange(n))[:, np.newaxis, np.newaxis]
    noise = size * rng.standard_normal((n, 2, N))
    return np.concatenate([noise, np.broadcast_to(tacho, (n, 1, N))], axis=1)


def test_rows_are_those_of_the_catalogue():
    signals = records().astype(np.float32)
    transformer = SignalFeatures(FS, channel_names=["x", "y"], tacho=2)
    found = transformer.fit_transform(signals)
    assert isinstance(found, pd.DataFrame)
    for i, record in enumerate(signals):
        names, values = feature_row(
            record[:2], FS, tacho=record[2], channel_names=["x", "y"], feature_set="core"
        )
        assert tuple(found.columns) == names
        assert_array_equal(found.iloc[i].to_numpy(), values)
    assert_array_equal(transformer.get_feature_names_out(), np.array(names, dtype=object))
    assert (transformer.n_channels_in_, transformer.n_samples_in_) == (3, N)


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_the_tacho_may_be_any_channel(channel):
    signals = np.roll(records(), channel + 1, axis=1)
    found = SignalFeatures(FS, tacho=channel, only=["speed"]).fit_transform(signals)
    # 20 pulses, each to a sample in 8192.
    assert_allclose(found["shaft.speed_hz"], 20.0, rtol=1e-4)


def test_only_what_a_model_uses_is_computed(monkeypatch):
    signals = records()[:, :2]
    whole = SignalFeatures(FS, feature_set="complete").fit(signals)
    wanted = ["ch_1.rms", "ch_0.tone.level_db"]
    narrow = whole.narrowed(wanted).fit(signals)
    assert narrow.get_params()["feature_set"] == "complete"
    expected = whole.transform(signals)[wanted]

    def refuse(*_a, **_k):
        raise AssertionError("nobody asked for it")

    monkeypatch.setattr(kurtogram, "kurtogram", refuse)
    found = narrow.transform(signals)
    assert list(found.columns) == wanted
    assert_array_equal(found.to_numpy(), expected.to_numpy())
    with pytest.raises(AssertionError):
        whole.transform(signals)


def test_clone_and_pickle_keep_everything():
    settings = Settings(
        bands=((100.0, 200.0),),
        bearing=envelope.BearingFrequencies(cage=0.4, outer=3.1, inner=4.9, roller=2.0),
        speed_hz=20.0,
    )
    given = SignalFeatures(
        FS,
        channel_names=("a", "b"),
        quantities=("acceleration", "displacement"),
        feature_set="complete",
        settings=settings,
    )
    copy = clone(given)
    assert copy.get_params() == given.get_params()
    assert not hasattr(copy, "feature_names_out_")
    signals = records(2)[:, :2]
    fitted = given.fit(signals)
    restored = pickle.loads(pickle.dumps(fitted))
    assert_array_equal(restored.transform(signals), fitted.transform(signals))
    assert "a.bearing_outer.score" in restored.feature_names_out_
    assert "b.velocity_rms" not in restored.feature_names_out_


def test_in_a_pipeline_and_a_search():
    signals = records(24)[:, :2]
    size = 1.0 + np.arange(24)
    model = make_pipeline(SignalFeatures(FS, only=["rms"]), StandardScaler(), Ridge(1e-6))
    search = GridSearchCV(model, {"signalfeatures__only": [["kurtosis"], ["rms"]]}, cv=3)
    search.fit(signals, size)
    assert search.best_params_ == {"signalfeatures__only": ["rms"]}
    # The rms of 8192 samples of noise is within 1/128 of its size, two channels together.
    assert_allclose(search.predict(signals), size, rtol=0.05)
    step = search.best_estimator_[:-1]
    assert list(step.get_feature_names_out()) == ["ch_0.rms", "ch_1.rms"]


def test_set_output():
    signals = records()[:, :2]
    scaled = make_pipeline(SignalFeatures(FS, only=["rms", "peak"]), StandardScaler())
    scaled.set_output(transform="pandas")
    found = scaled.fit_transform(signals)
    assert list(found.columns) == ["ch_0.rms", "ch_1.rms", "ch_0.peak", "ch_1.peak"]
    assert found.index.equals(pd.RangeIndex(4))


def test_an_array_of_records_is_what_it_takes():
    tags = get_tags(SignalFeatures(FS)).input_tags
    assert (tags.three_d_array, tags.two_d_array) == (True, False)


@pytest.mark.parametrize(
    ("options", "shape", "message"),
    [
        ({}, (4, N), r"X has shape \(4, 8192\) .* must be real numbers of shape \(n_records"),
        ({"tacho": 2}, (1, 2, N), r"tacho = 2 must be >= 0 and < n_channels = 2"),
        ({"channel_names": ["a"]}, (1, 2, N), r"channel_names has 1 names, must have 2"),
        ({"quantities": ["force"]}, (1, 2, N), r"quantities has 1 entries, must have 2"),
        ({"only": ["kurtossis"]}, (1, 2, N), r"did you mean kurtosis\?"),
        ({"feature_set": "all"}, (1, 2, N), r"must be one of standard, core, complete"),
    ],
)
def test_arguments_are_checked_in_fit(options, shape, message):
    with pytest.raises(ValueError, match=message):
        SignalFeatures(FS, **options).fit(np.zeros(shape))


def test_other_records_are_refused():
    signals = records()[:, :2]
    fitted = SignalFeatures(FS, only=["rms"]).fit(signals)
    with pytest.raises(ValueError, match=r"shape \(2, 4096\), must have \(2, 8192\) as in fit"):
        fitted.transform(signals[..., :4096])
    signals[2, 1, 5] = np.nan
    with pytest.raises(ValueError, match=r"record 2: ch_1 has 1 non-finite samples"):
        fitted.transform(signals)


def recordings(n=4):
    return [
        wearstate.Recording.from_array(one, FS, ["x", "y", "tacho"], tacho="tacho")
        for one in records(n)
    ]


def test_recordings_give_the_rows_of_their_arrays():
    # recordings hold float32
    expected = SignalFeatures(FS, channel_names=["x", "y"], tacho=2).fit_transform(
        records().astype(np.float32)
    )
    found = SignalFeatures().fit_transform(recordings())
    pd.testing.assert_frame_equal(found, expected)


def test_recordings_in_a_pipeline_and_a_search():
    size = 1.0 + np.arange(24)
    model = make_pipeline(SignalFeatures(only=["rms"]), StandardScaler(), Ridge(1e-6))
    search = GridSearchCV(model, {"signalfeatures__only": [["kurtosis"], ["rms"]]}, cv=3)
    search.fit(recordings(24), size)
    assert search.best_params_ == {"signalfeatures__only": ["rms"]}
    # as of arrays above
    assert_allclose(search.predict(recordings(24)), size, rtol=0.05)


def test_a_data_set_is_a_list_of_recordings(few_set):
    with wearstate.DataSet(few_set) as data:
        wear = data.manifest[data.attributes.severities[0]].to_numpy()
        model = make_pipeline(
            SignalFeatures(only=["rms", "band_levels"]), StandardScaler(), Ridge()
        )
        search = GridSearchCV(model, {"ridge__alpha": [0.1, 1e6]}, cv=3)
        search.fit(data, wear)
        assert search.best_params_ == {"ridge__alpha": 0.1}
        assert list(search.predict(data)) == list(
            search.predict([data[i] for i in range(len(data))])
        )


def test_recordings_of_other_lengths_and_layouts():
    short = wearstate.Recording.from_array(
        records(1)[0, :, : N // 2], FS, ["x", "y", "tacho"], tacho="tacho"
    )
    whole = recordings(2)
    transformer = SignalFeatures(only=["rms"]).fit([*whole, short])
    assert transformer.n_samples_in_ == N // 2
    assert transformer.transform([short, *whole]).shape == (3, 2)
    other = wearstate.Recording.from_array(records(1)[0, :2], FS, ["x", "z"])
    with pytest.raises(ValueError, match=r"of recording 1 must be .* import them alike"):
        SignalFeatures().fit([whole[0], other])
    with pytest.raises(ValueError, match=r"record 0: sample rate, .* of recording 0 must be"):
        transformer.transform([other])


@pytest.mark.parametrize(
    ("options", "data", "message"),
    [
        ({"fs": FS}, recordings(1), "fs must be left out; the recordings have their own"),
        ({}, records(1), r"fs = None must be given with an array"),
        ({}, recordings(1)[0], "put it into brackets"),
        ({"only": "rms"}, recordings(1), "only = 'rms' must be a list of names; put it into"),
    ],
)
def test_what_a_recording_says_is_not_said_twice(options, data, message):
    with pytest.raises(ValueError, match=message):
        SignalFeatures(**options).fit(data)


def test_arrays_and_recordings_do_not_mix():
    with pytest.raises(ValueError, match="must be recordings as in fit"):
        SignalFeatures(only=["rms"]).fit(recordings(1)).transform(records(1))
    with pytest.raises(ValueError, match="must be an array as in fit"):
        SignalFeatures(FS, tacho=2, only=["rms"]).fit(records(1)).transform(recordings(1))
