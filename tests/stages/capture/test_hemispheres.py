"""Receivers on the wrong side of the transmitter, in a file of any format: put back, or gaps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import quaternions, random_chain, smooth
from checked_hands import hand_of
from poses_columns import columns_of
from recording_files import read
from scipy.spatial.transform import Rotation, Slerp

from schemas.layout import read_layout
from stages.capture.hemispheres import expected_joints
from stages.capture.poses_table import poses_table
from stages.capture.samples import NUMBERS, Samples

Recorded = tuple[Samples, np.ndarray, dict[str, str]]


def recorded(
    seed: int, smear: float = 0.0, *, flipped: bool = True
) -> tuple[Samples, np.ndarray, dict[str, str]]:
    """A chain of four receivers before a transmitter; true poses (T, S, 7); parents.

    Each that leaves x > 0 is reported as its mirror image, through a filter that takes some frames.
    """
    chain = random_chain(seed, 4, 600, noise_mm=0.5)
    true = np.concatenate([chain.poses.position_mm, chain.poses.quaternion], -1)
    true[..., :3] += np.array([0.0, 400.0, 300.0]) - chain.poses.position_mm.mean((0, 1))
    seen = true.copy()
    side = np.where(true[..., :1] < 0, -1.0, 1.0) if flipped else 1.0
    seen[..., :3] *= side
    for k in range(1, len(seen)):
        seen[k, :, :3] = smear * seen[k - 1, :, :3] + (1 - smear) * seen[k, :, :3]
    count, segments = len(seen), chain.poses.segments
    samples = Samples(
        segments,
        np.repeat(np.arange(4), count),
        np.tile(np.arange(count), 4),
        np.tile(np.arange(count) / 240, 4),
        np.concatenate(seen.swapaxes(0, 1)),
        str,
    )
    return samples, true, dict(zip(segments[1:], segments, strict=False))


def table(samples: Samples, parents: dict[str, str], *, repair: bool) -> tuple[np.ndarray, ...]:
    """Positions (T, S, 3), validity (T, S) and flags (T, S) of the poses table."""
    columns = columns_of(poses_table([samples], parents, repair_hemisphere=repair))
    shape = len(samples.segments), -1
    numbers = np.stack([columns[name].reshape(shape).T for name in NUMBERS[:3]], -1)
    flags = np.array(columns["flags"].to_pylist())
    return numbers, columns["valid"].reshape(shape).T, flags.reshape(shape).T


@pytest.mark.parametrize("smear", [0.0, 0.4])
@pytest.mark.parametrize("seed", range(4))
def test_every_receiver_is_put_back(seed: int, smear: float) -> None:
    """Whatever the first frame's side was, positions are the true ones, or all of them mirrored."""
    samples, true, parents = recorded(seed, smear)
    position_mm, valid, flags = table(samples, parents, repair=True)
    assert valid.mean() > (0.9 if smear else 0.999)
    assert (flags == "hemisphere-repaired").any()
    off_mm = [np.abs(position_mm - sign * true[..., :3])[valid].max() for sign in (1, -1)]
    assert min(off_mm) < (1e-9 if not smear else 60.0)
    assert set(np.unique(flags)) <= {"", "hemisphere-repaired", "hemisphere-transit"}


@pytest.mark.parametrize("seed", range(4))
def test_unasked_they_are_gaps_and_what_is_left_is_on_one_side(seed: int) -> None:
    samples, true, parents = recorded(seed)
    position_mm, valid, flags = table(samples, parents, repair=False)
    assert np.array_equal(valid, flags == "")
    assert 0.4 < valid.mean() < 1.0
    off_mm = [np.abs(position_mm - sign * true[..., :3])[valid].max() for sign in (1, -1)]
    assert min(off_mm) < 1e-9


@pytest.mark.parametrize("repair", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_nothing_happens_to_receivers_that_stay(seed: int, repair: bool) -> None:
    samples, true, parents = recorded(seed, flipped=False)
    position_mm, valid, flags = table(samples, parents, repair=repair)
    assert valid.all()
    assert (flags == "").all()
    np.testing.assert_array_equal(position_mm, true[..., :3])


def test_a_receiver_that_is_mirrored_throughout_is_put_back_where_that_is_asked_for() -> None:
    """It never jumps; its joints close on the other sign alone."""
    samples, true, parents = recorded(1, flipped=False)
    numbers = samples.numbers.copy()
    numbers[samples.segment == 2, :3] *= -1.0
    position_mm, valid, flags = table(replace(samples, numbers=numbers), parents, repair=True)
    assert valid.all()
    np.testing.assert_array_equal(position_mm, true[..., :3])
    assert (flags[:, 2] == "hemisphere-repaired").all()
    assert (flags[:, [0, 1, 3]] == "").all()


def test_a_receiver_without_a_joint_is_told_by_its_jumps() -> None:
    samples, true, _ = recorded(2)
    position_mm, valid, _ = table(samples, {}, repair=True)
    first = np.sign(true[0, :, 0])
    np.testing.assert_allclose(position_mm[valid], (first[:, None] * true[..., :3])[valid], atol=1e-9)


def samples_of(
    segments: tuple[str, ...], seen: np.ndarray, rate_hz: float, *, in_step: bool = True
) -> Samples:
    """Poses (T, S, 7) as samples; not in step, each receiver has frames of its own and some with others."""
    count, receivers = seen.shape[:2]
    segment, frame = np.repeat(np.arange(receivers), count), np.tile(np.arange(count), receivers)
    kept = np.flatnonzero(in_step | (np.random.default_rng(0).random(len(frame)) < 0.5))
    numbers = np.concatenate(seen.swapaxes(0, 1))[kept]
    return Samples(segments, segment[kept], frame[kept], frame[kept] / rate_hz, numbers, str)


def resampled(poses: np.ndarray, time_s: np.ndarray, rate_hz: float) -> np.ndarray:
    """Poses (T, S, 7) at another rate."""
    times = np.arange(time_s[0], time_s[-1], 1 / rate_hz)
    out = np.empty((len(times), *poses.shape[1:]))
    for own, given in zip(out.swapaxes(0, 1), poses.swapaxes(0, 1), strict=True):
        own[:, :3] = np.stack([np.interp(times, time_s, axis) for axis in given[:, :3].T], -1)
        own[:, 3:] = quaternions(Slerp(time_s, Rotation.from_quat(np.roll(given[:, 3:], -1, -1)))(times))
    return out


def at_rest(poses: np.ndarray) -> np.ndarray:
    """Poses (T, S, 7) as seen where the first receiver stands still."""
    base = Rotation.from_quat(np.roll(poses[:, 0, 3:], -1, -1)).inv()
    out = poses.copy()
    for own in out.swapaxes(0, 1):
        own[:, :3] = base.apply(own[:, :3] - poses[:, 0, :3])
        own[:, 3:] = quaternions(base * Rotation.from_quat(np.roll(own[:, 3:], -1, -1)))
    return out


def before_a_transmitter(poses: np.ndarray, share: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Poses (T, S, 7) before a transmitter and their sides (T, S).

    The last receiver is beyond its plane in that share of frames, the first one never.
    """
    rng = np.random.default_rng(seed)
    for _ in range(2000):
        plane, other = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        origin = poses[:, -1, :3].mean(0) + rng.uniform(250, 400) * np.cross(plane, other)
        origin += plane * (np.quantile(poses[:, -1, :3] @ plane, share) - origin @ plane)
        true = poses.copy()
        true[..., :3] -= origin
        side = np.where(true[..., :3] @ plane < 0, -1, 1)
        far = np.linalg.norm(true[..., :3], axis=-1).min() > 100
        if far and (side[:, 0] == 1).all() and (side < 0).mean(0).max() < 0.4:
            return true, side
    pytest.fail("no transmitter found")


def mirrored(true: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Poses (T, S, 7) as reported on those sides."""
    return np.concatenate([true[..., :3] * side[..., None], true[..., 3:]], -1)


def wrong_and_lost(
    samples: Samples, parents: dict[str, str], true: np.ndarray, *, repair: bool
) -> tuple[int, int]:
    """How many valid poses are mirror images, and how many of the right side are not valid."""
    position_mm, valid, flags = table(samples, parents, repair=repair)
    frames = np.unique(samples.frame)
    off, image = (np.linalg.norm(position_mm - s * true[frames, :, :3], axis=-1) for s in (1, -1))
    right = (off < image) & (flags != "no-row")
    return int((valid & (off > image)).sum()), int((right & ~valid).sum())


def hinge(seed: int, rate_hz: float) -> tuple[np.ndarray, tuple[str, ...]]:
    """20 s of a shank that swings beside a thigh at rest, with some noise: poses (T, 2, 7)."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0, 20, 1 / rate_hz)
    swing = 0.7 * np.sin(2 * np.pi * 0.4 * time_s)[:, None] * [0.0, 1.0, 0.0]
    turn = Rotation.from_rotvec(swing + 0.15 * np.sin(2 * np.pi * 0.13 * time_s)[:, None] * [1.0, 0.0, 0.0])
    shank = turn.apply([120.0, 20.0, 30.0])
    thigh = np.tile([-150.0, 10.0, 40.0], (len(time_s), 1))
    places = np.stack([thigh, shank], 1) + 0.2 * rng.normal(size=(len(time_s), 2, 3))
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(time_s), 1))
    return np.concatenate([places, np.stack([still, quaternions(turn)], 1)], -1), ("thigh", "shank")


@pytest.mark.parametrize("in_step", [True, False])
@pytest.mark.parametrize("repair", [True, False])
@pytest.mark.parametrize("rate_hz", [60, 100, 130, 240, 500])
def test_beside_a_receiver_at_rest_most_poses_are_right(rate_hz: int, repair: bool, in_step: bool) -> None:
    """It agrees with either side, so that it says nothing of which is right."""
    for seed in range(3):
        poses, segments = hinge(seed, rate_hz)
        true, side = before_a_transmitter(poses, 0.22, seed)
        samples = samples_of(segments, mirrored(true, side), rate_hz, in_step=in_step)
        wrong, lost = wrong_and_lost(samples, {"shank": "thigh"}, true, repair=repair)
        assert wrong == 0, seed
        assert lost <= 0.01 * len(samples.frame), seed  # right ones amid noise on the plane


@pytest.mark.parametrize("repair", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_a_loose_joint_is_no_reason_to_touch_a_pose(seed: int, repair: bool) -> None:
    """Receivers that slide by centimetres now and then: nothing jumps, nothing changes."""
    samples, _, parents = recorded(seed, flipped=False)
    rng, numbers = np.random.default_rng(seed), samples.numbers.copy()
    numbers[:, :3] += np.array([500.0, 400.0, 900.0])
    slides = np.concatenate([smooth(rng, 600, 3) for _ in samples.segments])
    numbers[:, :3] += 60.0 * slides * (np.abs(slides[:, :1]) > 2.0)
    position_mm, valid, flags = table(replace(samples, numbers=numbers), parents, repair=repair)
    assert valid.all()
    assert (flags == "").all()
    np.testing.assert_array_equal(position_mm, numbers[:, :3].reshape(4, -1, 3).swapaxes(0, 1))


def test_what_nothing_decides_is_kept_and_marked() -> None:
    """Of two receivers on two sides all along either may be wrong."""
    samples, true, _ = recorded(0, flipped=False)
    two = samples.segment < 2
    numbers = samples.numbers[two].copy()
    numbers[samples.segment[two] == 1, :3] *= -1.0
    pair = Samples(("s0", "s1"), samples.segment[two], samples.frame[two], samples.time_s[two], numbers, str)
    position_mm, valid, flags = table(pair, {"s1": "s0"}, repair=True)
    assert valid.all()
    assert (flags == "hemisphere-undecided").all()
    np.testing.assert_array_equal(position_mm, true[:, :2, :3] * np.array([1, -1])[:, None])


@pytest.mark.parametrize("rate_hz", [60, 240])
def test_anatomy_tells_a_finger_that_is_mostly_wrong(rate_hz: int) -> None:
    """The hand lies still; the finger's receivers cross together for most of the time."""
    layout = read_layout("liberty16")
    poses = hand_of(7).poses
    numbers = at_rest(np.concatenate([poses.position_mm, poses.quaternion], -1))
    segments = ("hand", "index_proximal", "index_middle", "index_distal")
    numbers = resampled(numbers[:, [poses.index(name) for name in segments]], poses.time_s, rate_hz)
    true, side = numbers.copy(), np.ones(numbers.shape[:2])
    true[..., :3] += np.array([250.0, 120.0, -80.0])
    side[: int(0.65 * len(side)), 1:] = -1
    parents = {joint.child: joint.parent_receiver for joint in layout.solvable if joint.child in segments}
    made = poses_table(
        [samples_of(segments, mirrored(true, side), rate_hz)],
        parents,
        expected_mm=expected_joints(layout),
        repair_hemisphere=True,
    )
    columns = columns_of(made)
    found = np.stack([columns[name].reshape(4, -1).T for name in NUMBERS[:3]], -1)
    np.testing.assert_array_equal(found, true[..., :3])


KNEE = {
    "format": "c3d",
    "position_unit": "mm",
    "receivers": {
        "thigh": {"markers": ["RGT", "RTHI1", "RTHI2", "RTHI3"]},
        "shank": {"markers": ["RATT", "RLM", "RSPH", "RLEG1", "RLEG2", "RLEG3"]},
    },
    "c3d": {"first_frame": 300, "last_frame": 821},
}
KNEE_LAYOUT = """
layout: knee
description: A thigh and a shank.
segments: {thigh: {}, shank: {}}
joints:
  knee: {parent: thigh, child: shank, dof: 3, plane: {frame: none}}
digits:
  leg: {segments: [shank]}
"""


@pytest.fixture(scope="module", params=["knee", "arm"])
def real(
    request: pytest.FixtureRequest, real_data: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """Segments, poses (T, S, 7) and times of a knee that bends and of an arm that drives a wheelchair."""
    if request.param == "knee":
        path = tmp_path_factory.mktemp("knee") / "knee.yaml"
        path.write_text(KNEE_LAYOUT, "utf-8")
        source = real_data / "hip_knee_functional_mit" / "right_knee.c3d"
        samples = read(source, read_layout(path), KNEE)
    else:
        samples = read(real_data / "upper_limb_poses" / "racing_right.csv")
    shape = len(samples.segments), -1
    poses = samples.numbers.reshape(*shape, 7).swapaxes(0, 1)
    there = np.isfinite(poses).all((1, 2))
    return samples.segments, poses[there], samples.time_s.reshape(shape)[0][there]


@pytest.mark.parametrize("still", [True, False])
@pytest.mark.parametrize("rate_hz", [60, 130, 500])
def test_real_recordings_are_put_back_and_clean_ones_left_alone(
    real: tuple[tuple[str, ...], np.ndarray, np.ndarray], rate_hz: int, still: bool
) -> None:
    segments, given, time_s = real
    parents = dict(zip(segments[1:], segments, strict=False))
    poses = resampled(at_rest(given) if still else given, time_s, rate_hz)
    true, side = before_a_transmitter(poses, 0.22, 1)
    for in_step in (True, False):
        clean = samples_of(segments, true, rate_hz, in_step=in_step)
        position_mm, _, flags = table(clean, parents, repair=True)
        assert set(np.unique(flags)) <= {"", "no-row"}
        there = flags.T != "no-row"
        np.testing.assert_array_equal(position_mm.swapaxes(0, 1)[there], clean.numbers[:, :3])
        flipped = samples_of(segments, mirrored(true, side), rate_hz, in_step=in_step)
        for repair in (True, False):
            wrong, lost = wrong_and_lost(flipped, parents, true, repair=repair)
            assert wrong <= (0.001 if in_step else 0.005) * len(flipped.frame)
            assert lost <= 0.01 * len(flipped.frame)
