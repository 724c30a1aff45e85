"""Charts, sweeps and trends whose points can be tapped: what they tell, and what a page holds."""

import json
import math
import re
import shutil
import tomllib

import pytest
from wearstate.diagnose.charts.chart import Chart, Point
from wearstate.diagnose.charts.figure import BEST
from wearstate.diagnose.charts.page import chart_html
from wearstate.diagnose.charts.points import chart_points
from wearstate.diagnose.pages import embed
from wearstate.diagnose.pages.embed import MOST_BYTES
from wearstate.diagnose.pages.points import Mark, PointAxes, Series, point_block
from wearstate.sim.fidelity.differences import Difference
from wearstate.sim.output.recording import DataError

from .command_line import run

HOSTILE = "$$x$$ </script><img src=http://example.org/a>"
BLOCK = '# scene: coarse\n[film]\nrung = "map"  # was direct'
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture
def bokeh():
    return pytest.importorskip("bokeh")


def point(name, seconds, error, **more):
    errors = {"force_peak": Difference(mean=error, standard_error=0.1 * error)}
    return Point(name=name, rungs={}, seconds=seconds, errors=errors, **more)


@pytest.fixture
def chart():
    return Chart(
        name="scene",
        title="scene (simulated)",
        cost_label="wall time of a simulated second [s/s]",
        error_label="largest error [%]",
        accuracy=0.02,
        points=(
            point("coarse", 0.01, 0.015, on_front=True, block=BLOCK),
            point("written", 0.1, 0.004, written=True, on_front=True, block="# scene: written"),
            point(HOSTILE, 1.0, 0.03, verdict="doubtful"),
            Point(name="fails", rungs={}, seconds=math.nan, verdict="invalid"),
        ),
        reference="finest",
        status="resolved",
        winner="coarse",
        verdict="take coarse",
    )


def item_in(html):
    return json.loads(re.search(r'(?s)id="zoom-item">(.*?)</script>', html)[1])


def columns(item, name):
    """Columns of this name of all sources of a page, flat."""
    found = []

    def walk(value):
        if isinstance(value, dict):
            if value.get("name") == "ColumnDataSource":
                entries = dict(value["attributes"]["data"]["entries"])
                found.extend(entries.get(name, []))
            for inner in value.values():
                walk(inner)
        elif isinstance(value, list):
            for inner in value:
                walk(inner)

    walk(item)
    return found


def test_a_point_tells_its_figures_and_its_settings(chart):
    [axes] = chart_points(chart)
    drawn = {each.name: each.marks for each in axes.series}
    assert set(drawn) == {
        BEST, "scatter too large to decide", "cheapest within the accuracy", "your scene",
    }  # fmt: skip
    [mark] = drawn[BEST]
    assert (mark.x, mark.y) == (0.01, pytest.approx(1.5))
    assert (mark.low, mark.high) == (pytest.approx(1.35), pytest.approx(1.65))
    assert mark.hover.splitlines() == [
        "coarse",
        "wall time of a simulated second: 0.01 s/s",
        "error: 1.5 ± 0.1 % (force_peak)",
        "verdict: within",
    ]
    assert mark.block.startswith(BLOCK)
    for series in axes.series:
        for each in series.marks:
            tomllib.loads(each.block)  # what is copied can be pasted
    assert tomllib.loads(mark.block) == {"film": {"rung": "map"}}


def test_the_page_stands_alone_with_a_picture_for_paper(bokeh, chart):
    html = chart_html(chart, interactive=True)
    assert len(html.encode()) < MOST_BYTES
    words = re.sub(r"(?s)<script.*?</script>", "", html)
    assert not re.search(r"<[^>]*(?:src|href)=.?http|url\((?!#|data:)|@import", words)
    assert HOSTILE not in html
    assert re.search(r'(?s)<div class="still">.*<svg', html)
    assert "@media print" in html
    assert BLOCK in "\n".join(columns(item_in(html), "block"))
    assert "<script" not in chart_html(chart)


def test_what_has_no_room_is_left_out_or_refused(bokeh):
    def axes(title, n):
        marks = tuple(Mark(x=i, y=i, hover="x" * 500, block="y" * 500) for i in range(n))
        series = Series(name="", marks=marks, colour="#111111")
        return PointAxes(title=title, x_name="", y_name="", series=(series,))

    block = point_block([axes("first", 500), axes("second", 900)])
    assert block.left_out == ("second",)
    with pytest.raises(DataError, match="2000 points in one picture"):
        point_block([axes("all", 2000)])


def test_moments_stand_upright_and_are_named(bokeh):
    mark = Mark(x=1.0, y=1.0, hover="", block="")
    series = Series(name="", marks=(mark,), colour="#111111")
    axes = PointAxes(
        title="life",
        x_name="",
        y_name="",
        series=(series,),
        moments=(3.25, 7.5),
        moments_name="maintenance",
    )
    item = point_block([axes]).item
    assert "VSpan" in item
    assert "[3.25,7.5]" in item.replace(" ", "")
    assert '"maintenance"' in item


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("chart", "journal-step"), "name one with -o"),
        (("chart", "journal-step", "-o", "x.png"), "name one with -o"),
        (("sweep", "journal-step", "--over", "drive.speed=1,2rpm"), "name one with -o"),
    ],
)
def test_points_need_a_page(arguments, message):
    assert message in run(*arguments, "--interactive", code=2).stderr


def test_without_bokeh_it_is_refused_before_anything_runs(monkeypatch, tmp_path):
    monkeypatch.setattr(embed, "find_spec", lambda name: None)
    page = tmp_path / "x.html"
    told = run("chart", "journal-step", "--interactive", "-o", page, code=2).stderr
    assert 'pip install "wearstate[interactive]"' in told
    assert not page.exists()


def test_a_swept_point_gives_its_settings(bokeh, tmp_path):
    page = tmp_path / "x.html"
    run(
        "sweep", "journal-step", "--over", "drive.speed=2900,3000rpm", "--starts", 2,
        "--set", "duration=0.05", "--jobs", 1, "--interactive", "-o", page,
    )  # fmt: skip
    blocks = {
        json.dumps(tomllib.loads(text)) for text in columns(item_in(page.read_text()), "block")
    }
    assert blocks == {'{"drive": {"speed": "2900.0 rpm"}}', '{"drive": {"speed": "3000.0 rpm"}}'}


# --- in a browser

_PLACE = """() => {
  const figure = [...Bokeh.documents[0]._all_models.values()].find(each => each.type === "Figure")
  const view = Bokeh.index.find_one(figure)
  const found = figure.renderers.filter(each => each.data_source.data.hover)
  const data = found[0].data_source.data
  view.el.scrollIntoView()
  const box = view.canvas_view.el.getBoundingClientRect()
  return [box.left + view.frame.x_scale.compute(data.x[0]),
          box.top + view.frame.y_scale.compute(data.y[0])]
}"""


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip("no Chromium on this computer")
    with playwright.sync_playwright() as running:
        opened = running.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


def swiped(context, page, x, y):
    """How far the page moves under a finger that goes up from a place in it [px]."""
    client, before = context.new_cdp_session(page), page.evaluate("scrollY")
    ways = [("touchStart", 0), *(("touchMove", 20 * step) for step in range(1, 11))]
    for kind, way in ways:
        point = {"x": x, "y": y - way}
        client.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [point]})
        page.wait_for_timeout(20)
    client.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.wait_for_timeout(300)
    return page.evaluate("scrollY") - before


@pytest.mark.parametrize(("width", "touch"), [(1280, False), (390, True)])
def test_mouse_and_finger_bring_the_settings(bokeh, browser, chart, tmp_path, width, touch):
    page_file = tmp_path / "x.html"
    page_file.write_text(chart_html(chart, interactive=True), encoding="utf-8")
    size = {"width": width, "height": 844}
    context = browser.new_context(viewport=size, has_touch=touch, is_mobile=touch, offline=True)
    page, faults = context.new_page(), []
    page.on("console", lambda told: faults.append(told.text) if told.type == "error" else None)
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(page_file.as_uri())
    page.wait_for_function("document.documentElement.classList.contains('zoomed')")
    page.wait_for_function("Bokeh.documents[0].is_idle")
    x, y = page.evaluate(_PLACE)
    if touch:
        page.touchscreen.tap(x, y)
    else:
        page.mouse.move(x - 2, y)
        page.mouse.move(x, y)
        page.get_by_text("verdict: within").first.wait_for()
        page.mouse.click(x, y)
    page.locator("#point").wait_for(state="visible")
    assert page.eval_on_selector("#point-text", "each => each.value").startswith(BLOCK)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    if touch:
        assert swiped(context, page, x, y) > 100  # curves that fill a phone let it scroll
    page.emulate_media(media="print")
    assert page.locator("div.still").is_visible()
    assert not page.locator("#zoom").is_visible()
    assert faults == []
    context.close()
