"""The emulated LIBERTY without a port: commands, answers, counters and measurements."""

import struct

import numpy as np
import pytest
from tracker_streams import settings

from shukotsu.tracker import liberty as replies
from shukotsu.tracker.emulated_device import EmulatedLiberty, PlayedMotion, built_in_motion
from shukotsu.tracker.liberty import FULL_LIST, BinaryDecoder
from shukotsu.tracker.liberty_driver import SETTINGS


def device() -> EmulatedLiberty:
    return EmulatedLiberty(built_in_motion(), frozenset(range(1, 17)))


def cycles(tracker: EmulatedLiberty, count: int) -> bytes:
    return b"".join(tracker.next_cycle() for _ in range(count))


DEFAULTS = {
    # query: the answers of a device with factory settings, in text and in binary
    b"U": (b"0", 0), b"R": (b"4", 4), b"Z": (b"0", 0), b"\x05": (b"0", 0), b"@B": (b"1", 1),
    b"G": (b"   0.000    0.000    0.000 ", (0, 0, 0)),
    b"X": (b" 0.200  0.200  0.800  0.950 ", (0.2, 0.2, 0.8, 0.95)),
    b"Y": (b" 0.200  0.200  0.800  0.950 ", (0.2, 0.2, 0.8, 0.95)),
    b"\x14": (b" ".join([b"0x00000000"] * 18), (0,) * 18), b"\x15": (b"ffffffff", (0xFFFF, 0xFFFF)),
    b"A": (
        b"   0.00   0.00   0.00\r\n   1.00   0.00   0.00\r\n   0.00   1.00   0.00\r\n",
        (0, 0, 0, 1, 0, 0, 0, 1, 0),
    ),
    b"B": (b"   0.00    0.00    0.00 ", (0, 0, 0)), b"H": (b"  1.000  0.000  0.000", (1, 0, 0)),
    b"L": (b"0", 0), b"N": (b" 0.000  0.000  0.000 ", (0, 0, 0)), b"O": (b"2 4 1", (2, 4, 1)),
}  # fmt: skip


@pytest.mark.parametrize("name", SETTINGS)
def test_every_setting_is_answered_in_text_and_in_binary(name: str) -> None:
    tracker, setting = device(), SETTINGS[name]
    text, numbers = DEFAULTS[setting.command]
    station = 7 if setting.per_station else 0
    letter = chr(setting.command[0] + 0x60 * (setting.command[0] < 0x20)).encode()
    assert tracker.receive(setting.question(station)) == b"%02d%s  %s\r\n" % (station, letter, text)
    tracker.receive(b"F1\r")
    (reply,) = replies.binary_answers(tracker.receive(setting.question(station).lower()))
    assert replies.answers(reply, setting, station)
    assert replies.binary_value(setting, reply) == pytest.approx(numbers)
    if setting.per_station:
        assert tracker.receive(setting.question(17))[4] == 2, "Invalid Station"


def flat(x_mm: np.ndarray) -> PlayedMotion:
    poses = np.tile([0.0, 300.0, 20.0, 1.0, 0.0, 0.0, 0.0], (len(x_mm), 1, 1))
    poses[:, 0, 0] = x_mm
    return PlayedMotion((1,), poses)


def measured_cm(tracker: EmulatedLiberty, count: int) -> np.ndarray:
    tracker.receive(b"F1\rU1\rO1,2,7\rC\r")
    return np.array([numbers[8:] for numbers in struct.iter_unpack("<8B7f", cycles(tracker, count))])


def test_a_receiver_that_leaves_the_hemisphere_is_mirrored() -> None:
    """Its orientation is unchanged; there is no flip if the hemisphere follows the receiver."""
    motion = flat(np.linspace(100, -100, 200))
    true = motion.poses[:, 0, :3] / 10
    seen = measured_cm(EmulatedLiberty(motion, frozenset({1})), 200)
    assert seen[:100, :3] == pytest.approx(true[:100], abs=1e-5)
    assert seen[100:, :3] == pytest.approx(-true[100:], abs=1e-5)
    assert (seen[:, 3:] == [1, 0, 0, 0]).all()
    follows = EmulatedLiberty(motion, frozenset({1}))
    follows.receive(b"H*,0,0,0\r")
    assert measured_cm(follows, 200)[:, :3] == pytest.approx(true, abs=1e-5)


@pytest.mark.parametrize("items", [FULL_LIST, (2, 7)])
def test_decoders_read_the_emulators_data(items: tuple[int, ...]) -> None:
    tracker = device()
    chosen = ",".join(map(str, items)).encode()
    tracker.receive(b"F1\rU1\rO*,%s\rC\r" % chosen)
    stations = tuple(range(1, 17))
    got = BinaryDecoder(settings("liberty", items, stations)).feed(cycles(tracker, 200), final=True)
    assert not got.skipped
    assert len(got.records) == 16 * 200
    true = built_in_motion().poses[:200].reshape(-1, 7)
    cosine = np.einsum("ij,ij->i", got.records.quaternion, true[:, 3:])
    assert np.abs(np.abs(cosine) - 1).max() < 1e-4
    assert np.abs(got.records.position_mm - true[:, :3]).max() < 1e-4
    if 9 in items:
        frame = np.repeat(np.arange(200), 16)
        assert (got.records.frame == frame).all()
        assert (got.records.device_ms == frame * 1000 // 240).all()
        assert not (got.records.button | got.records.distortion | got.records.sync).any()
