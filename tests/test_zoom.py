"""Pages of curves to zoom and measure in: nothing lost, nothing outside, refused with the cure."""

import base64
import gzip
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from wearstate.datasets.file.attributes import Attributes
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.diagnose.pages import embed
from wearstate.diagnose.pages.embed import MOST_BYTES
from wearstate.diagnose.pages.picture import PageImage
from wearstate.diagnose.pictures.view import View
from wearstate.diagnose.pictures.zoom import zoom_block, zoom_page
from wearstate.diagnose.pictures.zoom_curves import MOST_CHANNELS, ZoomCurve, zoom_curves
from wearstate.sim.output.recording import DataError, Recording
from wearstate.sim.output.sensor import Channel

from .command_line import run

FS, SPEED, MESH = 8192.0, 20.0, 800.0
HOSTILE = "$$x^2$$ </script><img src=http://example.org/a>"


@pytest.fixture
def bokeh():
    return pytest.importorskip("bokeh")


def recording(n_casing=1, seconds=2.0):
    """Two probes, accelerometers with a modulated mesh frequency, and a tacho."""
    t = np.arange(int(seconds * FS)) / FS
    turn = 2 * np.pi * SPEED * t
    mesh = (1 + 0.5 * np.cos(turn)) * np.sin(2 * np.pi * MESH * t)
    probes = [3e-5 * np.cos(turn), 1e-5 * np.sin(turn)]
    pulses = np.where(SPEED * t % 1 < 0.1, 5.0, 0.0)
    channels = [
        Channel(name=HOSTILE, unit="m", quantity="displacement"),
        Channel(name="probe", unit="m", quantity="displacement"),
        *(Channel(name=f"a{i}", unit="m/s^2", quantity="acceleration") for i in range(n_casing)),
        Channel(name="key", unit="V", quantity="tacho"),
    ]
    noise = np.random.default_rng(0).standard_normal((n_casing, t.size))
    signal = np.stack([*probes, *(4 * mesh + 0.1 * noise), pulses])
    return Recording(signal=signal, sample_rate=FS, channels=tuple(channels), tacho="key")


@pytest.fixture(scope="module")
def view():
    return View(recording=recording())


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("zoom") / "data.h5"
    made = recording()
    head = Attributes(sample_rate=FS, channels=made.channels, origin="simulated", tacho="key")
    with DataSetWriter(path, head, n_records=1, n_samples=made.signal.shape[1]) as writer:
        writer.write(0, made.signal, {"record_id": "0", "status": "ok"})
        writer.finish()
    return path


def curve_of(y, kind="spectrum"):
    names = {"title": "", "x_name": "", "y_name": "", "unit": ""}
    return ZoomCurve(kind=kind, **names, x=np.arange(float(len(y))), y=np.asarray(y))


# --- curves


@given(
    peaks=st.lists(st.integers(0, 9999), min_size=1, max_size=8, unique=True),
    most=st.integers(40, 3000),
)
def test_thinning_keeps_every_peak_at_its_place(peaks, most):
    y = np.zeros(10_000)
    for rank, place in enumerate(peaks):
        y[place] = (10.0 + rank) * (-1) ** rank
    thin = curve_of(y).thinned(most)
    assert len(thin.x) <= most
    kept = dict(zip(thin.x.tolist(), thin.y.tolist(), strict=True))
    for place in peaks:
        # a higher one in the same piece, no farther than the reach, may stand for it
        near = [other for other in peaks if abs(other - place) <= thin.reach and y[other] != 0]
        same_sign = [o for o in near if np.sign(y[o]) == np.sign(y[place])]
        assert any(kept.get(float(other)) == y[other] for other in same_sign)
    assert (thin.y.max(), thin.y.min()) == (max(y.max(), 0.0), min(y.min(), 0.0))


def test_a_short_curve_stays_and_an_orbit_is_cut():
    y = np.arange(30.0)
    assert curve_of(y).thinned(30).reach == 0.0
    assert curve_of(y, kind="orbit").thinned(10).y.tolist() == y[:10].tolist()


def test_the_curves_are_those_of_the_field(view):
    curves, left_out = zoom_curves(view)
    assert left_out == {}
    assert [curve.kind for curve in curves] == [
        *("waveform",) * 3, *("spectrum",) * 3, *("orders",) * 3, "envelope", "orbit",
    ]  # fmt: skip
    by_kind = {curve.kind: curve for curve in curves}  # the last of each: of the casing
    spectrum, orders = by_kind["spectrum"], by_kind["orders"]
    # exact lines of a whole number of periods; noise of 0.1 moves a level by about 1e-3
    assert spectrum.x[spectrum.y.argmax()] == MESH
    assert spectrum.y.max() == pytest.approx(4.0, rel=2e-3)
    assert orders.x[orders.y.argmax()] == pytest.approx(MESH / SPEED, abs=0.05)
    assert orders.hz == pytest.approx(SPEED, rel=1e-3)
    assert (curves[0].unit, np.abs(curves[0].y).max()) == ("µm", pytest.approx(30.0))


def test_what_a_recording_lacks_is_told():
    noise = np.random.default_rng(0).standard_normal((1, 4096))
    channel = Channel(name="acc", unit="m/s^2", quantity="acceleration")
    view = View(recording=Recording(signal=noise, sample_rate=FS, channels=(channel,)))
    curves, left_out = zoom_curves(view)
    assert {curve.kind for curve in curves} == {"waveform", "spectrum", "envelope"}
    assert "needs a tacho" in left_out["orders"]
    assert "needs 2 displacement channels" in left_out["orbit"]
    with pytest.raises(DataError, match="orders needs a tacho"):
        zoom_curves(view, "orders")
    with pytest.raises(DataError, match="'frf' cannot be interactive, must be one of auto, wave"):
        zoom_curves(view, "frf")


# --- pages


class Outside(HTMLParser):
    """Addresses outside the page, in tags; a script's own text is none."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name in {"src", "href", "srcset", "data", "action"} and not value.startswith(
                ("data:", "#")
            ):
                self.found.append(value)


def outside(html):
    parser = Outside()
    parser.feed(html)
    words = re.sub(r"(?s)<script.*?</script>", "", html)
    return parser.found + re.findall(r"@import|url\((?!data:)", words)


def item_in(html):
    text = re.search(r'(?s)id="zoom-item">(.*?)</script>', html)[1]
    return json.loads(text)


def unpacked(text):
    data = base64.b64decode(text)
    return gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data


def models(item, name):
    found = []

    def walk(value):
        if isinstance(value, dict):
            if value.get("name") == name:
                found.append(value["attributes"])
            for inner in value.values():
                walk(inner)
        elif isinstance(value, list):
            for inner in value:
                walk(inner)

    walk(item)
    return found


def test_the_reader_sees_an_address():
    assert outside("<script src=http://a></script><style>a {b: url(http://c)}</style>") == [
        "http://a", "url(",
    ]  # fmt: skip


def test_a_page_stands_alone(bokeh, stored, tmp_path):
    page = tmp_path / "x.html"
    done = run("info", stored, "--plot", page, "--interactive", "--json")
    html = page.read_text(encoding="utf-8")
    assert json.loads(done.stdout)["plot"]["drawn"] == [
        "waveform", "spectrum", "orders", "envelope", "orbit",
    ]  # fmt: skip
    assert outside(html) == []
    assert page.stat().st_size < MOST_BYTES
    assert re.search("still pictures.*?<img src=.data:image/png;base64,", html, re.DOTALL)
    assert "@media print" in html
    item = item_in(html)
    # a name between dollar signs is no formula: that would ask the network for its script
    assert any(HOSTILE[:7] in each["text"] for each in models(item, "PlainText"))
    assert all(not isinstance(each["text"], str) for each in models(item, "Title"))
    # curves of a kind share their axis
    ranges = [figure["x_range"]["id"] for figure in models(item, "Figure")]
    assert len(ranges) == 11
    assert len(set(ranges)) == 5


def test_many_channels_leave_a_page_small(bokeh):
    view = View(recording=recording(n_casing=12, seconds=4.0))
    curves, left_out = zoom_curves(view)
    assert len({curve.title for curve in curves if curve.kind == "waveform"}) == MOST_CHANNELS
    assert left_out["channels"] == "9 to 14 have no room; name the channels to draw"
    still = PageImage(address="data:image/png;base64," + 400_000 * "A", least=352, most=647)
    html = zoom_page(
        curves, [("all", still)], heading=view.heading, speed=view.speed, missing=left_out
    )
    assert len(html.encode()) < MOST_BYTES
    assert "have no room" in html


def test_the_page_holds_the_peak(bokeh, view):
    curves, _ = zoom_curves(view, "spectrum")
    item = json.loads(zoom_block(curves[-1:], speed=view.speed, taken=0).item)
    [data] = [
        dict(each["data"]["entries"]) for each in models(item, "ColumnDataSource")
        if "x" in dict(each["data"]["entries"])
    ]  # fmt: skip
    x, y = (np.frombuffer(unpacked(data[name]["array"]["data"]), dtype=np.float32) for name in "xy")
    assert x[y.argmax()] == MESH


def test_the_same_page_every_time(bokeh, view):
    curves, _ = zoom_curves(view, "spectrum")

    def item():
        text = zoom_block(curves, speed=view.speed).item
        # Bokeh counts the models of a process
        numbers = list(dict.fromkeys(re.findall(r'"p[0-9]{4,}"', text)))
        return re.sub(r'"p[0-9]{4,}"', lambda found: f"{numbers.index(found[0])}", text)

    assert item() == item()


def test_without_bokeh_it_is_refused_with_the_cure(stored, tmp_path, monkeypatch):
    monkeypatch.setattr(embed, "find_spec", lambda name: None)
    page = tmp_path / "x.html"
    told = run("info", stored, "--plot", page, "--interactive", code=2).stderr
    assert 'pip install "wearstate[interactive]"' in told
    assert not page.exists()
    run("info", stored, "--plot", tmp_path / "x.png")  # as ever


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--interactive",), "plot options need --plot"),
        (("--interactive", "--plot", "x.png"), "must be one of .html, .htm"),
        (("--plot", "x.html"), "must be one of .png, .svg, .pdf"),
        (("--interactive", "--kind", "waterfall", "--plot", "x.html"), "cannot be interactive"),
    ],
)
def test_what_is_refused(stored, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(embed, "find_spec", lambda name: name)
    assert message in run("info", stored, *arguments, code=2).stderr
    assert list(tmp_path.iterdir()) == []


# --- report


def test_a_report_takes_the_curves_in(bokeh, small_set, small_model, tmp_path):
    page = tmp_path / "x.html"
    judge = ("report", small_set, "--record", 5, "--model", small_model, "-o", page)
    run(*judge, "--interactive")
    html = page.read_text(encoding="utf-8")
    assert outside(html) == []
    assert page.stat().st_size < MOST_BYTES
    kinds = {each["title"]["attributes"]["text"]["attributes"]["text"].split(":")[0]
             for each in models(item_in(html), "Figure")}  # fmt: skip
    assert kinds >= {"Waveform", "Amplitude spectrum", "Order spectrum", "Envelope spectrum"}
    assert html.count('<img src="data:image/png;base64,') == 3  # for paper, as without curves
    run(*judge, "--force")
    assert "<script" not in page.read_text(encoding="utf-8")


def test_what_a_report_refuses(small_set, small_model, tmp_path, monkeypatch):
    page = tmp_path / "x.html"
    judge = ("report", small_set, "--model", small_model, "--interactive")
    assert "name one with -o" in run(*judge, "--record", 5, code=2).stderr
    assert "is for one recording" in run(*judge, "-o", page, code=2).stderr
    monkeypatch.setattr(embed, "find_spec", lambda name: None)
    told = run(*judge, "--record", 5, "-o", page, code=2).stderr
    assert 'pip install "wearstate[interactive]"' in told
    assert not page.exists()
