"""Receivers in the wrong hemisphere of the transmitter are repaired on request, and gaps otherwise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import random_chain
from recording_files import WHO, columns_of
from simulated_poses import hand_of

from shukotsu.__main__ import main
from shukotsu.readers.hemispheres import expected_joints
from shukotsu.readers.poses_table import PosesTable, poses_table
from shukotsu.readers.samples import Samples
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import simulate
from shukotsu.study.layout import read_layout
from shukotsu.tables.poses import NUMBERS, RecordingName, read_poses


def samples_of(segments: tuple[str, ...], frame: np.ndarray, numbers: np.ndarray) -> Samples:
    """Return samples at 240 Hz; numbers : (T, S, 7)."""
    count, time_s = len(segments), np.repeat(frame / 240, len(segments))
    index = np.tile(np.arange(count), len(frame))
    return Samples(segments, index, np.repeat(frame, count), time_s, numbers.reshape(-1, 7), str)


def recorded(
    seed: int, smear: float = 0.0, *, flipped: bool = True
) -> tuple[Samples, np.ndarray, dict[str, str]]:
    chain = random_chain(seed, 4, 600, noise_mm=0.5)
    true = np.concatenate([chain.poses.position_mm, chain.poses.quaternion], -1)
    true[..., :3] += np.array([0.0, 400.0, 300.0]) - chain.poses.position_mm.mean((0, 1))
    seen = true.copy()
    side = np.where(true[..., :1] < 0, -1.0, 1.0) if flipped else 1.0
    seen[..., :3] *= side
    for k in range(1, len(seen)):
        seen[k, :, :3] = smear * seen[k - 1, :, :3] + (1 - smear) * seen[k, :, :3]
    segments = chain.poses.segments
    samples = samples_of(segments, np.arange(len(seen)), seen)
    return samples, true, dict(zip(segments[1:], segments, strict=False))


def arrays_of(table: PosesTable) -> tuple[np.ndarray, ...]:
    """Return the positions (T, S, 3), validity (T, S) and flags (T, S) of a poses table."""
    columns, shape = columns_of(table), (len(table.segments), -1)
    numbers = np.stack([columns[name].reshape(shape).T for name in NUMBERS[:3]], -1)
    flags = np.array(columns["flags"].to_pylist())
    return numbers, columns["valid"].reshape(shape).T, flags.reshape(shape).T


@pytest.mark.parametrize("smear", [0.0, 0.4])
@pytest.mark.parametrize("seed", range(4))
def test_every_receiver_is_moved_to_one_hemisphere(seed: int, smear: float) -> None:
    """Repaired positions are all true or, depending on the first frame, all mirrored."""
    samples, true, parents = recorded(seed, smear)
    position_mm, valid, flags = arrays_of(poses_table([samples], parents, repair_hemisphere=True))
    assert valid.mean() > (0.9 if smear else 0.999)
    assert (flags == "hemisphere-repaired").any()
    off_mm = [np.abs(position_mm - sign * true[..., :3])[valid].max() for sign in (1, -1)]
    assert min(off_mm) < (1e-9 if not smear else 60.0)
    assert set(np.unique(flags)) <= {"", "hemisphere-repaired", "hemisphere-transit"}


@pytest.mark.parametrize("seed", range(4))
def test_without_repair_flipped_poses_are_gaps(seed: int) -> None:
    samples, true, parents = recorded(seed)
    position_mm, valid, flags = arrays_of(poses_table([samples], parents))
    assert np.array_equal(valid, flags == "")
    assert 0.4 < valid.mean() < 1.0
    off_mm = [np.abs(position_mm - sign * true[..., :3])[valid].max() for sign in (1, -1)]
    assert min(off_mm) < 1e-9


def of_hand(position_mm: np.ndarray) -> tuple[np.ndarray, ...]:
    poses, layout = hand_of(7).poses, read_layout("liberty16")
    samples = samples_of(poses.segments, poses.frame, np.concatenate([position_mm, poses.quaternion], -1))
    parents = {joint.child: joint.parent_receiver for joint in layout.solvable}
    expected_mm = expected_joints(layout)
    return arrays_of(poses_table([samples], parents, expected_mm=expected_mm, repair_hemisphere=True))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_hand_in_the_wrong_hemisphere_throughout_is_repaired(side: float) -> None:
    true_mm = hand_of(7).poses.position_mm
    position_mm, valid, flags = of_hand(side * true_mm)
    assert valid.all()
    assert np.array_equal(position_mm, true_mm)
    assert {*np.unique(flags)} == ({""} if side > 0 else {"hemisphere-repaired"})


@pytest.mark.slow
def test_a_capture_in_the_wrong_hemisphere_is_reported_and_repaired(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A raw capture cannot be edited, so it is repaired with `--repair-hemisphere`, which leaves no
    finding.
    """
    drawn = simulate(RecordingName("01", "right", "rom"), 7, Realism(), 300)
    poses = []
    for side, repair in ((1.0, []), (-1.0, []), (-1.0, ["--repair-hemisphere"])):
        folder = tmp_path / f"{len(poses)}"
        folder.mkdir()
        recording, archive, out = (folder / name for name in ("a.parquet", "a.arrows", "poses.parquet"))
        write_recording(recording, replace(drawn, position_mm=side * drawn.position_mm))
        assert main(["emulate", "--archive", str(archive), "--recording", str(recording)]) == 0
        capsys.readouterr()
        assert main(["import", "--in", str(archive), "--out", str(out), *WHO, *repair]) == 0
        suspect = "suspect: " in (printed := capsys.readouterr().err)
        assert suspect == (side < 0 and not repair), printed
        assert not suspect or "hemisphere: All receivers" in printed
        poses.append(read_poses(out, drawn.segments).position_mm)
    np.testing.assert_allclose(poses[2], poses[0], rtol=0, atol=1e-3)
