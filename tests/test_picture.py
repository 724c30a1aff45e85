"""Words from data in figures and pages: taken literally, whatever stands in them."""

import io
import warnings
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from wearstate.diagnose.alignment.align import align
from wearstate.diagnose.alignment.figure import align_figure
from wearstate.diagnose.alignment.page import align_html
from wearstate.diagnose.machines.picture import plot_simulation
from wearstate.diagnose.pages.page import render, short_name, visible
from wearstate.diagnose.pages.picture import FORMATS, page_image, picture_bytes, save_picture
from wearstate.diagnose.pictures.kinds import AUTO, KINDS, plot_recording
from wearstate.diagnose.pictures.view import View
from wearstate.diagnose.report.figures import trend_picture
from wearstate.diagnose.report.trend import fit_trend
from wearstate.sim.output.recording import Recording
from wearstate.sim.output.sensor import Channel
from wearstate.sim.output.sensor import Channel as SensorChannel
from wearstate.sim.output.status import Status
from wearstate.sim.scene.load import load_scene

HOSTILE = {
    "dollar": "p$_x^{2$",
    "two dollars": r"$\frac{a}$",
    "odd dollar": r"price \$ $ {",
    "markup": "a_b^c{d}\\e%f",
    "underscore": "_first",
    "newline": "two\nlines",
    "long": "accelerometer " * 12,
    "control": "bell\x07nul\x00",
    "script": "<script>alert('&')</script>",
    "direction": "left\u202eright\u200b\u2066",
    "letters": "加速度 é ω",
    "surrogate": "name\udcff",
}
"""Names that a file may hold."""


def drawn(figure):
    """An SVG of a figure, checked to be whole XML and to say nothing on the way."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = picture_bytes(figure, ".svg")
        picture_bytes(figure, ".png")
    ElementTree.fromstring(picture)
    return picture


def words(artist):
    return [] if artist is None else [text.get_text() for text in artist.findobj(Text)]


THIRDS = [list(HOSTILE.values())[i::3] for i in range(3)]


def hostile_recording(*names):
    """Acceleration, force and orbit of each name, and a tacho."""
    fs, rng = 8192.0, np.random.default_rng(5)
    t = np.arange(round(4 * fs)) / fs
    force, acc = rng.standard_normal((2, t.size))
    rows = {}
    for name in names:
        rows |= {
            f"{name} 1": ("m/s2", "acceleration", acc + force),
            f"{name} force": ("N", "force", force),
            f"{name} x": ("m", "displacement", 3e-5 * np.cos(40 * np.pi * t)),
            f"{name} y": ("m", "displacement", 2e-5 * np.sin(40 * np.pi * t)),
        }
    rows["tacho"] = ("V", "tacho", np.where(20 * t % 1 < 0.1, 5.0, 0.0))
    channels = tuple(
        Channel(name=key, unit=unit, quantity=quantity, place="")
        for key, (unit, quantity, _) in rows.items()
    )
    return Recording(
        signal=np.stack([row for *_, row in rows.values()]),
        sample_rate=fs,
        channels=channels,
        tacho="tacho",
        pulses_per_revolution=1,
        row={},
        source=f"{names[0]}.h5[0]",
    )


def test_a_sheet_of_every_kind_takes_a_dollar():
    made = plot_recording(View(recording=hostile_recording(HOSTILE["dollar"])), AUTO)
    assert made.drawn == tuple(KINDS)
    drawn(made.figure)


@pytest.mark.parametrize("names", THIRDS)
def test_a_spectrum_names_any_channel_in_its_legend(names):
    made = plot_recording(View(recording=hostile_recording(*names)), "spectrum")
    drawn(made.figure)
    told = [word for axes in made.figure.findobj(Axes) for word in words(axes.get_legend())]
    for name in names:
        assert visible(short_name(f"{name} 1")).replace("加速度", "\ufffd" * 3) in told


@pytest.fixture(scope="module")
def aligned():
    scene = load_scene("propulsion-shaft", {"bearings.2.sag": 1.6e-3})
    return align(scene, condition="cold", jack=scene.bearings[4].name)


@pytest.mark.parametrize("names", THIRDS)
def test_the_alignment_takes_any_name(names, aligned):
    found, scene = aligned, aligned.scene
    bearings, seats = list(scene.bearings), list(found.line.seats)
    assert len(names) < len(seats)
    for i, name in enumerate(names):
        bearings[i] = bearings[i].model_copy(update={"name": name})
        seats[i] = replace(seats[i], name=name)
    line = replace(found.line, seats=tuple(seats))
    hostile = replace(
        found,
        scene=scene.model_copy(update={"name": " ".join(names), "bearings": tuple(bearings)}),
        line=line,
        states=tuple(replace(state, line=line) for state in found.states),
        calibration=replace(found.calibration, line=line),
    )
    drawn(align_figure(hostile))
    page = align_html(hostile)
    assert "<script>" not in page
    assert not set(page) & set("\x00\x07\u202e\u200b\u2066\udcff")


def test_a_simulated_recording_takes_any_name(tmp_path):
    name = HOSTILE["dollar"]
    scene = load_scene("bilge-pump", {"duration": 0.5, "name": name})
    n = round(0.5 * scene.sample_rate)
    noise = np.random.default_rng(0).standard_normal
    truth = {"pin_force_n": (n, 2), "pin_offset_m": (n, 2), "piston_pressure_force_n": (n,)}
    solution = Recording(
        signal=noise((2, n)).astype(np.float32),
        sample_rate=scene.sample_rate,
        channels=tuple(
            SensorChannel(name=each, unit="m/s^2", quantity="acceleration")
            for each in (name, f"{name} too")
        ),
        status=Status.OK,
        truth={key: noise(shape) for key, shape in truth.items()},
    )
    plot_simulation(scene, solution, tmp_path / "x.svg")
    ElementTree.parse(tmp_path / "x.svg")


@pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE)
def test_a_trend_takes_any_name(name):
    hours = np.arange(10) * 500.0
    wear = 1e-4 + 2e-8 * hours
    limits = {"condemning_limit_m": 3.1e-4, "quantity": f"{name}, crank pin"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        picture = trend_picture(
            fit_trend(hours, wear, 0.98 * wear, 1.02 * wear, limit=3.1e-4), limits, name
        )
    assert picture.image.address.startswith("data:image/png")


@pytest.mark.parametrize("suffix", FORMATS)
def test_any_figure_takes_any_word(tmp_path, suffix):
    figure = Figure()
    for place, name in enumerate(HOSTILE.values(), start=1):
        axes = figure.add_subplot(3, 4, place)
        axes.plot([1, 2], [1e-7, 1e5], label=short_name(name))
        axes.set(title=name, xlabel=name)
        axes.set_xticks([1, 2], [name, "b"])
        axes.legend()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        save_picture(figure, tmp_path / f"x{suffix}")
        page_image(figure)


def test_a_dollar_is_drawn_and_powers_of_ten_stay_powers():
    figure = Figure()
    axes = figure.add_subplot(title="a$b$c", yscale="log")
    axes.plot([1, 2], [1e-7, 1e5])
    axes.set_xticks([1, 2], ["p$q$", "r"])
    drawn(figure)
    assert not axes.title.get_parse_math()
    labels = axes.get_xticklabels()
    assert [label.get_text() for label in labels] == ["p$q$", "r"]
    assert not any(label.get_parse_math() for label in labels)
    assert all(label.get_parse_math() for label in axes.get_yticklabels())


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_picture_is_that_which_matplotlib_saves_and_the_figure_is_left_as_it_was(suffix):
    """Its layout is made without drawing, which costs as much again."""

    def figure():
        made = Figure(figsize=(4, 3), layout="constrained")
        left, right = made.subplots(1, 2)
        left.loglog([1, 900], [2e-3, 5e4], label="a long name of a curve")
        left.set(xlabel="time [s]", ylabel="acceleration [m/s²]", title="left")
        left.legend()
        made.colorbar(right.imshow(np.eye(3)), label="counts")
        return made

    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    own, theirs, saved = figure(), figure(), io.BytesIO()
    before = own.canvas, own.dpi, own.get_layout_engine()
    picture = picture_bytes(own, suffix)
    assert (own.canvas, own.dpi, own.get_layout_engine()) == before
    with rc_context({"svg.hashsalt": "wearstate"}):
        for text in theirs.findobj(Text):
            if text.get_text():
                text.set_parse_math(False)
        theirs.savefig(saved, format=suffix[1:], dpi=110, metadata=undated.get(suffix))
    assert picture == saved.getvalue()


def test_a_page_escapes_and_shows_every_character():
    card = {"title": "<b>\x07\u202e", "lead": "é"}
    page = render("card.html.j2", card=card, sections=[("s", [("text", "<i>\u200b")])])
    assert "&lt;b&gt;\ufffd\ufffd" in page
    assert "&lt;i&gt;\ufffd" in page
    assert page.startswith("<!DOCTYPE html>")


def test_names_that_differ_stay_different_in_a_legend():
    assert short_name("x" * 30 + "1" * 30) != short_name("x" * 30 + "2" * 30)
    assert short_name("plain") == "plain"
    assert visible("plain é") == "plain é"
