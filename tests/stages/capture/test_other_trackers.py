"""Files of other trackers' programs: poses -> file -> inspection's draft -> import are the poses.

Each writer is of a documented form, in two dresses; frames are missing as the form writes that.
"""

from __future__ import annotations

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

from shukotsu.stages.capture.inspect_file import describe

FRAMES = 60
SEGMENTS = ("upper_arm", "forearm", "hand")
UNITS = {"mm": 1.0, "m": 1000.0}
Written = tuple[str, str | bytes, dict[str, str]]
"""A file's name and content, and what the draft is told for each CHECK."""


class Poses:
    """Poses of tools, (T, N, 3) in mm and (T, N, 4) wxyz, a random walk; lost : (T, N)."""

    def __init__(self, tools: int, seed: int = 1) -> None:
        random = np.random.default_rng(seed)
        self.tools = tools
        self.mm = 200 + np.cumsum(random.normal(0, 6, (FRAMES, tools, 3)), 0)
        turned = Rotation.from_rotvec(np.cumsum(random.normal(0, 0.1, (FRAMES * tools, 3)), 0))
        self.turned = turned.as_quat(scalar_first=True).reshape(FRAMES, tools, 4)
        self.lost = random.random((FRAMES, tools)) < 0.1
        self.time_s = np.arange(FRAMES) / 100

    def check(self, path: Path, answers: dict[str, str], decimals_mm: float = 1e-3) -> None:
        """Read the file by its draft; what is lost is a gap, the rest the poses to the file's decimals."""
        draft = describe(path, ARM).draft
        for key, value in answers.items():
            pattern = rf"(?m)^( *{key}):" if key.startswith("CHECK") else rf"(?m)^( *{key}:) CHECK.*$"
            draft, count = re.subn(
                pattern, f"  {value}:" if key.startswith("CHECK") else rf"\1 {value}", draft
            )
            assert count == 1, (key, draft)
        samples = read(path, ARM, yaml.safe_load(draft) if draft else None)
        assert len(samples.frame) == FRAMES * self.tools
        for tool, segment in enumerate(SEGMENTS[: self.tools]):
            numbers, kept = samples.numbers[of(samples, segment)], ~self.lost[:, tool]
            np.testing.assert_array_equal(np.isfinite(numbers).all(-1), kept)
            np.testing.assert_allclose(numbers[kept, :3], self.mm[kept, tool], atol=decimals_mm)
            turned = np.abs((numbers[kept, 3:] * self.turned[kept, tool]).sum(-1))
            np.testing.assert_allclose(turned, 1, atol=1e-6)
        if np.isfinite(samples.time_s).any():
            since = samples.time_s[of(samples, "forearm")] - samples.time_s.min()
            np.testing.assert_allclose(since, self.time_s, atol=1e-4)


FORWARD = {"rotates": "receiver-to-transmitter"}


def told(tools: int) -> dict[str, str]:
    return {f"CHECK_{tool + 1}": SEGMENTS[tool] for tool in range(tools)}


def rows(
    poses: Poses, cells: Callable[[int, int], list[Any]], lead: Callable[[int], list[Any]]
) -> list[list[str]]:
    return [
        [*map(str, lead(t)), *(str(cell) for tool in range(poses.tools) for cell in cells(t, tool))]
        for t in range(FRAMES)
    ]


def wave(poses: Poses, named: bool, mark: str) -> Written:
    """NDI Wave: a constant and the word missing where there is no pose."""

    def cells(t: int, tool: int) -> list[Any]:
        pose = [f"{number:.6f}" for number in (*poses.turned[t, tool], *poses.mm[t, tool])]
        lost = poses.lost[t, tool]
        return [tool + 1, "missing" if lost else "ok", *(["-3.697314E28"] * 7 if lost else pose)]

    kinds = ("Id", "Status", "Q0", "Qx", "Qy", "Qz", "X", "Y", "Z")
    titles = [
        "Time",
        *(f"Sensor {i + 1} {k}" if named or k in kinds[:2] else k for i in range(poses.tools) for k in kinds),
    ]
    body = rows(poses, cells, lambda t: [f"{poses.time_s[t]:.4f}"])
    text = "\n".join(mark.join(row) for row in [titles, *body]) + "\n"
    return "wave.tsv", text, {"position_unit": "mm", "time_unit": "s", **FORWARD, **told(poses.tools)}


def aurora(poses: Poses, behind_rows: bool, gap: str) -> Written:
    """NDI Aurora: a comma behind each row or behind the header alone."""

    def cells(t: int, tool: int) -> list[Any]:
        pose = [f"{number:.6f}" for number in (*poses.turned[t, tool], *poses.mm[t, tool], 0.1)]
        return [f"0{tool}", "Missing", *[gap] * 8] if poses.lost[t, tool] else [f"0{tool}", "OK", *pose]

    titles = ["Frame", "Tools", "Hour", "Minutes", "Seconds"]
    titles += ["Port", "State", "Q0", "Qx", "Qy", "Qz", "Tx", "Ty", "Tz", "Error"] * poses.tools
    body = rows(poses, cells, lambda t: [5 + t, poses.tools, 10, t // 30, f"{t % 30 * 0.5 + 20:.1f}"])
    ends = ("", ",") if behind_rows else (",", "")
    lines = [",".join(titles) + ends[0], *(",".join(row) + ends[1] for row in body)]
    return (
        "aurora.csv",
        "\r\n".join(lines),
        {"position_unit": "mm", "rate_hz": "100", **FORWARD, **told(poses.tools)},
    )


def motive(poses: Poses, unit: str, parent: bool) -> Written:
    """OptiTrack Motive: rotations x y z w; named as segments, with a marker that belongs to each."""

    def cells(t: int, tool: int) -> list[Any]:
        w, *vector = poses.turned[t, tool]
        place = poses.mm[t, tool] / UNITS[unit]
        pose = [f"{number:.6f}" for number in (*vector, w, *place, 0.0001, *(place + 0.01))]
        return [""] * 11 if poses.lost[t, tool] else pose

    words = {"mm": "Millimeters", "m": "Meters"}
    own = SEGMENTS[: poses.tools]
    head = [
        f"Format Version,1.23,Take Name,a,Rotation Type,Quaternion,Length Units,{words[unit]}",
        "",
        ",".join([",Type", *(["Rigid Body"] * 8 + ["Rigid Body Marker"] * 3) * poses.tools]),
        ",".join([",Name", *(name for tool in own for name in [tool] * 8 + [f"{tool}:Marker1"] * 3)]),
        ",".join([",ID", *(str(17 + tool) for tool in range(poses.tools) for _ in range(11))]),
        *[",".join([",Parent", *[""] * 11 * poses.tools])] * parent,
        ",".join(
            [
                ",",
                *(["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * 3)
                * poses.tools,
            ]
        ),
        ",".join(["Frame,Time (Seconds)", *[*"XYZWXYZ", "", *"XYZ"] * poses.tools]),
    ]
    body = rows(poses, cells, lambda t: [t, f"{poses.time_s[t]:.6f}"])
    return "motive.csv", "\n".join([*head, *map(",".join, body)]) + "\n", FORWARD


SHAPE_MM = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0], [10, 5, 30]])


def markers(poses: Poses, unit: str, words: bool) -> Written:
    """Vicon: names over the first of each marker's columns, units below them."""

    def cells(t: int, tool: int) -> list[Any]:
        turned = Rotation.from_quat(poses.turned[t, tool], scalar_first=True)
        points = (turned.apply(SHAPE_MM) + poses.mm[t, tool]) / UNITS[unit]
        return [""] * 12 if poses.lost[t, tool] else [f"{number:.6f}" for number in points.ravel()]

    own = [f"{segment}:{segment}{i}" for segment in SEGMENTS[: poses.tools] for i in range(1, 5)]
    head = ["Trajectories", "100"] if words else []
    head += [",".join([",", *(f"{name},," for name in own)])]
    head += [",".join(["Frame,Sub Frame", *["X,Y,Z"] * len(own)]), ",".join([",", *[unit] * 3 * len(own)])]
    body = rows(poses, cells, lambda t: [t + 1, 0])
    return "vicon.csv", "\n".join([*head, *map(",".join, body)]) + "\n", {"rate_hz": "100"}


def inertial(poses: Poses, mark: str, unit: str) -> Written:
    """A program of a lab: dates in ms or ns, numbers of an inertial sensor between poses."""

    def cells(t: int, tool: int) -> list[Any]:
        pose = [*poses.mm[t, tool] / 10, *poses.turned[t, tool]]
        noise = np.random.default_rng(t).normal(0, 1, 9)
        return ["NaN" if poses.lost[t, tool] else f"{n:.7f}" for n in pose] + [f"{n:.3f}" for n in noise]

    titles = ["stamp"]
    for n in range(1, poses.tools + 1):
        titles += [f"loc{n}_{axis}" for axis in "xyz"] + [f"{axis}{n}" for axis in "wxyz"]
        titles += [f"{kind}{n}_{axis}" for kind in ("acc", "gyro", "mag_field_uT") for axis in "xyz"]
    per_s = {"ms": 10**3, "ns": 10**9}[unit]
    body = rows(poses, cells, lambda t: [1_700_000_000 * per_s + t * per_s // 100])
    text = "\n".join(mark.join(row) for row in [titles, *body]) + "\n"
    return "lab.txt", text, {"position_unit": "cm", **FORWARD, **told(poses.tools)}


def sequence(poses: Poses, nrrd: bool, camel: bool) -> Written:
    """PLUS: a header before images, which are no text."""
    sign, tools = (":=", "=")[not nrrd], SEGMENTS[: poses.tools]
    tools = tuple("".join(map(str.title, tool.split("_"))) for tool in tools) if camel else tools
    lines = ["NRRD0004", "type: uchar"] if nrrd else ["ObjectType = Image", "NDims = 3"]
    for t in range(FRAMES):
        for i, tool in enumerate(tools):
            whole = np.eye(4)
            whole[:3, :3] = Rotation.from_quat(poses.turned[t, i], scalar_first=True).as_matrix()
            whole[:3, 3] = poses.mm[t, i]
            name, lost = f"Seq_Frame{t:04d}_{tool}ToTrackerTransform", poses.lost[t, i]
            numbers = " ".join(f"{number:.7f}" for number in (np.eye(4) if lost else whole).ravel())
            lines += [f"{name}{sign}{numbers}", f"{name}Status {sign} {'MISSING' if lost else 'OK'}"]
        lines += [f"Seq_Frame{t:04d}_ImageToProbeTransform {sign} {' '.join(['0'] * 16)}"]
        lines += [f"Seq_Frame{t:04d}_Timestamp {sign} {poses.time_s[t]:.4f}"]
    lines += [""] if nrrd else ["ElementDataFile = LOCAL"]
    name = "a.seq.nrrd" if nrrd else "a.igs.mha"
    return name, "\n".join(lines).encode() + b"\n" + bytes(range(255, 0, -1)), {}


def glove(poses: Poses, order: str, stamped: bool) -> Written:
    """An electromagnetic glove: a message a line, keys by name, or quaternions as lists."""
    lines = []
    for t in range(FRAMES):
        sensors: list[Any] = []
        for tool in range(poses.tools):
            w, *vector = poses.turned[t, tool].round(7)
            turned: Any = [w, *vector] if order == "wxyz" else dict(zip("xyzw", [*vector, w], strict=True))
            place = dict(zip("xyz", (poses.mm[t, tool] / 1000).round(7), strict=True))
            lost = poses.lost[t, tool]
            sensors.append({} if lost else {"position": place, "orientation": turned})
        sec, nanosec = divmod(round((1_700_000_000 + poses.time_s[t]) * 100), 100)
        stamp: Any = {"sec": sec, "nanosec": nanosec * 10**7} if stamped else poses.time_s[t]
        lines.append(json.dumps({"header": {"stamp": stamp}, "side": "right", "raw_sensor": sensors}))
    more = {"position_unit": "m", **({} if stamped else {"time_unit": "s"}), **told(poses.tools)}
    return "glove.jsonl", "\n".join(lines), FORWARD | more | ({"order": order} if order == "wxyz" else {})


@pytest.mark.parametrize("tools", [2, 3])
@pytest.mark.parametrize(
    ("write", "dress"),
    [
        (wave, (True, "\t")),
        (wave, (False, ",")),
        (aurora, (True, "")),
        (aurora, (False, "")),
        (motive, ("mm", False)),
        (motive, ("m", True)),
        (markers, ("mm", True)),
        (markers, ("m", False)),
        (inertial, (";", "ms")),
        (inertial, ("\t", "ns")),
        (sequence, (False, False)),
        (sequence, (True, True)),
        (glove, ("wxyz", False)),
        (glove, ("xyzw", True)),
    ],
)
def test_a_draft_reads_the_poses_that_were_written(
    tmp_path: Path, write: Callable[..., Written], dress: tuple[Any, ...], tools: int
) -> None:
    poses = Poses(tools)
    name, content, answers = write(poses, *dress)
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    poses.check(path, answers)
