"""Pages as they look: on a phone, in a window and on paper; measured in Chromium where it is."""

import json
import re
import shutil
import subprocess
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.figure import Figure
from wearstate.datasets.file.record import DataSet
from wearstate.datasets.file.writer import DataSetWriter
from wearstate.datasets.recipe.load import load_recipe
from wearstate.diagnose.blindspots.page import blind_spots_html
from wearstate.diagnose.command_line.cli import cli
from wearstate.diagnose.inspect.recipe_preview import preview, preview_figure
from wearstate.diagnose.pages import page as pages_module
from wearstate.diagnose.pages.picture import (
    PHONE_PX,
    drawn_alone,
    least_width,
    page_image,
    plain_numbers,
)

PHONE, WINDOW, PAPER = 390, 1280, 703  # px; paper is A4 less margins of 12 mm
TEMPLATES = Path(pages_module.__file__).parent / "templates"

COMMANDS = {
    "align": "align propulsion-shaft --set bearings.2.sag=1.6mm --jack stern_aft",
    "atlas": "stability journal-bearing --map eccentricity-mesh --size 3 --budget 5",
    "batch": "report {few} --model {model}",
    "card": "info {data} --card",
    "chart": "chart journal-bearing --set duration=0.3 --budget 2 -j 1",
    "evaluate": "evaluate {model} {data} --quick -j 1",
    "rank": "features {few} --rank -j 1",
    "report": "report {data} --record 5 --model {model}",
    "sweep": "sweep bilge-pump --set duration=0.6 --starts 2 -j 1 --over drive.speed=200,300rpm "
    "--over joint.crankpin.diametral_clearance=.1,.2mm",
    "trend": "report {life} --model {model} --trend",
}
"""Kind of page -> command that writes a small one."""

ZOOMABLE = {
    "zoom": "info {data} --record 5 --interactive",
    "sweep-zoom": "sweep journal-step --set duration=0.05 --starts 2 -j 1 "
    "--over drive.speed=2900,3000rpm --interactive",
    **{f"{kind}-zoom": f"{COMMANDS[kind]} --interactive" for kind in ("chart", "report", "trend")},
}
"""The same of pages whose curves can be zoomed."""

OUTPUT = {"card": "", "zoom": "--plot"}
"""What stands before the name of the page, where that is not -o."""


def one_row(name, value, *, kind="fixed"):
    error = {"value": value, "low": 0.8 * value, "high": 1.2 * value}
    share = {"value": 0.9, "low": 0.8, "high": 1.0}
    return {
        "name": name, "shift": "above, = 4.6e-03 [SI], with kelvin-voigt", "kind": kind,
        "why": "beyond the range that the recipe draws from", "clear_error": error,
        "error": error, "bias": error, "coverage": share, "refused": share, "cautioned": share,
        "machines": 10, "faults": [],
    }  # fmt: skip


def blind_spots():
    rows = [one_row(f"joint.crankpin.damping.rung{i}", 0.2 / (1 + i)) for i in range(30)]
    table = {
        "recipe": "bilge-pump-standard", "severity": "diametral_clearance_crankpin_m",
        "rows": rows, "baseline": one_row("as trained", 0.03, kind="as trained"), "left": [],
        "machines": 10, "usual_cautions": [],
    }  # fmt: skip
    return blind_spots_html(table, notice="trained on simulation")


def one_life(data, folder):
    """Write recordings of one machine as it wears, a month between them, into a new folder."""
    folder.mkdir()
    label = "diametral_clearance_crankpin_m"
    with DataSet(data) as records:
        head, sizes = records.attributes, {"n_records": 1, "n_samples": records.stored_shape[2]}
        worn = np.argsort(records.rows[label])[np.linspace(10, 70, 6).astype(int)]
        for month, number in enumerate(worn, start=1):
            path = folder / f"pump_2026-{month:02d}-05.h5"
            row = {"record_id": "0", "status": "ok", label: records.rows[label][number]}
            with DataSetWriter(path, head, **sizes, columns={label: "<f8"}) as writer:
                writer.write(0, records[number].signal, row)
                writer.finish()
    return folder


def written(data, few, model, folder):
    """A small page of every kind."""
    life = one_life(data, folder / "life")
    commands = COMMANDS | (ZOOMABLE if find_spec("bokeh") else {})
    made = {"blindspots": blind_spots()}
    for kind, command in commands.items():
        words = command.format(data=data, few=few, model=model, life=life).split()
        page = folder / f"{kind}.html"
        words += [*OUTPUT.get(kind, "-o").split(), str(page)]
        done = CliRunner().invoke(cli, words)
        assert done.exit_code == 0, done.output + repr(done.exception)
        made[kind] = page.read_text()
    return made


@pytest.fixture(scope="module")
def looks(small_set, few_set, small_model, tmp_path_factory):
    """Pages of every kind."""
    return written(small_set, few_set, small_model, tmp_path_factory.mktemp("looks"))


# --- without a browser


def test_the_least_width_follows_from_the_smallest_text():
    figure = Figure(figsize=(5.0, 2.0))
    figure.text(0, 0, "large", fontsize=12)
    assert least_width(figure) == 240  # 8 px of 12 points on 360
    figure.text(0, 0, "small", fontsize=6)
    figure.text(0, 0, "", fontsize=1)
    figure.text(0, 0, "hidden", fontsize=1, visible=False)
    assert least_width(figure) == 480
    raised = Figure(figsize=(5.0, 2.0))
    raised.text(0, 0, "$10^{-3}$", fontsize=10)
    assert least_width(raised) == 412  # of 7 points
    assert page_image(figure).sideways
    assert not drawn_alone(lambda axes: axes.text(0, 0, "a", fontsize=8)).sideways


@pytest.mark.parametrize("last", [0.033, 0.07, 0.9])
def test_numbers_on_a_short_logarithmic_axis_do_not_touch(last):
    axes = Figure(figsize=(4.0, 3.0)).add_subplot()
    axes.loglog([0.016, last], [0.016, last])
    plain_numbers(axes.xaxis)
    axes.figure.draw_without_rendering()
    low, high = axes.get_xlim()
    places = [each for each in axes.xaxis.get_ticklabels() if low <= each.get_position()[0] <= high]
    boxes = sorted((each.get_window_extent() for each in places), key=lambda box: box.x0)
    assert len(boxes) >= 2
    assert all(left.x1 + 4 < right.x0 for left, right in pairwise(boxes))


def test_every_picture_is_read_on_a_phone_without_moving_it(looks):
    for kind, page in looks.items():
        widths = [int(width) for width in re.findall(r"--least: (\d+)px", page)]
        assert widths, kind
        assert max(widths) <= PHONE_PX, kind


def test_heads_of_tables_are_told_apart_from_rows(looks):
    """Paper repeats a head on every sheet, a phone leaves it out: both know it by its element."""
    for kind, page in looks.items():
        for table in re.findall("<table.*?</table>", page, re.DOTALL):
            assert "<thead>" in table or "data-label" not in table, f"{kind}: {table[:80]}"


def test_the_preview_of_a_recipe_is_read_on_a_phone_and_names_grades_and_units():
    figure = preview_figure(preview(load_recipe("bilge-pump-small"), 40))
    figure.draw_without_rendering()
    assert least_width(figure) <= PHONE
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()][:2] == ["0 as new", "1 worn"]
    titles = [axes.get_title(loc="right") for axes in figure.axes]
    assert "drive.speed\n[rev/s]" in titles
    assert all(title.endswith("]") for title in titles if title)


def test_pages_share_one_style_and_one_way_to_show_a_picture():
    whole = [path for path in TEMPLATES.glob("*.j2") if "<!DOCTYPE" in path.read_text()]
    assert len(whole) == 11
    for path in whole:
        text = path.read_text()
        assert '{% include "style.html.j2" %}' in text, path.name
        assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in text
        assert "<img" not in text, f"{path.name}: only picture.html.j2 knows the least width"


# --- in a browser


MEASURE = r"""
function luminance(colour) {
  const [r, g, b, a = 1] = colour.match(/[\d.]+/g).map(Number)
  const part = v => (v /= 255) <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4
  return [0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b), a]
}
function ground(element) {
  for (; element; element = element.parentElement) {
    const [light, opaque] = luminance(getComputedStyle(element).backgroundColor)
    if (opaque > 0.5) return light
  }
  return 1
}
function measureCurves(frame, say) {
  // their texts are drawn on a canvas: sizes and places are those that the library tells
  const { Bokeh } = frame.contentWindow, wide = frame.contentDocument.documentElement.clientWidth
  const models = [...Bokeh.documents[0]._all_models.values()]
  const pen = document.createElement("canvas").getContext("2d")
  const long = (text, style, size) => {
    pen.font = `${style} ${size} helvetica, arial, sans-serif`
    return pen.measureText(text).width
  }
  for (const model of models)
    for (const [name, size] of Object.entries(model.attributes))
      if (name.endsWith("text_font_size") && parseFloat(size) < 8) say("small " + size, model.type)
  for (const figure of models.filter(each => each.type == "Figure")) {
    const view = Bokeh.index.find_one(figure), { width, height } = view.frame.bbox
    const title = figure.title.text.text, box = view.el.getBoundingClientRect()
    if (box.right > wide + 1 || !box.width) say("curves cut", title)
    if (width < 0.6 * box.width || height < 90) say(`curves ${width} px by ${height}`, title)
    if (long(title, "bold", "13px") > box.width - view.frame.bbox.left) say("title cut", title)
    for (const [axis, room] of [[figure.below[0], width], [figure.left[0], height]])
      if (long(axis.axis_label.text, "italic", "13px") > room) say("axis cut", axis.axis_label.text)
    for (const legend of figure.below.filter(each => each.type == "Legend"))
      if (Bokeh.index.find_one(legend).bbox.right > box.width) say("legend cut", title)
    const hidden = root => [...root.querySelectorAll("*")].some(each =>
      each.className == "bk-tool-overflow" || (each.shadowRoot && hidden(each.shadowRoot)))
    if (hidden(view.shadow_el)) say("tools hidden", title)
  }
}
function shown(element) {
  return element.checkVisibility() && element.getBoundingClientRect().width > 0
}
function measure(frame) {
  const page = frame.contentDocument, wide = page.documentElement.clientWidth, faults = []
  const say = (what, text) => faults.push(what + ": " + text.trim().slice(0, 40))
  const curves = page.getElementById("zoom"), drawn = page.querySelector(".zoomed")
  if (curves && !drawn && !frame.hasAttribute("sandbox")) say("no curves", page.title)
  if (curves && drawn && shown(curves) == (frame.className == "paper"))
    say("curves shown on paper, or nowhere else", page.title)
  if (drawn && frame.className != "paper") measureCurves(frame, say)
  const stills = [...page.querySelectorAll(".picture img, .picture svg")]
  if ((frame.className == "paper" || !drawn) && !stills.every(shown)) say("no picture", page.title)
  if (page.documentElement.scrollWidth > wide)
    faults.push("wider than the page: " + page.documentElement.scrollWidth)
  const texts = page.createTreeWalker(page.body, NodeFilter.SHOW_TEXT)
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement, text = texts.currentNode.textContent
    if (!text.trim() || element.closest("svg, script, style, noscript, [hidden]")) continue
    const range = page.createRange()
    range.selectNodeContents(texts.currentNode)
    const box = range.getBoundingClientRect(), style = getComputedStyle(element)
    if (!box.width) {
      if (element.closest("td") && frame.width != 0) say("not shown", text)
      continue
    }
    if (parseFloat(style.fontSize) < 8) say("small " + style.fontSize, text)
    if (box.right > wide + 1 && !element.closest(".scroll, .picture")) say("cut", text)
    const [ink] = luminance(style.color), paper = ground(element)
    const contrast = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05)
    if (contrast < 3) say("contrast " + contrast.toFixed(1), text)
  }
  for (const picture of page.querySelectorAll(".picture")) {
    const { width } = picture.firstElementChild.getBoundingClientRect()
    const least = parseFloat(picture.style.getPropertyValue("--least"))
    if (width < least - 1 && frame.className != "paper" && !(drawn && !shown(picture)))
      faults.push(`picture of ${width} px, readable from ${least}`)
  }
  for (const each of page.querySelectorAll("table, img, svg"))
    if (frame.className == "paper" && each.getBoundingClientRect().right > wide + 1)
      faults.push(each.tagName + " wider than paper: " + each.textContent.trim().slice(0, 40))
  return {faults, height: page.documentElement.scrollHeight}
}
function isDrawn(frame) {
  const page = frame.contentDocument, { Bokeh } = frame.contentWindow
  if (!page.getElementById("zoom") || frame.hasAttribute("sandbox")) return true
  return page.querySelector(".zoomed") && Bokeh.documents[0].is_idle
}
addEventListener("load", async () => {
  const found = {}, frames = [...document.querySelectorAll("iframe")]
  for (let i = 0; i < 100 && !frames.every(isDrawn); i++) await new Promise(r => setTimeout(r, 100))
  for (const frame of frames) found[frame.title] = measure(frame)
  document.body.innerHTML = ""
  document.body.textContent = "<<" + JSON.stringify(found) + ">>"
})
"""

ON_PAPER = (("@media print", "@media all"), ("@media screen", "@media not all"))
"""As a browser reads the style when it prints."""


@pytest.fixture(scope="module")
def chromium():
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    return path or pytest.skip("no Chromium here")


def browse(chromium, *arguments):
    command = [chromium, "--headless", "--no-sandbox", "--disable-gpu", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    return done.stdout


def frames_of(kind, html):
    """A page on a phone, in a window, on paper, and where curves are on a phone without scripts."""
    printed = html
    for there, here in ON_PAPER:
        printed = printed.replace(there, here)
    ways = [(PHONE, html, ""), (WINDOW, html, ""), (PAPER, printed, 'class="paper"')]
    if 'id="zoom"' in html:
        ways.append((PHONE, html, 'sandbox="allow-same-origin"'))  # which forbids scripts
    for width, text, how in ways:
        kept = text.replace("&", "&amp;").replace('"', "&quot;")
        name = f"{kind} at {width}" + (" without scripts" if "sandbox" in how else "")
        yield (
            f'<iframe title="{name}" width="{width}" height="800" {how} '
            f'style="border: 0" srcdoc="{kept}"></iframe>'
        )


def measured(chromium, pages, folder):
    """Faults of pages by their name and width, and their heights; all of them in one browser."""
    frames = [frame for kind, html in pages.items() for frame in frames_of(kind, html)]
    whole = folder / "all.html"
    script = f"<script>{MEASURE}</script>"
    whole.write_text("<!DOCTYPE html><meta charset=utf-8>" + script + "\n".join(frames))
    dumped = browse(chromium, "--virtual-time-budget=20000", "--dump-dom", whole.as_uri())
    text = re.search("&lt;&lt;(.*)&gt;&gt;", dumped, re.DOTALL)[1]
    return json.loads(text.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))


def test_pages_are_read_on_a_phone_in_a_window_and_on_paper(chromium, looks, tmp_path):
    found = measured(chromium, looks, tmp_path)
    assert len(found) == 3 * len(looks) + sum("-zoom" in kind or kind == "zoom" for kind in looks)
    assert {name: each["faults"] for name, each in found.items() if each["faults"]} == {}


def test_the_measure_finds_what_is_wrong(chromium, tmp_path):
    style = (TEMPLATES / "style.html.j2").read_text()
    picture = "<div class=picture style='--least: 500px'><img style='width: 300px; min-width: 0'>"
    wrong = {
        "wide": "<div style='width: 2000px'>x</div>",
        "small": "<p style='font-size: 7px'>tiny</p>",
        "dark": "<p style='background: #222; color: #1c232b'>night</p>",
        "picture": f"{picture}</div>",
        "lost": "<table><tr><td style='display: none'>gone</td></tr></table>",
    }
    found = measured(chromium, {kind: style + html for kind, html in wrong.items()}, tmp_path)
    told = {kind: " ".join(found[f"{kind} at {PHONE}"]["faults"]) for kind in wrong}
    assert "wider than the page" in told["wide"]
    assert "small 7px: tiny" in told["small"]
    assert "contrast" in told["dark"]
    assert "picture of 300 px, readable from 500" in told["picture"]
    assert "not shown: gone" in told["lost"]


def test_the_measure_finds_what_is_wrong_with_curves(chromium, looks, tmp_path):
    pytest.importorskip("bokeh")
    page, title = looks["trend-zoom"], '"text": "the machine"'
    long = title.replace("machine", "machine with a name that is longer than a phone is wide")
    wrong = {
        "small": page.replace('"label_text_font_size": "11px"', '"label_text_font_size": "7px"'),
        "long": page.replace(title, long).replace(
            '"toolbar_sticky": false', '"toolbar_sticky": true'
        ),
        "lost": page.replace("@media screen { .zoomed", "@media all { .zoomed"),
        "printed": page.replace(".zoom, .zoom-help { display: none; }", ""),
        "dead": page.replace("Bokeh.embed.embed_item(", "nothing("),
        "bare": re.sub(
            r'(<div class="pictures)', r"<style>.picture { display: none }</style>\1", page
        ),
    }
    assert page not in wrong.values()
    found = measured(chromium, wrong, tmp_path)
    told = {name: " ".join(each["faults"]) for name, each in found.items()}
    assert "small 7px: Legend" in told[f"small at {WINDOW}"]
    assert "title cut: the machine with" in told[f"long at {PHONE}"]
    assert "tools hidden: the machine with" in told[f"long at {PHONE}"]
    assert "no picture" in told[f"lost at {PAPER}"]
    assert "curves shown on paper" in told[f"printed at {PAPER}"]
    assert "no curves" in told[f"dead at {PHONE}"]
    assert "no picture" in told[f"bare at {PHONE} without scripts"]


@pytest.mark.parametrize("kind", ["align", "card", "trend", "trend-zoom"])
def test_printed_pages_end_full(chromium, looks, kind, tmp_path):
    """Gaps before what may not be parted are less than two fifths of the paper."""
    if kind not in looks:
        pytest.skip("no Bokeh here")
    page, printed = tmp_path / "x.html", tmp_path / "x.pdf"
    margins = "<style>@page { size: A4; margin: 12mm; }</style></head>"
    page.write_text(looks[kind].replace("</head>", margins, 1))
    options = ["--no-pdf-header-footer", "--virtual-time-budget=5000"]
    browse(chromium, *options, f"--print-to-pdf={printed}", page.as_uri())
    sheets = len(re.findall(rb"/Type\s*/Page\b", printed.read_bytes()))
    height = measured(chromium, {kind: looks[kind]}, tmp_path)[f"{kind} at {PAPER}"]["height"]
    paper = (297 - 24) * 96 / 25.4  # px
    assert np.ceil(height / paper) <= sheets <= np.ceil(height / paper / 0.6)
