"""Files of other trackers' programs: poses -> file -> inspection's draft -> import are the poses.

Each writer is of a documented form, in two dresses; what is missing is written as the form has it.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from guide_pages import REPOSITORY, blocks
from recording_files import ARM, LIBERTY, of, read, refuse
from scipy.spatial.transform import Rotation

from shukotsu.schemas.layout import Layout
from shukotsu.stages.capture.inspect_file import describe

FRAMES = 60
SEGMENTS = ("upper_arm", "forearm", "hand")
UNITS = {"mm": 1.0, "m": 1000.0}
TOLD = {"rotates": "receiver-to-transmitter"}
CALLED = {f"CHECK_{tool}": segment for tool, segment in enumerate(SEGMENTS, 1)}
Written = tuple[str, str | bytes, dict[str, str]]
"""A file's name and content, and what the draft is told for each CHECK."""


class Poses:
    """Random walks of tools: mm (T, N, 3), turned (T, N, 4) wxyz, lost (T, N), time_s (T,)."""

    def __init__(self, tools: int) -> None:
        random = np.random.default_rng(1)
        self.tools, self.time_s = tools, np.arange(FRAMES) / 100
        self.mm = 200 + np.cumsum(random.normal(0, 6, (FRAMES, tools, 3)), 0)
        turned = Rotation.from_rotvec(np.cumsum(random.normal(0, 0.1, (FRAMES * tools, 3)), 0))
        self.turned = turned.as_quat(scalar_first=True).reshape(FRAMES, tools, 4)
        self.lost = random.random((FRAMES, tools)) < 0.1

    def check(
        self, path: Path, mapping: dict[str, Any] | None, names: tuple[str, ...], layout: Layout
    ) -> None:
        """Read the file: what is lost is a gap, the rest the poses to the file's decimals."""
        samples = read(path, layout, mapping)
        assert len(samples.frame) == FRAMES * self.tools
        for tool, segment in enumerate(names[: self.tools]):
            numbers, kept = samples.numbers[of(samples, segment)], ~self.lost[:, tool]
            np.testing.assert_array_equal(np.isfinite(numbers).all(-1), kept)
            np.testing.assert_allclose(numbers[kept, :3], self.mm[kept, tool], atol=1e-3)
            turned = np.abs((numbers[kept, 3:] * self.turned[kept, tool]).sum(-1))
            np.testing.assert_allclose(turned, 1, atol=1e-6)
            since_s = samples.time_s[of(samples, segment)] - samples.time_s.min()
            np.testing.assert_allclose(since_s, self.time_s, atol=1e-4)

    def lines(
        self, mark: str, lead: Callable[[int], list[Any]], cells: Callable[[int, int], list[Any]]
    ) -> list[str]:
        """Write a row a frame: what leads it, and each tool's cells; numbers with seven decimals."""
        rows = [[*lead(t), *(cell for i in range(self.tools) for cell in cells(t, i))] for t in range(FRAMES)]
        return [mark.join(f"{c:.7f}" if isinstance(c, float) else str(c) for c in row) for row in rows]


def wave(poses: Poses, named: bool, mark: str) -> Written:
    """NDI Wave: a constant and the word missing where there is no pose."""

    def cells(t: int, i: int) -> list[Any]:
        lost = poses.lost[t, i]
        return (
            [i + 1, "missing", *["-3.697314E28"] * 7]
            if lost
            else [i + 1, "ok", *poses.turned[t, i], *poses.mm[t, i]]
        )

    kinds = ("Id", "Status", "Q0", "Qx", "Qy", "Qz", "X", "Y", "Z")
    titles = [
        f"Sensor {i + 1} {k}" if named or k in kinds[:2] else k for i in range(poses.tools) for k in kinds
    ]
    text = [mark.join(["Time", *titles]), *poses.lines(mark, lambda t: [poses.time_s[t]], cells)]
    return "wave.tsv", "\n".join(text) + "\n", {"position_unit": "mm", "time_unit": "s", **TOLD, **CALLED}


def aurora(poses: Poses, row_end: str, header_end: str) -> Written:
    """NDI Aurora: a comma behind each row or behind the header alone."""

    def cells(t: int, i: int) -> list[Any]:
        pose = [*[""] * 8] if poses.lost[t, i] else [*poses.turned[t, i], *poses.mm[t, i], 0.1]
        return [f"0{i}", "Missing" if poses.lost[t, i] else "OK", *pose]

    titles = ["Frame", "Tools", "Hour", "Minutes", "Seconds"]
    titles += ["Port", "State", "Q0", "Qx", "Qy", "Qz", "Tx", "Ty", "Tz", "Error"] * poses.tools
    rows = poses.lines(",", lambda t: [5 + t, poses.tools, 10, t // 30, t % 30 * 0.5 + 20], cells)
    text = "\r\n".join([",".join(titles) + header_end, *(row + row_end for row in rows)])
    return "aurora.csv", text, {"position_unit": "mm", "rate_hz": "100", **TOLD, **CALLED}


def motive(poses: Poses, unit: str, parent: bool, names: tuple[str, ...] = SEGMENTS) -> Written:
    """OptiTrack Motive: rotations x y z w, named as segments, with a marker that belongs to each."""

    def cells(t: int, i: int) -> list[Any]:
        place = poses.mm[t, i] / UNITS[unit]
        return (
            [""] * 11
            if poses.lost[t, i]
            else [*np.roll(poses.turned[t, i], -1), *place, 0.1, *(place + 0.01)]
        )

    body, kinds = ["Rigid Body"] * 8 + ["Rigid Body Marker"] * 3, ["Rotation"] * 4 + ["Position"] * 3
    rows = [["Type", *body * poses.tools]]
    rows += [
        ["Name", *(name for tool in names[: poses.tools] for name in [tool] * 8 + [f"{tool}:Marker1"] * 3)]
    ]
    rows += [["ID", *(str(17 + i) for i in range(poses.tools) for _ in body)]]
    rows += [["Parent", *[""] * 11 * poses.tools]] * parent
    rows += [["", *[*kinds, "Mean Marker Error", *kinds[-3:]] * poses.tools]]
    head = f"Format Version,1.23,Rotation Type,Quaternion,Length Units,{'Meters' if unit == 'm' else 'Millimeters'}"
    text = [head, "", *("," + ",".join(row) for row in rows)]
    text += [",".join(["Frame,Time (Seconds)", *[*"XYZWXYZ", "", *"XYZ"] * poses.tools])]
    return (
        "motive.csv",
        "\n".join([*text, *poses.lines(",", lambda t: [t, poses.time_s[t]], cells)]) + "\n",
        TOLD,
    )


def inertial(poses: Poses, mark: str, per_s: int) -> Written:
    """A program of a lab: dates in ms or ns, numbers of an inertial sensor between poses."""

    def cells(t: int, i: int) -> list[Any]:
        pose = ["NaN"] * 7 if poses.lost[t, i] else [*poses.mm[t, i] / 10, *poses.turned[t, i]]
        return [*pose, *np.random.default_rng(t).normal(0, 1, 9)]

    titles = ["stamp"]
    for n in range(1, poses.tools + 1):
        titles += [f"loc{n}_{axis}" for axis in "xyz"] + [f"{axis}{n}" for axis in "wxyz"]
        titles += [f"{kind}{n}_{axis}" for kind in ("acc", "gyro", "mag_field_uT") for axis in "xyz"]
    rows = poses.lines(mark, lambda t: [1_700_000_000 * per_s + t * per_s // 100], cells)
    return "lab.txt", "\n".join([mark.join(titles), *rows]) + "\n", {"position_unit": "cm", **TOLD, **CALLED}


def sequence(poses: Poses, nrrd: bool, names: tuple[str, ...] = SEGMENTS) -> Written:
    """PLUS: a header before images, which are no text."""
    sign, lines = (
        (":=", ["NRRD0004", "type: uchar"]) if nrrd else (" = ", ["ObjectType = Image", "NDims = 3"])
    )
    for t in range(FRAMES):
        for i, tool in enumerate(names[: poses.tools]):
            whole = np.eye(4)
            if not poses.lost[t, i]:
                whole[:3, :3] = Rotation.from_quat(poses.turned[t, i], scalar_first=True).as_matrix()
                whole[:3, 3] = poses.mm[t, i]
            name = f"Seq_Frame{t:04d}_{tool}ToTrackerTransform"
            lines += [f"{name}{sign}{' '.join(f'{number:.7f}' for number in whole.ravel())}"]
            lines += [f"{name}Status{sign}{'MISSING' if poses.lost[t, i] else 'OK'}"]
        lines += [f"Seq_Frame{t:04d}_ImageToProbeTransform{sign}{'0 ' * 16}"]
        lines += [f"Seq_Frame{t:04d}_Timestamp{sign}{poses.time_s[t]:.4f}"]
    text = "\n".join([*lines, "" if nrrd else "ElementDataFile = LOCAL"]) + "\n"
    return "a.seq.nrrd" if nrrd else "a.igs.mha", text.encode() + bytes(range(255, 0, -1)), {}


def glove(poses: Poses, order: str, stamped: bool) -> Written:
    """An electromagnetic glove: a message a line, keys by name, or quaternions as lists."""
    lines = []
    for t in range(FRAMES):
        sensors: list[Any] = []
        for i in range(poses.tools):
            turned: Any = [*poses.turned[t, i]]
            turned = dict(zip("wxyz", turned, strict=True)) if order else turned
            pose = {"position": dict(zip("xyz", poses.mm[t, i] / 1000, strict=True)), "orientation": turned}
            sensors.append({} if poses.lost[t, i] else pose)
        stamp: Any = {"sec": 1_700_000_000, "nanosec": t * 10**7} if stamped else poses.time_s[t]
        lines.append(json.dumps({"header": {"stamp": stamp}, "side": "right", "raw_sensor": sensors}))
    more = {} if stamped else {"time_unit": "s"}
    more |= {} if order else {"order": "wxyz"}
    return "glove.jsonl", "\n".join(lines), TOLD | more | {"position_unit": "m"} | CALLED


FORMS: list[tuple[Callable[..., Written], tuple[Any, ...]]] = [
    *((wave, dress) for dress in ((True, "\t"), (False, ","))),
    *((aurora, dress) for dress in ((",", ""), ("", ","))),
    *((motive, dress) for dress in (("mm", False), ("m", True))),
    *((inertial, dress) for dress in ((";", 10**3), ("\t", 10**9))),
    *((sequence, dress) for dress in ((False,), (True, ("UpperArm", "Forearm", "Hand")))),
    *((glove, dress) for dress in (("", False), ("by name", True))),
]


@pytest.mark.parametrize("tools", [2, 3])
@pytest.mark.parametrize(("write", "dress"), FORMS)
def test_a_draft_reads_what_was_written(
    tmp_path: Path, write: Callable[..., Written], dress: tuple[Any, ...], tools: int
) -> None:
    poses = Poses(tools)
    name, content, answers = write(poses, *dress)
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    draft = describe(path, ARM).draft
    for key, value in answers.items():
        pattern, put = (
            (rf"^  {key}:", f"  {value}:") if key in CALLED else (rf"^( *{key}:) CHECK.*$", rf"\1 {value}")
        )
        draft, count = re.subn(pattern, put, draft, flags=re.MULTILINE)
        assert count == (key not in CALLED or int(key[-1]) <= tools), (key, draft)
    poses.check(path, yaml.safe_load(draft) if draft else None, SEGMENTS, ARM)


MAPPINGS = [
    mapping
    for block in blocks(REPOSITORY / "docs" / "mappings.md", "yaml")
    if "index_distal" in (mapping := yaml.safe_load(block.text))["receivers"]
]
DOCUMENTED: dict[str, tuple[Callable[..., Written], tuple[Any, ...]]] = {
    "Q0 #1": (wave, (False, "\t")),
    "hand Position X": (motive, ("mm", False, ("hand", "tip"))),
    "sequence": (sequence, (False, ("Hand", "Stylus"))),
    "raw_sensor": (glove, ("", False)),
}


@pytest.mark.parametrize("form", DOCUMENTED)
def test_the_guides_mapping_reads_it(tmp_path: Path, form: str) -> None:
    (mapping,) = (mapping for mapping in MAPPINGS if form in str(mapping))
    write, dress = DOCUMENTED[form]
    poses = Poses(2)
    name, content, _ = write(poses, *dress)
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    poses.check(path, mapping, tuple(mapping["receivers"]), LIBERTY)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.igs.mha", b"ObjectType = Image\nSeq_Frame0000_ATo", "its header has no end"),
        ("a.mha", b"NDims = 3\nElementDataFile = LOCAL\n", "no transform of a frame"),
        ("a.nrrd", b"NRRD0004\nSeq_Frame0000_AToBTransform:=1 0\n\n", "line 2: expected 16 numbers"),
        (
            "a.nrrd",
            b"NRRD0004\nSeq_Frame0000_AToBTransform:=" + b"0 " * 16 + b"\n\n",
            "no segment|is not in layout",
        ),
    ],
)
def test_a_sequence_that_cannot_be_read(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    refuse(tmp_path / name, message)


def test_what_is_no_pose_is_not_drafted(tmp_path: Path) -> None:
    """Such as a quaternion by name whose norm is not 1, an object of JSON that is cut off, and angular rates."""
    random = np.random.default_rng(3)
    titles = "t,qw,qx,qy,qz,ax,ay,az,gx,gy,gz"
    rows = [",".join(map(str, [t / 100, *random.normal(0, 2, 10)])) for t in range(40)]
    (tmp_path / "a.csv").write_text("\n".join([titles, *rows]) + "\n")
    assert "CHECK: {}" in describe(tmp_path / "a.csv", ARM).draft
    (tmp_path / "a.jsonl").write_text('{"a": 1}\n{"a": ')
    mapping = next(mapping for mapping in MAPPINGS if "raw_sensor" in str(mapping))
    refuse(tmp_path / "a.jsonl", "line 2: is no whole JSON object", LIBERTY, mapping)
