"""Time stamps of text files: ISO dates and times of day give the rate, or say what is wrong."""

from datetime import datetime, timedelta

import pytest
from wearstate.datasets.readers.open import open_source
from wearstate.datasets.source.part import SourceOptions
from wearstate.sim.output.recording import DataError

START = datetime(2024, 5, 1, 23, 59, 59, 900000)
"""A tenth of a second before midnight: a recording of 0.2 s passes it."""


def stamps(pattern, step_us=1000, count=200):
    times = [START + timedelta(microseconds=step_us * i) for i in range(count)]
    return [time.strftime(pattern)[: None if pattern.endswith("%f") else 99] for time in times]


def written(path, texts, *, header="time,acc [g]\n", mark=","):
    path.write_text(header + "".join(f"{text}{mark}{i}\n" for i, text in enumerate(texts)))
    return path


def refusal(path, **options):
    """Why a file is refused, or what it does not declare."""
    try:
        with open_source(path, SourceOptions(**options)) as source:
            assert source.undeclared
            return "\n".join(source.undeclared)
    except DataError as error:
        return str(error)


@pytest.mark.parametrize(
    ("pattern", "header", "mark"),
    [
        ("%Y-%m-%dT%H:%M:%S.%f", "time,acc [g]\n", ","),
        ("%Y-%m-%d %H:%M:%S.%f", "Timestamp,acc [g]\n", ","),
        ("%Y-%m-%dT%H:%M:%S.%fZ", "t,acc [g]\n", ","),
        ("%Y-%m-%d %H:%M:%S.%f +02:00", "when,acc [g]\n", ","),
        ("%Y/%m/%d %H:%M:%S.%f", "time,acc [g]\n", "\t"),
        ("%d.%m.%Y %H:%M:%S,%f", "Zeit;acc [g]\n", ";"),
        ("%H:%M:%S.%f", "time,acc\nhh:mm:ss.fff,g\n", ","),
        ("%H:%M:%S.%f", "Time (hh:mm:ss.ffffff);acc (g)\n", ";"),
        ("%Y-%m-%dT%H:%M:%S.%f", "", ","),
        ("%Y-%m-%d;%H:%M:%S.%f", "date;time;acc [g]\n", ";"),
        ("%Y-%m-%d %H:%M:%S.%f", "", " "),
    ],
)
def test_stamps_give_the_rate(tmp_path, pattern, header, mark):
    header = header.replace(",", mark) if mark == "\t" else header
    path = written(tmp_path / "x.csv", stamps(pattern), header=header, mark=mark)
    with open_source(path, SourceOptions(unit=None if header else "g")) as source:
        assert source.sample_rate == 1000.0  # six decimals allow no other whole number
        assert (len(source.channels), source.n_samples) == (1, 200)
        assert source.read()[0, -1] == pytest.approx(199 * 9.80665)
        assert source.undeclared == ()


def test_stamps_of_few_digits_leave_a_doubt_that_fs_may_settle(tmp_path):
    texts = [text[:-3] for text in stamps("%H:%M:%S.%f", step_us=3125)]  # 3.125 ms, printed to 1
    path = written(tmp_path / "x.csv", texts)
    with open_source(path, SourceOptions()) as source:
        assert source.sample_rate == pytest.approx(320.0, rel=2e-3)
    with open_source(path, SourceOptions(fs=320.0)) as source:
        assert source.sample_rate == 320.0
    assert "fs = 330 Hz must be 320" in refusal(path, fs=330.0)


def test_stamps_that_repeat_are_named_with_their_lines(tmp_path):
    texts = stamps("%Y-%m-%dT%H:%M:%S.%f")
    texts[50], texts[120] = texts[49], texts[119]
    message = refusal(written(tmp_path / "x.csv", texts))
    # a header, and lines are counted from one
    for part in ("do not at 2 of 200", f"{texts[50]} (line 52) after {texts[49]} (line 51)"):
        assert part in message
    assert "(line 122)" in message
    numbers = [f"{i / 1000:.3f}" for i in range(20)]
    numbers[5] = numbers[4]
    path = written(tmp_path / "y.csv", numbers, header="time [s],acc [g]\n")
    assert "0.004 (line 7) after 0.004 (line 6)" in refusal(path)
    coarse = [text[:-7] for text in stamps("%H:%M:%S.%f")]  # whole seconds, 100 samples in each
    message = refusal(written(tmp_path / "z.csv", coarse))
    assert "(they are printed to 1 only), do not at 198 of 200" in message
    with open_source(tmp_path / "z.csv", SourceOptions(time_column=0, fs=1000.0)) as source:
        assert source.n_samples == 200


def test_a_gap_is_named_with_its_line(tmp_path):
    texts = stamps("%H:%M:%S.%f")
    del texts[50:60]
    message = refusal(written(tmp_path / "x.csv", texts))
    # the start is right, so the worst is next to the gap
    assert "off an even grid" in message
    assert any(f"(line {line})" in message for line in (51, 52))


def test_what_is_no_stamp_is_named(tmp_path):
    texts = stamps("%H:%M:%S.%f")
    texts[7] = "noon"
    assert "'noon' in line 9, must be a number or a time stamp" in refusal(
        written(tmp_path / "x.csv", texts)
    )
    texts[7] = "25:00:00.0"
    assert "'25:00:00.0' in line 9" in refusal(written(tmp_path / "x.csv", texts))
    path = written(tmp_path / "y.csv", stamps("%H:%M:%S.%f"))
    assert "must not be given; it holds time stamps" in refusal(path, unit={"time": "s"})


@pytest.mark.parametrize(
    ("start", "pattern"),
    [
        (datetime(2026, 11, 23, 10), "%d/%m/%Y %H:%M:%S.%f"),
        (datetime(2026, 11, 23, 10), "%m/%d/%Y %H:%M:%S.%f"),
        (datetime(2026, 11, 23, 10), "%d-%m-%Y %H:%M:%S.%f"),
        (datetime(2026, 11, 30, 23, 59, 59, 900000), "%d/%m/%Y %H:%M:%S.%f"),  # to 01/12
        (datetime(2026, 11, 12, 23, 59, 59, 900000), "%m/%d/%Y %H:%M:%S.%f"),  # to 11/13
        (datetime(2026, 6, 5, 10), "%d/%m/%Y %H:%M:%S.%f"),  # one day: the order is no matter
    ],
)
def test_dates_with_slashes_are_read_where_one_reading_is_possible(tmp_path, start, pattern):
    times = [start + timedelta(milliseconds=i) for i in range(200)]
    path = written(tmp_path / "x.csv", [time.strftime(pattern) for time in times])
    with open_source(path, SourceOptions()) as source:
        assert source.sample_rate == 1000.0


def test_dates_that_can_be_two_days_are_refused_with_a_cure(tmp_path):
    start = datetime(2026, 6, 5, 23, 59, 59, 900000)
    times = [start + timedelta(milliseconds=i) for i in range(200)]
    for pattern in ("%d/%m/%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f"):
        path = written(tmp_path / "x.csv", [time.strftime(pattern) for time in times])
        message = refusal(path)
        assert "can begin with day or month" in message
        assert "write them as 2026-11-23, or give time_column = 0 and fs" in message
    with open_source(path, SourceOptions(time_column=0, fs=1000.0)) as source:
        assert source.n_samples == 200
    path = written(tmp_path / "y.csv", ["31/31/2026 10:00:00.0"] * 20)
    assert "'31/31/2026 10:00:00.0' in line 2, must be a number or a time stamp" in refusal(path)
