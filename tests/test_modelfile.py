"""The model file: the same bytes each time, versions, sizes, and what forgers make of it."""

import importlib.util
import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from wearstate.diagnose.learning.blends import Blend, Forest
from wearstate.diagnose.learning.nets import Nets
from wearstate.diagnose.wear_model import bundle as bundle_module
from wearstate.diagnose.wear_model.arrays import blend_fits
from wearstate.diagnose.wear_model.bundle import (
    Bundle,
    ModelError,
    feature_version,
    load_bundle,
    save_bundle,
)
from wearstate.diagnose.wear_model.file import load_model, save_model

FILES = 60  # four of every kind; the campaign is a script


def forge():
    path = Path(__file__).with_name("forge_models.py")
    spec = importlib.util.spec_from_file_location("forge_models", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def small():
    return Bundle(
        kind="a kind",
        card={"name": "x"},
        structure={"parts": 1},
        arrays={"a": np.arange(6.0).reshape(2, 3), "b": np.array(3), "c": np.array([True])},
    )


def test_what_is_written_is_read_and_the_bytes_do_not_hang_on_the_clock(
    small, tmp_path, monkeypatch
):
    save_bundle(small, tmp_path / "a.wsm")
    monkeypatch.setattr("time.time", lambda: 1e9)
    monkeypatch.setattr("time.localtime", lambda *_: (2001, 9, 9, 1, 46, 40, 6, 252, 0))
    save_bundle(small, tmp_path / "b.wsm")
    assert (tmp_path / "a.wsm").read_bytes() == (tmp_path / "b.wsm").read_bytes()
    read = load_bundle(tmp_path / "a.wsm", "a kind")
    assert read.card == small.card
    assert read.structure == small.structure
    assert all(np.array_equal(read.arrays[name], value) for name, value in small.arrays.items())
    with pytest.raises(ModelError, match="is a a kind, must be a other"):
        load_bundle(tmp_path / "a.wsm", "other")


def test_a_model_of_other_features_is_refused_with_the_cure(small, tmp_path, monkeypatch):
    save_bundle(small, tmp_path / "a.wsm")
    before = feature_version()
    monkeypatch.setattr(bundle_module, "_FEATURES", bundle_module._FEATURES + 1)
    feature_version.cache_clear()
    try:
        assert feature_version() != before
        with pytest.raises(ModelError, match=rf"features = {before} must be \w+; retrain it"):
            load_bundle(tmp_path / "a.wsm", "a kind")
    finally:
        feature_version.cache_clear()


@pytest.mark.parametrize(
    ("shape", "text"),
    [("(1000000000000,)", "must fit shape"), ("(-1,)", "must fit shape"), ("()", "must fit shape")],
)
def test_an_array_is_not_believed_what_it_promises(small, tmp_path, shape, text):
    """A header may ask for terabytes; it is held against what follows before memory is taken."""
    script = forge()
    save_bundle(small, tmp_path / "a.wsm")
    members = script.unpacked(tmp_path / "a.wsm")
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    data = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + bytes(64)
    inner = script.packed({**script.unzipped(members["arrays.npz"]), "a.npy": data})
    whole = script.packed(script.sealed({**members, "arrays.npz": inner}))
    (tmp_path / "b.wsm").write_bytes(whole)
    with pytest.raises(ModelError, match=text):
        load_bundle(tmp_path / "b.wsm", "a kind")


@pytest.mark.parametrize(
    ("name", "data", "text"),
    [
        ("card.json", b"[" * 10**6, "card.json cannot be read"),
        ("card.json", b" " * (2**23 + 1), "must be <= 8388608 byte"),
        ("card.json", b"[1]", "is no table"),
        ("more.json", b"{}", "must hold seal.json"),
    ],
)
def test_tables_too_deep_too_large_or_too_many_are_refused(small, tmp_path, name, data, text):
    script = forge()
    save_bundle(small, tmp_path / "a.wsm")
    members = {**script.unpacked(tmp_path / "a.wsm"), name: data}
    (tmp_path / "b.wsm").write_bytes(script.packed(script.sealed(members)))
    with pytest.raises(ModelError, match=text):
        load_bundle(tmp_path / "b.wsm", "a kind")


def test_a_member_that_is_there_twice_is_refused(small, tmp_path):
    save_bundle(small, tmp_path / "a.wsm")
    with zipfile.ZipFile(tmp_path / "a.wsm", "a") as file, pytest.warns(UserWarning, match="Dupl"):
        file.writestr("card.json", "{}")
    with pytest.raises(ModelError, match="must hold"):
        load_bundle(tmp_path / "a.wsm", "a kind")


def forest(**changes):
    """One tree: node 0 leads to leaf 1 and node 2, that to leaves 3 and 4."""
    given = {
        "feature": [0, 0, 1, 0, 0],
        "threshold": np.zeros(5),
        "left": [1, 1, 3, 3, 4],
        "right": [2, 1, 4, 3, 4],
        "value": np.ones(5),
        "root": [0],
        **changes,
    }
    given = {name: np.asarray(value) for name, value in given.items()}
    tree = Forest(
        depth=changes.get("depth", 2),
        offset=0.0,
        log=False,
        **{name: value for name, value in given.items() if name != "depth"},
    )
    return Blend(names=("trees",), parts=(tree,), weights=np.ones(1), low=0.0, high=1.0)


@pytest.mark.parametrize(
    ("changes", "fits"),
    [
        ({}, True),
        ({"right": [2, 1, 0, 3, 4]}, False),  # a ring through the root
        ({"left": [1, 1, 2, 3, 4]}, False),  # a node that is half a leaf
        ({"left": [2, 1, 3, 3, 4]}, False),  # two ways to one node
        ({"right": [5, 1, 4, 3, 4]}, False),
        ({"left": [-1, 1, 3, 3, 4]}, False),
        ({"feature": [2, 0, 1, 0, 0]}, False),
        ({"root": [2]}, False),  # nothing leads to the first two
        ({"root": [0, 0]}, False),
        ({"depth": 1}, False),  # ends before the leaves
        ({"depth": 10**9}, False),  # ends never
    ],
)
def test_trees_that_lead_nowhere_are_seen(changes, fits):
    assert blend_fits(forest(**changes), 2) is fits


def nets(**changes):
    """Two networks of three directions of two features, with hidden layers of five and four."""
    sizes = {
        "centre": (2,),
        "spread": (2,),
        "direction": (2, 3),
        "first": (2, 3, 5),
        "first_bias": (2, 5),
        "second": (2, 5, 4),
        "second_bias": (2, 4),
        "last": (2, 4),
        "last_bias": (2,),
    }
    part = Nets(scale=1.0, offset=0.0, **{n: np.ones(size) for n, size in sizes.items()})
    part = replace(part, **changes)
    return Blend(names=("nets",), parts=(part,), weights=np.ones(1), low=0.0, high=1.0)


@pytest.mark.parametrize(
    ("changes", "fits"),
    [
        ({}, True),
        ({"spread": np.zeros(2)}, False),
        ({"centre": np.ones(3)}, False),
        ({"direction": np.ones((3, 2))}, False),
        ({"direction": np.ones(6)}, False),
        ({"first": np.ones((2, 5, 3))}, False),
        ({"first_bias": np.ones(5)}, False),
        ({"second": np.ones((1, 5, 4))}, False),
        ({"second_bias": np.ones((2, 5))}, False),
        ({"last": np.ones((2, 4, 1))}, False),
        ({"last_bias": np.ones((2, 1))}, False),
        ({"scale": np.ones(1)}, False),
        ({"first": np.ones((0, 3, 5)), "second": np.ones((0, 5, 4))}, False),
    ],
)
def test_nets_whose_layers_do_not_join_are_seen(changes, fits):
    blend = nets(**changes)
    assert blend_fits(blend, 2) is fits
    if fits:
        assert blend.predict(np.ones((3, 2))).shape == (3,)


def stored_arrays(members):
    with np.load(io.BytesIO(members["arrays.npz"])) as stored:
        return {name: stored[name] for name in stored.files}


def test_a_model_read_and_written_again_is_the_same_file(small_model, tmp_path):
    """Nothing is lost, rounded or put in another order on the way."""
    save_model(load_model(small_model), tmp_path / "again.wsm")
    assert (tmp_path / "again.wsm").read_bytes() == small_model.read_bytes()


def test_no_array_may_be_a_single_number_and_no_number_an_array(small_model, tmp_path):
    script = forge()
    members = script.unpacked(small_model)
    arrays = stored_arrays(members)
    bad = tmp_path / "bad.wsm"
    for name, array in arrays.items():
        other = array.ravel()[0] if array.ndim else np.full(2, array)
        bad.write_bytes(script.with_arrays(members, {**arrays, name: other}))
        with pytest.raises(ModelError, match="retrain it"):
            load_model(bad)


def test_damaged_and_forged_models_do_no_harm(small_model, tmp_path):
    script = forge()
    members = script.unpacked(small_model)
    arrays = stored_arrays(members)
    arrays["blind.witness.offset"] = arrays["blind.witness.offset"] * 1.01
    other = tmp_path / "other.wsm"
    other.write_bytes(script.with_arrays(members, arrays))
    found = script.run((small_model, other), FILES)
    assert script.failures(found) == []
    answers = sum(found.values(), start=type(next(iter(found.values())))())
    assert sum(answers.values()) == FILES
    # most of what is forged cannot pass; swapping members of two good models can
    assert answers["refused"] >= 0.8 * FILES
    json.dumps(answers)


def test_objects_never_get_into_a_model_file(tmp_path):
    """Nor does a switch of numpy's writer, which versions before 2.1 stored as an array."""
    path = tmp_path / "m.wsm"
    numbers = Bundle(kind="k", card={}, structure={}, arrays={"a": np.arange(3.0)})
    save_bundle(numbers, path)
    with zipfile.ZipFile(path) as file, np.load(io.BytesIO(file.read("arrays.npz"))) as stored:
        assert stored.files == ["a"]
    objects = Bundle(kind="k", card={}, structure={}, arrays={"a": np.array([{}], dtype=object)})
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        save_bundle(objects, path, force=True)
    assert list(tmp_path.iterdir()) == [path]
