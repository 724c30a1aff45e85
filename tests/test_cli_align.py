"""`wearstate align`: the table of an engineer, JSON, page and picture, exit codes, refusals."""

import json
from functools import partial

import pytest
from wearstate.diagnose.alignment.align import align
from wearstate.diagnose.alignment.figure import align_figure
from wearstate.diagnose.alignment.text import align_text
from wearstate.sim.alignment.alignment import reactions
from wearstate.sim.scene.load import load_scene
from wearstate.sim.shaft.line_alignment import alignment_conditions, alignment_line

from .command_line import run as command

SCENE = "propulsion-shaft"
SAGGED = ("--set", "bearings.2.sag=1.6 mm")  # the intermediate bearing lifts, and chocks mend it
STUCK = list(SAGGED)
for number in (2, 3, 4):
    for bound in ("least_move", "most_move"):
        STUCK += ["--set", f"bearings.{number}.limits.{bound}=0"]


run = partial(command, "align")


def strict(text):
    return json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))


def test_within_limits():
    text = run(SCENE, "--fail-on", "warning").stdout
    assert "every limit is met; nothing moves" in text
    assert all(f"{name}, " in text for name in ("cold", "hot", "running"))
    assert "lifted" not in text


def test_json_is_what_the_library_says():
    table = strict(run(SCENE, *SAGGED, "--json").stdout)
    assert table["schema_version"] == 1
    scene = load_scene(SCENE, {"bearings.2.sag": "1.6 mm"})
    line, conditions = alignment_line(scene), alignment_conditions(scene)
    assert [c["name"] for c in table["conditions"]] == list(conditions)
    for shown in table["conditions"]:
        state = reactions(line, conditions[shown["name"]])
        loads = [row["reaction_n"] for row in shown["bearings"]]
        assert loads == pytest.approx(state.reactions.tolist())
        assert sum(row["share"] for row in shown["bearings"]) == pytest.approx(1.0)
    lifted = [row["name"] for row in table["conditions"][0]["bearings"] if row["lifted"]]
    assert lifted == ["intermediate_aft"]
    # the moves, put back, give the reactions that the table promises
    calibration = table["calibration"]
    assert calibration["status"] == "done"
    mended = line.moved(calibration["moves_m"])
    for shown in calibration["conditions"]:
        again = reactions(mended, conditions[shown["name"]]).reactions.tolist()
        assert [row["reaction_n"] for row in shown["bearings"]] == pytest.approx(again, rel=1e-6)
        assert not any(row["unmet"] for row in shown["bearings"])
    assert table["jacking"] is None


def test_the_text_tells_the_move_and_what_it_does():
    text = run(SCENE, *SAGGED).stdout
    assert "lifted: intermediate_aft" in text
    assert "raise intermediate_aft by " in text
    assert "with the points in contact of cold; a lifted bearing has none" in text
    [row] = [r for r in text.splitlines() if r.startswith("intermediate_aft") and "->" in r]
    before, arrow, after = row.split()[1:4]
    assert (before, arrow) == ("0.0", "->")
    assert float(after) >= 3.0  # kN, its least load


def test_what_blocks_is_named_with_what_it_would_take():
    text = run(SCENE, *STUCK, "--fail-on", "alarm", code=4).stdout
    assert "not met: bearing 'intermediate_aft', cold: reaction = 0 kN must be >= 3 kN" in text
    assert "blocked by: bearing '" in text
    assert "would have to be" in text
    assert "no move within the bounds brings the limits nearer" in text


def test_exit_codes():
    run(SCENE, *SAGGED)
    run(SCENE, *SAGGED, "--fail-on", "alarm", code=4)  # a bearing lifts
    steep = ("--set", "bearings.0.limits.most_slope=5e-5 rad", "--no-calibrate")
    run(SCENE, *steep)
    run(SCENE, *steep, "--fail-on", "warning", code=3)
    run(SCENE, *steep, "--fail-on", "alarm", code=0)


def test_one_condition_and_no_calibration():
    table = strict(run(SCENE, "--condition", "hot", "--no-calibrate", "--json").stdout)
    assert [c["name"] for c in table["conditions"]] == ["hot"]
    assert table["calibration"] is None


def test_jack():
    table = strict(run(SCENE, "--jack", "intermediate_aft", "--json").stdout)["jacking"]
    assert table["estimate_n"] == pytest.approx(table["reaction_n"], rel=0.02)
    assert len(table["lifts_m"]) == len(table["loads_n"])
    assert "correction factor" in run(SCENE, "--jack", "intermediate_aft").stdout


def test_page_and_picture(tmp_path):
    page, picture = tmp_path / "a.html", tmp_path / "a.svg"
    files = ("-o", page, "--plot", picture)
    shown = strict(run(SCENE, *SAGGED, *files, "--json").stdout)
    assert shown["files"] == [str(picture), str(page)]
    html = page.read_text()
    assert html.count("data:image/png;base64,") == 13  # line, films and model of five bearings
    assert "intermediate_aft" in html
    assert "raise intermediate_aft by " in html
    assert "http://" not in html
    assert "<script" not in html
    assert picture.read_text().lstrip().startswith("<?xml")
    assert "exists" in run(SCENE, *files, code=2).stderr
    before = picture.read_bytes()
    run("shaft-rig", "--plot", picture, "--force")  # another line, cheaper to draw
    assert picture.read_bytes() != before


def test_the_picture_shows_every_part():
    found = align(load_scene(SCENE, {"bearings.2.sag": "1.6 mm"}), jack="intermediate_forward")
    axes = align_figure(found).axes
    assert len(axes) == 4
    n_bars = len(found.states) * 2 * len(found.line.seats)
    assert len(axes[2].patches) == n_bars
    assert len(axes[0].lines) == 2 * (1 + len(found.line.seats))
    assert "kN/mm once the bearing is free" in align_text(found)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["bilge-pump"], "'reciprocating-pump' must be 'propulsion-shaft'"),
        ([SCENE, "--jack", "nobody"], "must be one of stern_aft"),
        ([SCENE, "--condition", "warm"], "Invalid value for '--condition'"),
        ([SCENE, "--set", "bearings.2.sagg=1mm"], "unknown key"),
        ([SCENE, "--plot", "a.txt"], "suffix '.txt' must be one of"),
        ([SCENE, *SAGGED, "--jack", "intermediate_aft"], "must be > 0 to be jacked"),
    ],
)
def test_bad_input(arguments, says):
    result = run(*arguments, code=2)
    assert result.stdout == ""
    assert says in result.stderr


def test_a_move_onto_a_limit_is_told_and_a_margin_keeps_away():
    text = run(SCENE, *SAGGED).stdout
    assert "on a limit after the moves: intermediate_aft; --margin 0.1 keeps" in text
    kept = run(SCENE, *SAGGED, "--margin", "0.2").stdout
    assert "every limit is kept with a margin of 20 %" in kept
    assert "on a limit" not in kept
    table = strict(run(SCENE, *SAGGED, "--margin", "0.2", "--json").stdout)["calibration"]
    seats = alignment_line(load_scene(SCENE)).seats
    for shown in table["conditions"]:
        for seat, row in zip(seats, shown["bearings"], strict=True):
            assert row["reaction_n"] >= 1.2 * seat.least_load * (1 - 1e-6)
            assert abs(row["slope_rad"]) <= 0.8 * seat.most_slope * (1 + 1e-6)
    assert table["touched"] == []


def test_a_margin_that_cannot_be_kept_is_told_with_what_can():
    text = run("shaft-rig", "--margin", "0.9").stdout
    assert "a margin of 90 % of each limit cannot be kept; " in text
    assert "calibration: the moves bring every" in text


def test_even_reactions_differ_less_and_keep_every_limit():
    shown = strict(run(SCENE, *SAGGED, "--target", "even", "--json").stdout)["calibration"]
    least = strict(run(SCENE, *SAGGED, "--json").stdout)["calibration"]

    def spread(table):
        shares = [row["share"] for state in table["conditions"] for row in state["bearings"]]
        return sum((share - 1 / 5) ** 2 for share in shares)

    assert shown["unmet"] == []
    assert spread(shown) < 0.6 * spread(least)


def test_questions_that_do_not_go_together_are_refused():
    needless = run(SCENE, "--no-calibrate", "--margin", "0.1", code=2)
    assert "leave out --no-calibrate" in needless.stderr
    both = run(SCENE, "--target", "even", "--prefer", "fewest", code=2)
    assert "prefer = 'fewest' must be 'least'" in both.stderr


def test_the_page_holds_the_verdict_beside_the_name_and_the_test(tmp_path):
    page = tmp_path / "a.html"
    text = run("shaft-rig", "--test", "shaker", "-o", page).stdout
    html = page.read_text()
    assert html.index('<th class="left">verdict</th>') < html.index("station <span")
    assert (
        html.count("data:image/png;base64,") == 15
    )  # line; films, model and test of four bearings
    assert "Simulated shaker test, pushing aft up" in html
    assert "orange: after the moves" in html
    # the lift of 0.06 mm moves no peak by more than the test scatters, and both say so
    for told in (html, text):
        assert "so the test cannot show what these moves do" in told
    within = tmp_path / "b.html"
    run(SCENE, "--test", "shaker", "-o", within)
    assert "No test: nothing moves" in within.read_text()


def test_the_picture_tells_before_from_after():
    found = align(load_scene(SCENE, {"bearings.2.sag": "1.6 mm"}))
    words = [text.get_text() for text in align_figure(found).axes[2].get_legend().get_texts()]
    assert words == ["as set", "after the moves", "limit"]
