"""Reading C3D files: poses from marker clusters, missing markers, and refusals."""

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_files import ARM, columns_of, of, read, refuse, write_c3d

from shukotsu.hand.rotations import angle, conjugate, matrix, multiply, unit
from shukotsu.paper.joint_solution import solve_closed
from shukotsu.paper.moments import JointMoments, relative_poses
from shukotsu.readers.formats.c3d import cluster_poses
from shukotsu.readers.inspection.c3d_files import describe_c3d
from shukotsu.readers.poses_table import poses_table
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import NUMBERS

RNG = np.random.default_rng(9)
FRAMES = 12
SHAPE = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]])
QUATERNIONS = unit(RNG.normal(size=(FRAMES, 4)))
POSITIONS = RNG.normal(scale=300, size=(FRAMES, 3))
MARKERS = SHAPE @ np.swapaxes(matrix(QUATERNIONS), 1, 2) + POSITIONS[:, None]
CLUSTER = {"markers": ["H1", "H2", "H3"]}


def write(path: Path, points: np.ndarray = MARKERS, first: int = 101) -> Path:
    return write_c3d(path, points, ["H1", "H2", "H3"], first)


def config(receiver: dict[str, Any] = CLUSTER, segment: str = "hand", **keys: Any) -> dict[str, Any]:
    return {"format": "c3d", "position_unit": "mm", "receivers": {segment: receiver}} | keys


def test_a_cluster_becomes_poses_with_the_files_frames_and_times(tmp_path: Path) -> None:
    samples = read(write(tmp_path / "a.c3d"), ARM, config(fixed=["scapula"]))
    hand = of(samples, "hand")
    assert angle(multiply(conjugate(samples.numbers[hand, 3:]), QUATERNIONS)).max() < 1e-5
    np.testing.assert_allclose(samples.numbers[hand, :3], POSITIONS, atol=1e-3)  # stored as float32
    np.testing.assert_array_equal(samples.frame[hand], 101 + np.arange(FRAMES))
    np.testing.assert_allclose(samples.time_s[hand], np.arange(FRAMES) / 50)
    assert re.fullmatch(
        r"cluster hand: 3 markers, residual \S+ mm rms, \S+ mm max, 12 of 12 frames", samples.notes[0]
    )
    assert samples.locate(3) == f"{tmp_path}/a.c3d: frame 104"
    np.testing.assert_array_equal(samples.numbers[~hand], [[0, 0, 0, 1, 0, 0, 0]] * FRAMES)


@pytest.mark.parametrize("mark", ["coordinates", "residual"])
def test_missing_markers_are_gaps(tmp_path: Path, mark: str) -> None:
    """A marker is missing if its coordinates are NaN or its residual is -1, whatever its coordinates."""
    points = MARKERS.copy()
    if mark == "coordinates":
        points[4, 1] = np.nan
    path = write(tmp_path / "a.c3d", points)
    if mark == "residual":
        data = bytearray(path.read_bytes())
        point = 512 * (struct.unpack_from("<H", data, 16)[0] - 1) + 16 * (4 * 3 + 1)
        np.testing.assert_allclose(struct.unpack_from("<3f", data, point), MARKERS[4, 1], rtol=1e-6)
        struct.pack_into("<f", data, point + 12, -1.0)
        path.write_bytes(data)
    samples = read(path, ARM, config())
    assert np.flatnonzero(np.isnan(samples.numbers).all(1)).tolist() == [4]
    assert "11 of 12 frames" in samples.notes[0]


NEAR, FAR = {"markers": ["H1", "h2x", "H3"]}, {"markers": ["H1", "wrist", "H3"]}


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        (config(position_unit="m"), "a.c3d: states its unit as 'mm' (POINT:UNITS), but mapping.yaml says"),
        (config(NEAR), "mapping.yaml: receivers.hand.markers: marker 'h2x' is not in .*; did you mean 'H2'"),
        (config(FAR), "a.c3d, which has H1, H2, H3"),
        (config({"rotation": "hand"}), "receivers.hand.rotation: rotation 'hand' is not in "),
        (config(segment="hnad"), "receivers: segment 'hnad' is not in layout arm"),
        (config(fixed=["bench"]), "fixed: segment 'bench' is not in layout arm"),
        (config(c3d={"last_frame": 13}), "mapping.yaml: c3d: frames 1 to 13 are not in "),
        (config(c3d={"first_frame": 5, "last_frame": 4}), "frames 5 to 4 are not in "),
    ],
)
def test_a_mapping_that_does_not_fit_the_file_is_refused(
    tmp_path: Path, mapping: dict[str, Any], message: str
) -> None:
    refuse(write(tmp_path / "a.c3d"), message, ARM, mapping)


def test_truncated_missing_and_foreign_files_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.c3d", np.tile(MARKERS, (200, 1, 1)))
    data = path.read_bytes()
    for content, message in (
        (data[: len(data) // 2], "is cut off: it has "),
        (data[:600], "broken.c3d: "),
        (b"hi", "not a readable C3D file"),
    ):
        (tmp_path / "broken.c3d").write_bytes(content)
        refuse(tmp_path / "broken.c3d", message, ARM, config())
    refuse(tmp_path / "no.c3d", "no such file", ARM, config())
    refuse(path, "the ending '.c3d' does not say which format this is", ARM)


@pytest.mark.parametrize("lost", ["one of five in turn", "all but a line"])
def test_a_pose_needs_three_markers_that_are_not_on_a_line(lost: str) -> None:
    """Poses are relative to the first marker even if it is missing; two markers, or three on a line, give a
    gap.
    """
    line = lost == "all but a line"
    shape = [[0, 0, 0], [60, 0, 0], [20, 40, 0], *([[30, 0, 0]] if line else [[30, 15, 25], [-10, 25, -30]])]
    rotation = matrix(unit(RNG.normal(size=(40, 4))))
    seen = np.array(shape, float) @ np.swapaxes(rotation, 1, 2) + POSITIONS[:1, None]
    if line:
        seen[1, 2] = seen[2, [1, 2]] = np.nan
    else:
        seen[np.arange(40), np.arange(40) % 5] = np.nan
    poses = cluster_poses(seen, "hand")
    posed = ~np.isin(np.arange(40), [1, 2] if line else [])
    assert np.isfinite(poses.misfit_mm).tolist() == posed.tolist()
    np.testing.assert_allclose(poses.shape_mm, shape, atol=1e-4)
    np.testing.assert_allclose(poses.rotation[posed], rotation[posed], atol=1e-6)
    np.testing.assert_allclose(poses.position_mm[posed], np.tile(POSITIONS[0], (posed.sum(), 1)), atol=1e-4)


@pytest.mark.parametrize("odd", ["first frame", "swapped in it"])
def test_a_clusters_shape_does_not_depend_on_its_first_frame(tmp_path: Path, odd: str) -> None:
    """The first frame has a marker at 0, 0, 0 (treated as missing), or two markers with exchanged names."""
    points = MARKERS.copy()
    points[0, 1] = 0.0
    if odd != "first frame":
        points[0] = MARKERS[0, [1, 0, 2]]
    samples = read(write(tmp_path / "a.c3d", points), ARM, config())
    posed = of(samples, "hand") & (samples.frame > 101)
    np.testing.assert_allclose(samples.numbers[posed, :3], POSITIONS[1:], atol=1e-3)
    assert samples.losses == (("1 point at 0, 0, 0 is treated as not seen",) if odd == "first frame" else ())


HIP = ["RASIS", "LASIS", "LPSIS", "RPSIS"], ["RLFE", "RMFE", "RTHI1", "RTHI2", "RTHI3"]
KNEE = ["RGT", "RTHI1", "RTHI2", "RTHI3"], ["RATT", "RLM", "RSPH", "RLEG1", "RLEG2", "RLEG3"]


@pytest.mark.parametrize(
    ("joint", "clusters", "first", "last", "gap_mm", "range_deg"),
    [("hip", HIP, 1, 499, 8.5, 54), ("knee", KNEE, 300, 821, 3.1, 119)],
)
def test_real_leg_trials_give_the_gap_and_range_of_another_program(
    real_data: Path,
    tmp_path: Path,
    joint: str,
    clusters: tuple[list[str], list[str]],
    first: int,
    last: int,
    gap_mm: float,
    range_deg: int,
) -> None:
    """Parts of a hip and a knee trial; the knee's gap and range are known from another program."""
    (tmp_path / "leg.yaml").write_text(
        "layout: leg\ndescription: Two segments of a leg.\nsegments: {above: {}, below: {}}\n"
        "joints: {joint: {parent: above, child: below, dof: 3, plane: {frame: none}}}\n"
        "digits: {leg: {segments: [below]}}\n"
    )
    above, below = clusters
    mapping = {
        "format": "c3d",
        "position_unit": "mm",
        "receivers": {"above": {"markers": above}, "below": {"markers": below}},
        "c3d": {"first_frame": first, "last_frame": last, "misfit_mm": 50},
    }
    path = real_data / "hip_knee_functional_mit" / f"right_{joint}.c3d"
    samples = read(path, read_layout(tmp_path / "leg.yaml"), mapping)
    columns = columns_of(poses_table([samples], {}))
    numbers = np.stack([columns[name].reshape(2, -1) for name in NUMBERS], -1).swapaxes(0, 1)
    valid, moments = columns["valid"].reshape(2, -1).T, JointMoments(1)
    pair = relative_poses(numbers[..., 3:], numbers[..., :3], valid, np.array([0]), np.array([1]))
    moments.add(pair)
    joint_gap = solve_closed(moments, 0, 6)
    assert joint_gap.n_frames == 1 + last - first
    assert samples.time_s.min() == pytest.approx((first - 1) / 100)
    assert (round(joint_gap.gap_rms_free_mm, 1), round(joint_gap.range_deg)) == (gap_mm, range_deg)


def test_a_parameter_longer_than_its_file_is_refused(tmp_path: Path) -> None:
    """Its values are not searched for, which would take hours."""
    path = write(tmp_path / "a.c3d", SHAPE[None], first=1)
    data = bytearray(path.read_bytes())
    data[data.index(b"LABELS") + 9] = 60  # the number of dimensions: the bytes that follow are read as sizes
    path.write_bytes(data)
    refuse(path, "parameter LABELS of group 1 claims to be longer", ARM, config())


def test_frames_beyond_the_stated_count_are_read_or_reported(tmp_path: Path) -> None:
    """If the 16-bit count is at its maximum, all frames up to the padding are read; else further data is
    reported.
    """
    path = write(tmp_path / "a.c3d", SHAPE + np.arange(1.0, 31)[:, None, None], first=1)
    data = bytearray(path.read_bytes())
    assert read(path, ARM, config()).losses == ()
    path.write_bytes(data + bytes(1024))
    assert "30 frames are read, but more data follow" in read(path, ARM, config()).losses[0]
    assert "in doubt: 30 frames are read" in " ".join(describe_c3d(path, ARM).lines)
    for offset in (8, data.index(b"FRAMES") + 10):
        struct.pack_into("<H", data, offset, 65_535)
    path.write_bytes(data)
    np.testing.assert_allclose(read(path, ARM, config()).numbers[:, 0], np.arange(1, 31), atol=1e-4)
