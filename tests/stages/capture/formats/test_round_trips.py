"""Random recordings in every dress of text, by a writer of its own: what is read is what was put in."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_files import ARM, EXAMPLES, LIBERTY, of, read
from scipy.spatial.transform import Rotation

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.stages.capture.formats.tidy import NUMBERS
from shukotsu.stages.capture.samples import Samples

Array = np.ndarray
SEGMENTS = ("forearm", "hand")
MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
MISSING = ("-9999", "-9999.0", "n.d.", "1e30")


class Made:
    """A random recording: poses of two segments (T, 2, 7), NaN where a component is missing; times in s."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.frames = int(self.random.integers(2, 12))
        self.position = self.random.normal(0, 300, (self.frames, 2, 3)).round(4)
        turned = Rotation.random(2 * self.frames, random_state=seed).as_quat()
        self.quaternion = np.roll(turned, 1, -1).reshape(self.frames, 2, 4).round(12)
        self.lost = self.random.random((self.frames, 2, 7)) < 0.04
        self.step_s = float(self.random.choice([1 / 240, 0.01, 0.02]))
        self.time_s = np.arange(self.frames) * self.step_s + self.random.uniform(0, 100)
        self.cut, self.cut_between_lines = self.random.random() < 0.5, False

    def pick(self, *choices: Any) -> Any:
        """Pick one."""
        return choices[self.random.integers(len(choices))]

    def pose(self) -> Array:
        """Return the poses, (T, 2, 7), also where they are lost."""
        return np.concatenate([self.position, self.quaternion], -1)

    def check(self, samples: Samples, atol: float = 1e-6) -> None:
        """Check every sample by its time; poses that lack a number must not be whole, absent ones be said."""
        whole = ~self.lost.any(-1)
        seen = 0
        for place, segment in enumerate(SEGMENTS):
            own = of(samples, segment)
            numbers, time_s = samples.numbers[own], samples.time_s[own]
            timed = np.isfinite(time_s)  # a last row may end before its last number
            assert timed[:-1].all()
            assert timed.all() or self.cut
            numbers, time_s = numbers[timed], time_s[timed]
            row = np.abs(time_s[:, None] - self.time_s).argmin(1)
            np.testing.assert_allclose(time_s, self.time_s[row], atol=1e-3 * self.step_s)
            complete = np.isfinite(numbers).all(-1)
            wanted = whole[row, place]
            wanted[-1:] &= complete[-1:] | (not self.cut)
            np.testing.assert_array_equal(complete, wanted)
            expected = self.pose()[row, place]
            turned = np.abs((numbers[:, 3:] * expected[:, 3:]).sum(-1))
            np.testing.assert_allclose(numbers[complete, :3], expected[complete, :3], atol=atol)
            np.testing.assert_allclose(turned[complete], 1, atol=atol)
            seen += len(timed)
        assert seen == 2 * self.frames or samples.losses or self.cut_between_lines


def cut(text: str, made: Made) -> str:
    """Cut it somewhere in its last two lines, every second time."""
    if not made.cut:
        return text
    start = text.rstrip("\n").rfind("\n", 0, text.rstrip("\n").rfind("\n"))
    left = text[: int(made.random.integers(max(start, 1), len(text) + 1))]
    made.cut_between_lines = left.endswith(("\n", "\r", " "))  # a blank behind the number: it is whole
    return left


def read_text(
    name: str, text: str, layout: Layout, told: dict[str, Any] | None, **beside: str
) -> Samples | None:
    """Read such a file; None where it is refused."""
    with TemporaryDirectory() as folder:
        for other, content in {name: text, **beside}.items():
            Path(folder, other).write_text(content, "utf-8", newline="")
        try:
            return read(Path(folder, name), layout, told)
        except InputError:
            return None


def day_time(time_s: float) -> str:
    minutes, seconds = divmod(time_s % 86400, 60)
    return f"{int(minutes // 60):02d}:{int(minutes % 60):02d}:{seconds:09.6f}"


class Dress:
    """How a program writes numbers: unit, order, kind of orientation, decimal mark, padding, no value."""

    def __init__(self, made: Made) -> None:
        self.made = made
        self.unit = made.pick(*MM)
        self.kind = made.pick("quaternion", "euler", "matrix")
        self.order, self.axes = made.pick("wxyz", "xyzw"), made.pick("ZYX", "XYZ", "ZXZ", "YXZ")
        self.angle, self.rotates = made.pick("deg", "rad"), made.pick("receiver", "transmitter")
        self.decimal = made.pick(".", ",")
        self.delimiter = made.pick(";", "tab") if self.decimal == "," else made.pick(",", ";", "tab")
        self.missing, self.pad = made.pick(*MISSING), made.pick("", " ")
        self.of_day = bool(made.random.random() < 0.5)
        if self.of_day:  # over midnight, a receiver a little ahead of the other
            made.time_s = made.time_s - made.time_s[made.frames // 2] + 86400 + made.pick(-1e-4, 0, 1e-4)

    @property
    def orientation(self) -> dict[str, Any]:
        """Return what a mapping says of it."""
        other = "transmitter" if self.rotates == "receiver" else "receiver"
        more = {
            "quaternion": {"order": self.order},
            "euler": {"axes": self.axes, "unit": self.angle},
            "matrix": {},
        }
        return {"kind": self.kind, "rotates": f"{self.rotates}-to-{other}", **more[self.kind]}

    def cell(self, value: float, lost: bool = False) -> str:
        """Write a number, or in any spelling that there is none."""
        if lost:
            spelled = self.made.pick(self.missing, "", "NaN")
            if spelled == "-9999":
                spelled = self.made.pick("-9999", "-9999.00", "-9.999e3")
            text = spelled.replace(".", self.decimal) if spelled != "n.d." else spelled
        else:
            text = repr(float(value)).replace(".", self.decimal)
        return self.pad + text + self.pad

    def pose(self, row: int, place: int) -> list[str]:
        """Write a pose."""
        turned = Rotation.from_quat(np.roll(self.made.quaternion[row, place], -1))
        turned = turned if self.rotates == "receiver" else turned.inv()
        if self.kind == "quaternion":
            numbers = turned.as_quat() if self.order == "xyzw" else np.roll(turned.as_quat(), 1)
        elif self.kind == "euler":
            numbers = turned.as_euler(self.axes, degrees=self.angle == "deg")
        else:
            numbers = turned.as_matrix().ravel()
        lost = self.made.lost[row, place]
        position = [
            self.cell(v / MM[self.unit], bool(lost[i])) for i, v in enumerate(self.made.position[row, place])
        ]
        return position + [self.cell(v, bool(lost[3:].any() and i == 1)) for i, v in enumerate(numbers)]

    def time(self, row: int, ahead_s: float = 0.0) -> str:
        """Write a time."""
        time_s = self.made.time_s[row] + ahead_s
        return day_time(time_s) if self.of_day else self.cell(time_s)

    def table(self, rows: list[list[str]], titles: list[str]) -> str:
        """Write the whole."""
        mark = {"tab": "\t"}.get(self.delimiter, self.delimiter)
        end = self.made.pick("\n", "\r\n")
        return end.join([mark.join(row) for row in [titles, *rows]]) + end

    def mapping(self, receivers: dict[str, Any], **csv: Any) -> dict[str, Any]:
        """Return the mapping that reads it."""
        table = {
            "delimiter": self.delimiter,
            "decimal": self.decimal,
            "missing": [self.missing.replace("-9999.0", "-9999")],
            "time_unit": "hh:mm:ss" if self.of_day else "s",
        }
        told = {"format": "csv", "position_unit": self.unit, "orientation": self.orientation}
        return told | {"receivers": receivers, "csv": table | csv}


NUMBERS_OF = {"quaternion": 4, "euler": 3, "matrix": 9}
seeds = given(st.integers(0, 2**31))
often = settings(max_examples=EXAMPLES, deadline=None)


def titles_of(dress: Dress, end: str) -> tuple[list[str], list[str]]:
    return [f"{axis}{end}" for axis in "xyz"], [f"r{i}{end}" for i in range(NUMBERS_OF[dress.kind])]


@seeds
@often
def test_wide_tables(seed: int) -> None:
    made = Made(seed)
    dress = Dress(made)
    columns = [titles_of(dress, str(place)) for place in range(2)]
    titles = [title for own in columns for part in own for title in part]
    last = made.pick(True, False)
    rows = [dress.pose(row, 0) + dress.pose(row, 1) for row in range(made.frames)]
    rows = [[*own, dress.time(row)] if last else [dress.time(row), *own] for row, own in enumerate(rows)]
    text = dress.table(rows, [*titles, "t"] if last else ["t", *titles])
    receivers = {
        segment: {"position": own[0], "orientation": own[1]}
        for segment, own in zip(SEGMENTS, columns, strict=True)
    }
    samples = read_text("a.txt", cut(text, made), ARM, dress.mapping(receivers, time="t"))
    assert samples is not None or made.cut
    if samples is not None:
        made.check(samples)


@seeds
@often
def test_long_tables_are_framed_by_their_times(seed: int) -> None:
    """One receiver's stamps are a little ahead, in rows of any order, some rows lost; also over midnight."""
    made = Made(seed)
    dress = Dress(made)
    position, orientation = titles_of(dress, "")
    ahead_s = float(made.random.uniform(-0.3, 0.3)) * made.step_s
    kept = made.random.random((made.frames, 2)) > 0.15
    kept[:2] = True
    pairs = [(row, place) for row in range(made.frames) for place in range(2) if kept[row, place]]
    if made.pick(True, False):
        pairs.sort(key=lambda pair: pair[1])
    rows = [
        [str(place + 1), dress.time(row, ahead_s * place), *dress.pose(row, place)] for row, place in pairs
    ]
    text = dress.table(rows, ["sensor", "t", *position, *orientation])
    receivers = {segment: {"value": place + 1} for place, segment in enumerate(SEGMENTS)}
    columns = {"position": position, "orientation": orientation, "receiver": "sensor", "time": "t"}
    samples = read_text("a.txt", cut(text, made), ARM, dress.mapping(receivers, rows="long", **columns))
    assert samples is not None or made.cut
    if samples is None:
        return
    row_of = []
    for place, segment in enumerate(SEGMENTS):
        own = of(samples, segment)
        row = np.abs(samples.time_s[own][:, None] - ahead_s * place - made.time_s).argmin(1)
        np.testing.assert_allclose(samples.time_s[own] - ahead_s * place, made.time_s[row], atol=2e-6)
        row_of.append(dict(zip(samples.frame[own].tolist(), row.tolist(), strict=True)))
        assert len(row_of[-1]) == len(row)
        complete = np.isfinite(samples.numbers[own]).all(-1)
        wanted = ~made.lost[row, place].any(-1)
        wanted[-1:] &= complete[-1:] | (not made.cut)
        np.testing.assert_array_equal(complete, wanted)
        expected = made.position[row, place]
        np.testing.assert_allclose(samples.numbers[own][complete, :3], expected[complete], atol=1e-6)
    forearm, hand = row_of
    assert all(forearm[frame] == hand[frame] for frame in forearm.keys() & hand.keys())
    both = set(forearm.values()) & set(hand.values())
    assert len(forearm.keys() & hand.keys()) == len(both)
    assert sum(map(len, row_of)) == len(pairs) or samples.losses or made.cut_between_lines


@seeds
@often
def test_tidy_tables(seed: int) -> None:
    made = Made(seed)
    order = made.random.permutation(["frame", "time_s", "segment", *NUMBERS]).tolist()
    lines = [",".join(order)]
    for row in range(made.frames):
        for place, segment in enumerate(SEGMENTS):
            values = np.where(made.lost[row, place], np.nan, made.pose()[row, place])
            texts = [made.pick("", "NaN", " null ") if np.isnan(v) else repr(float(v)) for v in values]
            cells = dict(zip(NUMBERS, texts, strict=True))
            cells |= {"frame": str(row), "time_s": repr(float(made.time_s[row])), "segment": segment}
            lines.append(",".join(cells[name] for name in order))
    samples = read_text("a.csv", cut("\n".join(lines) + "\n", made), LIBERTY, None)
    assert samples is not None or made.cut
    if samples is not None:
        made.check(samples)


@pytest.mark.parametrize("end", ["205.871", "205.87", "205.", "20", "2", ""])
def test_a_last_number_that_may_be_cut_off_is_never_read(end: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        "frame,time_s,segment,qw,qx,qy,qz,x_mm,y_mm,z_mm\n0,0,hand,1,0,0,0,1,2,3\n1,1,hand,1,0,0,0,1,2," + end
    )
    samples = read(tmp_path / "a.csv", LIBERTY)
    np.testing.assert_array_equal(samples.frame, [0])
    assert samples.losses == samples.notes
    assert "the last line has no line end" in samples.losses[0]
