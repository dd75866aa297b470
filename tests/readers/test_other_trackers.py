"""Files of other trackers, written as documented, are read with inspect's draft or the guide's mapping."""

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

from shukotsu.commands.inspect_file import describe

FRAMES = 60
SEGMENTS = ("upper_arm", "forearm", "hand")
ROTATES = {"rotates": "receiver-to-transmitter"}
CALLED = {f"CHECK_{tool}": segment for tool, segment in enumerate(SEGMENTS, 1)}
Written = tuple[str, list[str], dict[str, str]]
"""A file's name and lines, and the answer to each CHECK of the draft."""
Row = Callable[..., list[Any]]


class Poses:
    """Random walks of N tools: mm (T, N, 3), turned (T, N, 4) as w, x, y, z, lost (T, N), time_s (T,)."""

    def __init__(self, tools: int) -> None:
        random = np.random.default_rng(1)
        self.tools, self.time_s = tools, np.arange(FRAMES) / 100
        self.mm = 200 + np.cumsum(random.normal(0, 6, (FRAMES, tools, 3)), 0)
        turned = Rotation.from_rotvec(np.cumsum(random.normal(0, 0.1, (FRAMES * tools, 3)), 0))
        self.turned = turned.as_quat(scalar_first=True).reshape(FRAMES, tools, 4)
        self.lost = random.random((FRAMES, tools)) < 0.1

    def lines(self, mark: str, lead: Row, gap: list[Any], cells: Row) -> list[str]:
        """Return one line per frame: leading cells, then each tool's cells or gap; numbers have seven
        decimals.
        """
        rows = []
        for t in range(FRAMES):
            row = [*lead(t)]
            for lost, pose, mm in zip(self.lost[t], self.turned[t], self.mm[t], strict=True):
                row += gap if lost else cells(pose, mm)
            rows.append(row)
        return [mark.join(f"{c:.7f}" if isinstance(c, float) else str(c) for c in row) for row in rows]


def wave(poses: Poses, named: bool, mark: str) -> Written:
    kinds = ("Id", "Status", "Q0", "Qx", "Qy", "Qz", "X", "Y", "Z")
    titles = [f"Sensor {i} {k}" if named or k in kinds[:2] else k for i in range(poses.tools) for k in kinds]
    gap = [1, "missing", *["-3.697314E28"] * 7]
    rows = poses.lines(mark, lambda t: [poses.time_s[t]], gap, lambda pose, mm: [1, "ok", *pose, *mm])
    answers = {"position_unit": "mm", "time_unit": "s", **ROTATES, **CALLED}
    return "wave.tsv", [mark.join(["Time", *titles]), *rows], answers


def aurora(poses: Poses, row_end: str, header_end: str) -> Written:
    titles = "Frame,Tools,Hour,Minutes,Seconds" + ",Port,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error" * poses.tools
    lead, gap = (lambda t: [5 + t, 3, 10, t // 30, t % 30 * 0.5 + 20]), ["0A", "Missing", *[""] * 8]
    rows = poses.lines(",", lead, gap, lambda pose, mm: ["0A", "OK", *pose, *mm, 0.1])
    answers = {"position_unit": "mm", "rate_hz": "100", **ROTATES, **CALLED}
    return "aurora.csv", [titles + header_end, *(row + row_end for row in rows)], answers


def sequence(poses: Poses, nrrd: bool, names: tuple[str, ...] = SEGMENTS) -> Written:
    sign, lines = (
        (":=", ["NRRD0004", "type: uchar"]) if nrrd else (" = ", ["ObjectType = Image", "NDims = 3"])
    )
    for t in range(FRAMES):
        for i, tool in enumerate(names[: poses.tools]):
            whole = np.eye(4)
            whole[:3, :3] = Rotation.from_quat(poses.turned[t, i], scalar_first=True).as_matrix()
            whole[:3, 3] = poses.mm[t, i]
            lines += [f"Seq_Frame{t:04d}_{tool}ToTrackerTransform{sign}{' '.join(map(str, whole.ravel()))}"]
            status = "MISSING" if poses.lost[t, i] else "OK"
            lines += [f"Seq_Frame{t:04d}_{tool}ToTrackerTransformStatus{sign}{status}"]
        lines += [f"Seq_Frame{t:04d}_Timestamp{sign}{poses.time_s[t]:.4f}"]
    return (
        "a.seq.nrrd" if nrrd else "a.igs.mha",
        [*lines, "" if nrrd else "ElementDataFile = LOCAL", "\0"],
        {},
    )


FORMS: list[tuple[Callable[..., Written], tuple[Any, ...]]] = [
    *((wave, dress) for dress in ((True, "\t"), (False, ","))),
    *((aurora, dress) for dress in ((",", ""), ("", ","))),
]
GUIDE = {"Q0 #1": (wave, (False, "\t")), "sequence": (sequence, (False, ("Hand", "Stylus")))}


@pytest.mark.parametrize("tools", [2, 3])
@pytest.mark.parametrize(
    ("write", "dress", "guide"),
    [*((*form, "") for form in FORMS), *((*form, page) for page, form in GUIDE.items())],
)
def test_poses_of_other_trackers_are_read_as_written(
    tmp_path: Path, write: Callable[..., Written], dress: tuple[Any, ...], guide: str, tools: int
) -> None:
    poses = Poses(tools)
    name, lines, answers = write(poses, *dress)
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n")
    pages = [
        block.text for block in blocks(REPOSITORY / "docs" / "mappings.md", "yaml") if guide in block.text
    ]
    draft = pages[-1] if guide else describe(path, ARM).draft
    for key, value in () if guide else answers.items():
        whole = (
            (rf"^  {key}:", f"  {value}:") if key in CALLED else (rf"^( *{key}:) CHECK.*$", rf"\1 {value}")
        )
        draft, count = re.subn(*whole, draft, flags=re.MULTILINE)
        assert count == (key not in CALLED or int(key[-1]) <= tools), (key, draft)
    mapping = yaml.safe_load(draft)
    samples = read(path, LIBERTY if guide else ARM, mapping)
    segments = [*mapping["receivers"]] if guide else SEGMENTS[:tools]
    assert len(samples.frame) == FRAMES * len(segments)
    for tool, segment in enumerate(segments):
        numbers, kept = samples.numbers[of(samples, segment)], ~poses.lost[:, tool]
        np.testing.assert_array_equal(np.isfinite(numbers).all(-1), kept)
        np.testing.assert_allclose(numbers[kept, :3], poses.mm[kept, tool], atol=1e-3)
        turned = np.abs((numbers[kept, 3:] * poses.turned[kept, tool]).sum(-1))
        np.testing.assert_allclose(turned, 1, atol=1e-6)
        time_s = samples.time_s[of(samples, segment)]
        np.testing.assert_allclose(time_s - time_s[0], poses.time_s, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.igs.mha", "ObjectType = Image\nSeq_Frame0000_ATo", "its header is cut off"),
        ("a.nrrd", "NRRD0004\nSeq_Frame0000_AToBTransform:=1 0\n\n", "line 2: expected 16 numbers"),
        ("a.nrrd", f"NRRD0004\nSeq_Frame0000_AToBTransform:={'0 ' * 16}\n\n", "'a' is not in layout"),
    ],
)
def test_an_unreadable_export_is_refused_with_the_reason(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    (tmp_path / name).write_text(content)
    refuse(tmp_path / name, message)


def test_columns_that_are_not_poses_are_not_drafted(tmp_path: Path) -> None:
    """These are columns named like a quaternion, dates, and an inertial sensor's numbers."""
    random, kinds = np.random.default_rng(3), ("x", "y", "z")
    titles = ["stamp", *"xyz", "w1", "x1", "y1", "z1", "qw", "qx", "qy", "qz"]
    titles += [f"{kind}{axis}" for kind in ("a", "g", "acc2_", "gyro.", "mag_field_uT_") for axis in kinds]
    turned = Rotation.random(40, random_state=1).as_quat()
    cells = np.column_stack([random.normal(0, 2, (40, 3)), turned, random.normal(0, 2, (40, 19))])
    rows = [",".join([str(1_700_000_000_000 + 10 * t), *map(str, row)]) for t, row in enumerate(cells)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(titles), *rows]) + "\n")
    draft = yaml.safe_load(describe(tmp_path / "a.csv", ARM).draft)
    assert draft["receivers"] == {"CHECK_1": {"position": [*"xyz"], "orientation": ["w1", "x1", "y1", "z1"]}}
    assert (draft["csv"]["time_unit"], draft["orientation"]["order"]) == ("ms", "wxyz")
