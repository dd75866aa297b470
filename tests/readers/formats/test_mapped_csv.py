"""Reading text tables by a mapping: layouts of other programs, faults with their line, clocks and
counters.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recording_files
from recording_files import ARM, of

from shukotsu.readers.formats.frames_by_time import framed_by_time
from shukotsu.readers.formats.mapped import Track
from shukotsu.readers.samples import Samples

ANGLES = {"kind": "euler", "axes": "ZYX", "unit": "deg"}
WIDE = {
    "format": "csv",
    "position_unit": "cm",
    "orientation": ANGLES,
    "receivers": {
        "forearm": {"position": ["x1", "y1", "z1"], "orientation": ["az1", "el1", "ro1"]},
        "hand": {"position": ["x2", "y2", "z2"], "orientation": ["az2", "el2", "ro2"]},
    },
    "csv": {"time": "t", "time_unit": "ms"},
}
HEADER = "t,x1,y1,z1,az1,el1,ro1,x2,y2,z2,az2,el2,ro2\n"
ROWS = "0,1,2,3,90,0,0,4,5,6,0,0,0\n4.5,1.5,2,3,0,90,0,4,5,6,0,0,90\n"
HALF = np.sqrt(0.5)
SEMICOLONS = str.maketrans(",.", ";,")
LONG = {
    "format": "csv",
    "position_unit": "m",
    "orientation": {"kind": "quaternion", "order": "xyzw"},
    "receivers": {"forearm": {"value": 1}, "hand": {"value": 2}},
    "csv": {
        "rows": "long",
        "frame": "n",
        "receiver": "sensor",
        "position": ["x", "y", "z"],
        "orientation": ["a", "b", "c", "d"],
    },
}
LONG_TEXT = "n,sensor,x,y,z,a,b,c,d\n7,2,1,2,3,0,0,0,1\n7,1,4,5,6,0,0,0,1\n9,2,7,8,9,1,0,0,0\n"


def changed(base: dict[str, Any], csv: dict[str, Any] | None = None, **keys: Any) -> dict[str, Any]:
    return base | keys | {"csv": base["csv"] | (csv or {})}


def read(tmp_path: Path, text: str, mapping: dict[str, Any]) -> Samples:
    (tmp_path / "old.txt").write_bytes(text.encode())
    return recording_files.read(tmp_path / "old.txt", ARM, mapping)


def refuse(tmp_path: Path, text: str, mapping: dict[str, Any], message: str) -> None:
    (tmp_path / "old.txt").write_bytes(text.encode())
    recording_files.refuse(tmp_path / "old.txt", message, ARM, mapping)


TIMES = (
    "t,x1,y1,z1,az1,el1,ro1,x2,y2,z2,az2,el2,ro2\n{},1,2,3,0,0,0,4,5,6,0,0,0\n{},1,2,3,0,0,0,4,5,6,0,0,0\n"
)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ("00:00:01", "00:00:01.0041667", [1, 1.0041667]),
        (" 9:05:07.5", "10:00:00", [32707.5, 36000]),
        ("23:59:59.9999999", "00:00:00.1000000", [86399.9999999, 86400.1]),
        ("", "00:00:02", [np.nan, 2]),
    ],
)
def test_times_of_day_become_seconds_across_midnight(
    tmp_path: Path, first: str, second: str, expected: list[float]
) -> None:
    mapping = changed(WIDE, {"time_unit": "hh:mm:ss"})
    samples = read(tmp_path, TIMES.format(first, second), mapping)
    for segment in ("forearm", "hand"):
        np.testing.assert_allclose(samples.time_s[of(samples, segment)], expected, rtol=1e-12)
    for odd in ("00:61:00", "1.5", "12:00", "25-01-01 00:00:00"):
        refuse(
            tmp_path,
            TIMES.format("00:00:00", odd),
            mapping,
            f"line 3, column t: is '{odd}'; expected a time as hh",
        )


@pytest.mark.parametrize(
    ("text", "csv"),
    {
        "plain": (HEADER + ROWS, {}),
        "bom": ("\ufeff" + HEADER + ROWS, {}),
        "semicolons": ((HEADER + ROWS).translate(SEMICOLONS), {"delimiter": ";", "decimal": ","}),
        "tabs": ((HEADER + ROWS).replace(",", "\t"), {"delimiter": "tab"}),
        "blanks": ("  " + (HEADER + ROWS).replace(",", "  ").replace("\n", " \n "), {"delimiter": "space"}),
        "comments": ("# made by\n" + HEADER + "  # a, note\n" + ROWS, {"comment": "#"}),
        "skipped": ("made by\n\n" + HEADER + "\n" + ROWS, {"skip_lines": 1}),
        "spaces": ((HEADER + ROWS).replace(",", " , "), {}),
        "minus": ((HEADER + ROWS).replace("0,1,2", "\N{MINUS SIGN}0,1,2"), {}),
        "more columns": ((HEADER + ROWS).replace("\n", ",n\n"), {}),
        "blank columns": (HEADER + ROWS.replace("\n", ",,,\n"), {}),
    }.values(),
)
def test_a_wide_table_is_read_in_every_text_format(tmp_path: Path, text: str, csv: dict[str, Any]) -> None:
    samples = read(tmp_path, text, changed(WIDE, csv))
    forearm, hand = of(samples, "forearm"), of(samples, "hand")
    np.testing.assert_allclose(samples.numbers[forearm, :3], [[10, 20, 30], [15, 20, 30]])
    np.testing.assert_allclose(samples.numbers[forearm, 3:], [[HALF, 0, 0, HALF], [HALF, 0, HALF, 0]])
    np.testing.assert_allclose(samples.numbers[hand, 3:], [[1, 0, 0, 0], [HALF, HALF, 0, 0]])
    for segment in (forearm, hand):
        np.testing.assert_array_equal(samples.frame[segment], [0, 1])
        np.testing.assert_allclose(samples.time_s[segment], [0, 0.0045])


def test_a_long_table_is_read_by_receiver_and_frame(tmp_path: Path) -> None:
    samples = read(tmp_path, LONG_TEXT, changed(LONG, fixed=["scapula"]))
    hand, forearm, bench = (of(samples, segment) for segment in ("hand", "forearm", "scapula"))
    np.testing.assert_array_equal(samples.frame[hand], [7, 9])
    np.testing.assert_array_equal(samples.frame[forearm], [7])
    np.testing.assert_allclose(
        samples.numbers[hand], [[1e3, 2e3, 3e3, 1, 0, 0, 0], [7e3, 8e3, 9e3, 0, 1, 0, 0]]
    )
    np.testing.assert_array_equal(samples.frame[bench], [7, 9])
    np.testing.assert_array_equal(samples.numbers[bench], [[0, 0, 0, 1, 0, 0, 0]] * 2)
    assert np.isnan(samples.time_s).all()
    assert samples.locate(int(np.flatnonzero(hand)[1])) == f"{tmp_path}/old.txt: line 4"


def test_receivers_that_are_not_in_step_are_put_on_a_common_grid(tmp_path: Path) -> None:
    """Rows repeat unchanged values; of two new values in one frame the nearer is kept. A row with an absurd
    time is left out, since as the start of the grid it would put all others in one frame.
    """
    receivers = {
        segment: {"position": [f"{c}{n}" for c in "xyz"], "orientation": [f"{c}{n}" for c in "wabc"]}
        for segment, n in (("forearm", 1), ("hand", 2))
    }
    mapping = {
        "format": "csv",
        "position_unit": "mm",
        "rate_hz": 100,
        "orientation": {"kind": "quaternion", "order": "wxyz"},
        "receivers": receivers,
        "csv": {"time": "t", "time_unit": "s", "in_step": False},
    }
    rows = [(0.0, 1, 1), (0.008, 1, 2), (0.011, 2, 3), (0.014, 2, 4), (0.03, 2, 4), (0.04, 1, 5)]
    rows += [(-1e300, 9, 9)]
    lines = [f"{time},{first},0,0,1,0,0,0,{second},0,0,1,0,0,0\n" for time, first, second in rows]
    samples = read(tmp_path, "t,x1,y1,z1,w1,a1,b1,c1,x2,y2,z2,w2,a2,b2,c2\n" + "".join(lines), mapping)
    for segment, frame, x_mm, time_s in (
        ("forearm", [0, 1, 4], [1, 2, 1], [0, 0.011, 0.04]),
        ("hand", [0, 1, 4], [1, 3, 5], [0, 0.011, 0.04]),
    ):
        rows_of = of(samples, segment)
        np.testing.assert_array_equal(samples.frame[rows_of], frame)
        np.testing.assert_array_equal(samples.numbers[rows_of, 0], x_mm)
        np.testing.assert_array_equal(samples.time_s[rows_of], time_s)
    assert "segment forearm: 3 new values in 7 rows; 0 left out" in samples.notes[0]
    assert samples.notes[1] == "segment forearm: 1 new values left out: their times are years off all others"
    assert "segment hand: 5 new values in 7 rows; 2 left out" in samples.notes[2]


@pytest.mark.parametrize(
    ("text", "csv", "message"),
    [
        ("", {}, "old.txt: is empty; expected a table"),
        (HEADER, {}, "old.txt: has no rows"),
        (HEADER + ROWS + "\nModels\n1,2,3\n", {}, "old.txt: line 5: another table seems to begin here"),
        (HEADER + ROWS + "1,2,3\n", {}, "old.txt: line 4: has 3 cells; expected 13 as in the first line"),
        (HEADER + ROWS + HEADER, {}, "line 4, column x1: is 'x1'; expected a number; the header is repeated"),
        (HEADER + "1,2,3\n" + ROWS, {}, "old.txt: line 2: has 3 cells; expected 13 as in the first line"),
        (HEADER + "1,2,3", {}, "old.txt: has no rows; the last line has no line end and too few cells"),
        (HEADER + ROWS.replace("4.5", "four"), {}, "old.txt: line 3, column t: is 'four'; expected a number"),
        (HEADER + ROWS, {"decimal": ",", "delimiter": ";"}, "csv.time: column 't' is missing"),
        (
            (HEADER + ROWS).replace(",", ";"),
            {"decimal": ",", "delimiter": ";"},
            "line 3, column x1: is '1.5'; expected a number with a decimal comma",
        ),
        (HEADER.replace("ro2", "roll2") + ROWS, {}, "receivers.hand.orientation: column 'ro2' is missing"),
        (HEADER.replace("ro2", "Ro_2") + ROWS, {}, "did you mean 'Ro_2'?"),
        (HEADER.replace("x2", "x1") + ROWS, {}, "has 2 columns 'x1'; give the column's number"),
        (HEADER + ROWS, {"frame": "t"}, "line 3, column t: is '4.5'; expected a whole number"),
    ],
)
def test_a_table_that_contradicts_its_mapping_is_refused(
    tmp_path: Path, text: str, csv: dict[str, Any], message: str
) -> None:
    refuse(tmp_path, text, changed(WIDE, csv), message)


@pytest.mark.parametrize("mark", [",", "\t"])
def test_a_last_row_that_is_cut_off_is_left_out(tmp_path: Path, mark: str) -> None:
    text, whole = (HEADER + ROWS).replace(",", mark), {"delimiter": {"\t": "tab"}.get(mark, mark)}
    samples = read(tmp_path, f'{text}9{mark}"1{mark}2{mark}', changed(WIDE, whole))
    np.testing.assert_array_equal(samples.frame[of(samples, "hand")], [0, 1])
    assert "the last line has no line end and too few cells" in samples.losses[0]


def test_a_first_row_of_missing_marks_is_a_gap_and_not_names(tmp_path: Path) -> None:
    lost = ",".join(["lost"] * 13) + "\n"
    samples = read(tmp_path, HEADER + lost + ROWS, WIDE | {"csv": {"missing": ["lost"]}})
    np.testing.assert_array_equal(samples.numbers[of(samples, "hand"), 0], [np.nan, 40, 40])


def test_a_rate_that_the_times_contradict_is_refused(tmp_path: Path) -> None:
    read(tmp_path, HEADER + ROWS, changed(WIDE, rate_hz=240))
    refuse(
        tmp_path,
        HEADER + ROWS,
        changed(WIDE, rate_hz=120),
        "rate_hz: is 120, but the times in the file have a rate of 222",
    )


def test_a_pose_without_a_quality_is_flagged_as_low_quality(tmp_path: Path) -> None:
    mapping = changed(LONG, {"quality": "e", "quality_above": 2})
    lines = [f"{line},{end}\n" for line, end in zip(LONG_TEXT.splitlines(), ("e", "1", "", "3"), strict=True)]
    samples = read(tmp_path, "".join(lines), mapping)
    np.testing.assert_array_equal(samples.flags["low-quality"], [True, False, True])


@pytest.mark.parametrize("order", ["time", "receiver"])
@pytest.mark.parametrize(("rate_hz", "sd_ms"), [(120, 0.3), (120, 1.5), (120, 3.0), (240, 0.3), (240, 1.5)])
@pytest.mark.parametrize("lost", [0.0, 0.03])
def test_rows_with_jittered_times_are_put_into_the_recorded_frames(
    lost: float, rate_hz: float, sd_ms: float, order: str
) -> None:
    """The number of frames is right or reported as uncertain, and few rows are one frame off."""
    random, tracks = np.random.default_rng(4), {}
    for segment in map(str, range(12)):
        frame = np.flatnonzero(random.random(900) >= lost)
        time_s = frame / rate_hz + random.normal(0, sd_ms / 1000, len(frame))
        rows = np.argsort(time_s) if order == "time" else np.arange(len(frame))
        tracks[segment] = Track(rows, frame[rows], time_s[rows], np.zeros((len(rows), 7)))
    framed, notes, losses = framed_by_time(tracks)
    said = " ".join((*notes, *losses))
    frames = np.concatenate([track.frame for track in framed.values()])
    is_open = "the number of frames is uncertain" in said
    assert is_open == (lost > 0 and sd_ms / 1000 * rate_hz > 0.3)
    assert len(np.unique(frames)) == pytest.approx(900, rel=0.03 if is_open else 0)
    doubtful = re.search(r"about (\d+) may be a frame off", said)
    assert bool(doubtful) == (sd_ms / 1000 > 0.05 / rate_hz)
    off = int(np.count_nonzero(frames != np.concatenate([track.frame for track in tracks.values()])))
    if not is_open:
        assert off <= (2 * int(doubtful[1]) + 10 if doubtful else 0)
        assert order == "time" or off <= 0.5 * lost * len(frames)


@pytest.mark.parametrize("rows", ["long", "wide"])
@pytest.mark.parametrize(("bits", "apart"), [(8, 1), (16, 200), (32, 10**7)])
def test_an_overflowing_frame_counter_is_continued(tmp_path: Path, bits: int, apart: int, rows: str) -> None:
    """One of the receivers starts after the counter's first overflow."""
    frames = 2**bits - 20 * apart + apart * np.arange(4 * 2**bits // apart // 3 if bits == 8 else 60)
    counts = [(n % 2**bits, n - frames[0]) for n in frames]
    head, mapping = LONG_TEXT.splitlines()[0], changed(LONG, {"time": "x", "time_unit": "ms"})
    late = counts[30:]
    lines = [f"{n},{who},{t},0,0,0,0,0,1" for who, rows_of in ((1, counts), (2, late)) for n, t in rows_of]
    if rows == "wide":
        head, mapping = f"n,{HEADER.strip()}", changed(WIDE, {"frame": "n"})
        worn = [*[",,,,,"] * 30, *["4,5,6,0,0,0"] * len(late)]
        lines = [f"{n},{t},1,2,3,0,0,0,{second}" for (n, t), second in zip(counts, worn, strict=True)]
    samples = read(tmp_path, "\n".join([head, *lines, ""]), mapping)
    forearm, hand = (samples.frame[of(samples, segment)] for segment in ("forearm", "hand"))
    np.testing.assert_array_equal(forearm - forearm[0], frames - frames[0])
    np.testing.assert_array_equal(hand, forearm if rows == "wide" else forearm[30:])
    assert "the frame counter restarts after" in samples.notes[0]


def test_dates_are_read_and_nanoseconds_added(tmp_path: Path) -> None:
    text = TIMES.format("2026-03-04T10:15:30.120Z", '"2026-03-04 09:15:31,5-01:00"')
    for unit in ("s", "iso8601"):
        times_s = read(tmp_path, text, changed(WIDE, {"time_unit": unit})).time_s
        np.testing.assert_allclose(times_s[:2] - 1772619330, [0.12, 1.5], atol=1e-6)
    odd = TIMES.format("04.03.2026 10:15:30", "")
    refuse(tmp_path, odd, WIDE, "expected a number, or a date as 2026-03-04T10:15:30.120Z")
    mapping = changed(WIDE, {"time_unit": "s", "nanoseconds": "x1"})
    np.testing.assert_allclose(
        read(tmp_path, HEADER + ROWS, mapping).time_s[:2], [1e-9, 4.5 + 1.5e-9], rtol=1e-12
    )


def test_long_rows_are_put_into_frames_by_time_not_by_count(tmp_path: Path) -> None:
    """Each of two receivers lost a different row, so that counting rows would shift them by one frame."""
    csv = {key: value for key, value in LONG["csv"].items() if key != "frame"}
    mapping = LONG | {"csv": csv | {"time": "n", "time_unit": "ms"}}
    pairs = [(sensor, time) for sensor in (1, 2) for time in range(0, 50, 10)]
    kept = [pair for pair in pairs if pair not in ((1, 10), (2, 40))]
    rows = [f"{time},{sensor},{time},0,0,0,0,0,1\n" for sensor, time in kept]
    samples = read(tmp_path, LONG_TEXT.splitlines()[0] + "\n" + "".join(rows), mapping)
    np.testing.assert_array_equal(samples.frame, [0, 2, 3, 4, 0, 1, 2, 3])
    np.testing.assert_allclose(samples.numbers[:, 0], samples.frame * 10_000)
