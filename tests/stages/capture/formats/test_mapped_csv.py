"""Tables as text by mapping: every dress a program gives them, and each fault named where it stands."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recording_files
from recording_files import ARM, of

from schemas.errors import InputError
from skeleton.rotations import matrix, unit
from stages.capture.formats.mapped_csv import read_mapped_csv
from stages.capture.samples import Samples

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


def read(tmp_path: Path, text: str, told: dict[str, Any]) -> Samples:
    (tmp_path / "old.txt").write_bytes(text.encode())
    return recording_files.read(tmp_path / "old.txt", ARM, told)


def refuse(tmp_path: Path, text: str, told: dict[str, Any], message: str) -> None:
    (tmp_path / "old.txt").write_bytes(text.encode())
    recording_files.refuse(tmp_path / "old.txt", message, ARM, told)


def check_wide(samples: Samples) -> None:
    forearm, hand = of(samples, "forearm"), of(samples, "hand")
    np.testing.assert_allclose(samples.numbers[forearm, :3], [[10, 20, 30], [15, 20, 30]])
    np.testing.assert_allclose(samples.numbers[forearm, 3:], [[HALF, 0, 0, HALF], [HALF, 0, HALF, 0]])
    np.testing.assert_allclose(samples.numbers[hand, 3:], [[1, 0, 0, 0], [HALF, HALF, 0, 0]])
    for segment in (forearm, hand):
        np.testing.assert_array_equal(samples.frame[segment], [0, 1])
        np.testing.assert_allclose(samples.time_s[segment], [0, 0.0045])


def test_positions_of_another_frame_than_the_rotations(tmp_path: Path) -> None:
    """The axes as `position_axes` takes them from the file; a segment that stands still stays where it is."""
    samples = read(tmp_path, HEADER + ROWS, changed(WIDE, position_axes=["z", "-x", "y"]))
    np.testing.assert_allclose(samples.numbers[of(samples, "forearm"), :3], [[30, -10, 20], [30, -15, 20]])
    np.testing.assert_allclose(samples.numbers[of(samples, "hand"), 3:], [[1, 0, 0, 0], [HALF, HALF, 0, 0]])
    long = changed(LONG, position_axes=["y", "x", "-z"], fixed=["upper_arm"])
    samples = read(tmp_path, LONG_TEXT, long)
    np.testing.assert_allclose(samples.numbers[of(samples, "forearm"), :3], [[5000, 4000, -6000]])
    np.testing.assert_allclose(samples.numbers[of(samples, "upper_arm"), :3], 0)


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
def test_times_of_the_day(tmp_path: Path, first: str, second: str, expected: list[float]) -> None:
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


def numbered(header: str) -> dict[str, Any]:
    """The wide mapping with its columns by number."""
    names = header.strip().split(",")
    receivers = {
        segment: {key: [names.index(name) + 1 for name in columns] for key, columns in group.items()}
        for segment, group in WIDE["receivers"].items()  # type: ignore[attr-defined]
    }
    return WIDE | {"receivers": receivers, "csv": {"time": 1, "time_unit": "ms"}}


@pytest.mark.parametrize(
    ("text", "csv"),
    {
        "plain": (HEADER + ROWS, {}),
        "bom": ("\ufeff" + HEADER + ROWS, {}),
        "crlf": ((HEADER + ROWS).replace("\n", "\r\n"), {}),
        "cr": ((HEADER + ROWS).replace("\n", "\r"), {}),
        "semicolons": ((HEADER + ROWS).translate(SEMICOLONS), {"delimiter": ";", "decimal": ","}),
        "tabs": ((HEADER + ROWS).replace(",", "\t"), {"delimiter": "tab"}),
        "blanks": ("  " + (HEADER + ROWS).replace(",", "  ").replace("\n", " \n "), {"delimiter": "space"}),
        "comments": ("# made by\n" + HEADER + "  # a, note\n" + ROWS, {"comment": "#"}),
        "skipped": ("made by\n\n" + HEADER + "\n" + ROWS, {"skip_lines": 1}),
        "spaces": ((HEADER + ROWS).replace(",", " , "), {}),
        "more columns": ((HEADER + ROWS).replace("\n", ",n\n"), {}),
    }.values(),
)
def test_a_wide_table_in_any_dress(tmp_path: Path, text: str, csv: dict[str, Any]) -> None:
    check_wide(read(tmp_path, text, changed(WIDE, csv)))


def test_a_table_without_a_header_goes_by_numbers(tmp_path: Path) -> None:
    told = numbered(HEADER)
    check_wide(read(tmp_path, ROWS, changed(told, {"header": False})))
    check_wide(read(tmp_path, HEADER.replace("x1", "same").replace("x2", "same") + ROWS, told))
    bare = changed(told, {"header": False})
    message = "old.txt: line 2, column number 2: is 'left'; expected a number"
    refuse(tmp_path, ROWS.replace("4.5,1.5", "4.5,left"), bare, message)
    told["receivers"]["hand"]["position"] = [8, 9, 14]
    refuse(tmp_path, ROWS, bare, "receivers.hand.position: there is no column 14; ")


def test_a_long_table(tmp_path: Path) -> None:
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
    assert samples.place(int(np.flatnonzero(hand)[1])) == f"{tmp_path}/old.txt: line 4"


def test_receivers_of_a_long_table_that_only_one_side_names(tmp_path: Path) -> None:
    samples = read(tmp_path, LONG_TEXT.replace("7,1,4", "7,3,4"), LONG)
    assert samples.notes == (
        "receiver '1' of segment forearm has no row",
        "receivers that the mapping names no segment for are left out: 3 (1 rows)",
    )
    assert of(samples, "hand").all()
    told = changed(LONG, receivers={"hand": {"value": "left"}})
    refuse(tmp_path, LONG_TEXT, told, "none of the values left stands in column sensor of the table")


def test_rows_are_counted_only_where_that_is_safe(tmp_path: Path) -> None:
    told = changed(LONG, rate_hz=50)
    np.testing.assert_allclose(read(tmp_path, LONG_TEXT, told).time_s, [0, 0, 0.04])
    del told["csv"]["frame"]
    refuse(tmp_path, LONG_TEXT, told, "has 2 rows of hand and 1 of forearm; which belong together is told by")
    samples = read(tmp_path, LONG_TEXT + "9,1,4,5,6,0,0,0,1\n", told)
    for segment in ("hand", "forearm"):
        np.testing.assert_array_equal(samples.frame[of(samples, segment)], [0, 1])
        np.testing.assert_allclose(samples.time_s[of(samples, segment)], [0, 0.02])


def of_hand(key: str, column: object) -> dict[str, Any]:
    """The receivers of the wide mapping with one key of the hand's set."""
    receivers: dict[str, Any] = WIDE["receivers"]  # type: ignore[assignment]
    return receivers | {"hand": receivers["hand"] | {key: column}}


def test_a_receivers_own_time_goes_before_the_shared_one(tmp_path: Path) -> None:
    text = HEADER.strip() + ",t2\n" + ROWS.replace("0,0,0\n", "0,0,0,2\n").replace("0,0,90\n", "0,0,90,\n")
    samples = read(tmp_path, text, changed(WIDE, receivers=of_hand("time", "t2")))
    np.testing.assert_allclose(samples.time_s[of(samples, "hand")], [0.002, np.nan])
    np.testing.assert_allclose(samples.time_s[of(samples, "forearm")], [0, 0.0045])


def test_texts_that_mean_no_value(tmp_path: Path) -> None:
    text = HEADER + "0,1,2,3,,0,0,-9999,-9999,-9999, -9999 ,-9999,-9999\n4,NaN,NA,null,0,0,0,1,2,3,0,0,0\n"
    samples = read(tmp_path, text, changed(WIDE, {"missing": ["-9999"]}))
    gaps = np.isnan(samples.numbers)
    assert gaps[of(samples, "forearm")].tolist() == [[False] * 3 + [True] * 4, [True] * 3 + [False] * 4]
    assert gaps[of(samples, "hand")].tolist() == [[True] * 7, [False] * 7]


@pytest.mark.parametrize(
    ("limit", "marked"),
    [({"quality_above": 3}, [True, False]), ({"quality_below": 3}, [False, True])],
)
def test_a_quality_beyond_its_limit_is_marked(
    tmp_path: Path, limit: dict[str, float], marked: list[bool]
) -> None:
    text = HEADER.strip() + ",q\n" + ROWS.replace("0,0,0\n", "0,0,0,5\n").replace("0,0,90\n", "0,0,90,1\n")
    samples = read(tmp_path, text, changed(WIDE, limit, receivers=of_hand("quality", "q")))
    assert samples.marks["low-quality"][of(samples, "hand")].tolist() == marked
    assert not samples.marks["low-quality"][of(samples, "forearm")].any()


IN_RAD = ANGLES | {"unit": "rad"}
TWICE = "column {}1 is used 2 times, for forearm and hand; is that right?"


@pytest.mark.parametrize(
    ("told", "notes"),
    [
        (WIDE, []),
        (
            changed(WIDE, orientation=IN_RAD),
            ["angles reach 90, more than two pi, though orientation.unit is rad; are they degrees?"],
        ),
        (changed(WIDE, receivers=of_hand("orientation", ["az2", "el2", "ro1"])), [TWICE.format("ro")]),
        (
            changed(WIDE, receivers=of_hand("position", ["x1", "y1", "z1"])),
            [*map(TWICE.format, "xyz")],
        ),
    ],
)
def test_what_is_doubtful_is_noted(tmp_path: Path, told: dict[str, Any], notes: list[str]) -> None:
    assert list(read(tmp_path, HEADER + ROWS, told).notes) == notes


def test_small_angles_may_be_in_radians(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER + ROWS.replace("90", "1.5"), changed(WIDE, orientation=IN_RAD)).notes == ()


def test_receivers_that_are_not_in_step_go_on_a_grid_once_each(tmp_path: Path) -> None:
    """Rows repeat what has not changed; of two new values on one frame the nearer is kept. One time that is
    no time costs its own row: as the start of the grid it would put all others on one frame.
    """
    receivers = {
        segment: {"position": [f"{c}{n}" for c in "xyz"], "orientation": [f"{c}{n}" for c in "wabc"]}
        for segment, n in (("forearm", 1), ("hand", 2))
    }
    told = {
        "format": "csv",
        "position_unit": "mm",
        "rate_hz": 100,
        "orientation": {"kind": "quaternion", "order": "wxyz"},
        "receivers": receivers,
        "csv": {"time": "t", "time_unit": "s", "in_step": False},
    }
    rows = [(0.0, 1, 1), (0.008, 1, 2), (0.011, 2, 3), (0.014, 2, 4), (0.03, 2, 4), (0.04, 1, 5)]
    rows += [(-1e300, 9, 9)]
    lines = [f"{time},{one},0,0,1,0,0,0,{other},0,0,1,0,0,0\n" for time, one, other in rows]
    samples = read(tmp_path, "t,x1,y1,z1,w1,a1,b1,c1,x2,y2,z2,w2,a2,b2,c2\n" + "".join(lines), told)
    for segment, frame, x_mm, time_s in (
        ("forearm", [0, 1, 4], [1, 2, 1], [0, 0.011, 0.04]),
        ("hand", [0, 1, 4], [1, 3, 5], [0, 0.011, 0.04]),
    ):
        own = of(samples, segment)
        np.testing.assert_array_equal(samples.frame[own], frame)
        np.testing.assert_array_equal(samples.numbers[own, 0], x_mm)
        np.testing.assert_array_equal(samples.time_s[own], time_s)
    assert "segment forearm: 3 new values in 7 rows; 0 left out" in samples.notes[0]
    assert samples.notes[1] == "segment forearm: 1 new values left out, whose times are years off the others'"
    assert "segment hand: 5 new values in 7 rows; 2 left out" in samples.notes[2]


@pytest.mark.parametrize(
    ("text", "csv", "message"),
    [
        ("", {}, "old.txt: is empty; expected a table"),
        (HEADER, {}, "old.txt: has no rows"),
        (HEADER + ROWS + "1,2,3\n", {}, "old.txt: line 4: has 3 cells; expected 13 as in the first line"),
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
def test_what_is_refused(tmp_path: Path, text: str, csv: dict[str, Any], message: str) -> None:
    refuse(tmp_path, text, changed(WIDE, csv), message)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    recording_files.refuse(tmp_path / "odd.txt", "no such file", ARM, WIDE)
    (tmp_path / "odd.txt").write_bytes("Größe".encode("latin-1"))
    recording_files.refuse(tmp_path / "odd.txt", "line 1: is not UTF-8 text", ARM, WIDE)
    with pytest.raises(InputError, match="needs a mapping that says its units"):
        read_mapped_csv(tmp_path / "odd.txt", ARM, None)
    message = "fixed: segment 'bench' is not in layout arm"
    refuse(tmp_path, HEADER + ROWS, changed(WIDE, fixed=["bench"]), message)


def test_matrices_of_the_inverse_come_back(tmp_path: Path) -> None:
    """In blanks, with decimal commas and no header: the rotations they were written from, to their digits."""
    rng = np.random.default_rng(7)
    turned = matrix(unit(rng.normal(size=(5, 4))))
    cells = np.concatenate([rng.normal(size=(5, 3)), turned.reshape(5, 9)], 1)
    text = "".join("  ".join(f"{v:.9f}".replace(".", ",") for v in row) + "\n" for row in cells)
    told = {
        "format": "csv",
        "position_unit": "inch",
        "orientation": {"kind": "matrix", "rotates": "transmitter-to-receiver"},
        "receivers": {"hand": {"position": [1, 2, 3], "orientation": list(range(4, 13))}},
        "csv": {"delimiter": "space", "decimal": ",", "header": False},
    }
    samples = read(tmp_path, text, told)
    np.testing.assert_allclose(samples.numbers[:, :3], cells[:, :3] * 25.4, atol=1e-6)
    np.testing.assert_allclose(matrix(samples.numbers[:, 3:]), np.swapaxes(turned, 1, 2), atol=1e-7)
