"""VIPER: every field of a frame, its checksum, replies and commands."""

import numpy as np
import pytest
from tracker_streams import check_tiles, decode, pose, settings, viper_closed, viper_frame, viper_reply

from shukotsu.trackers.protocols.records import Decoded
from shukotsu.trackers.viper.decoder import REFUSED, ViperDecoder


def read(data: bytes) -> Decoded:
    decoded = decode(ViperDecoder(settings("viper", unit="m")), data)
    check_tiles(decoded, len(data))
    return decoded


@pytest.mark.parametrize(("unit", "mm"), [(0, 25.4), (1, 304.8), (2, 10.0), (3, 1000.0)])
@pytest.mark.parametrize("accelerated", [False, True])
def test_every_number_comes_out(unit: int, mm: float, accelerated: bool) -> None:
    frames = [viper_frame(2**32 - 1, (1, 3), unit, accelerated), viper_frame(7, (16,), unit)]
    records = read(b"".join(frames)).records
    assert records.station.tolist() == [1, 3, 16]
    assert records.frame.tolist() == [2**32 - 1, 2**32 - 1, 7]
    assert records.offset.tolist() == [0, 56, 92]
    assert records.size.tolist() == [56, 36, 60]
    assert records.distortion.tolist() == [37, 37, 37]
    assert records.button.tolist() == [1, 1, 1]
    assert records.device_ms.tolist() == [-1, -1, -1]
    for row, (frame, station) in enumerate([(2**32 - 1, 1), (2**32 - 1, 3), (7, 16)]):
        position, quaternion = pose(frame, station)
        np.testing.assert_allclose(records.position_mm[row], mm * np.array(position), rtol=1e-6)
        sign = np.sign(records.quaternion[row] @ quaternion)
        np.testing.assert_allclose(
            sign * records.quaternion[row], quaternion, atol=5e-5 if accelerated else 1e-6
        )
    assert records.doubtful.tolist() == (np.linalg.norm(records.position_mm, axis=1) > 3048).tolist()


def test_a_wrong_checksum_is_no_frame() -> None:
    good, bad = viper_frame(1, (1, 2)), bytearray(viper_frame(2, (1, 2)))
    bad[-4] ^= 1
    decoded = read(good + bytes(bad) + good)
    assert decoded.records.frame.tolist() == [1, 1, 1, 1]
    assert [(skip.offset, skip.size) for skip in decoded.skipped] == [(len(good), len(bad))]


def test_replies_and_a_frame_without_sensors() -> None:
    told, refused = viper_reply(7, b"\2\0\0\0"), viper_reply(20, b"", REFUSED)
    empty = viper_frame(3, ())
    decoded = read(told + viper_frame(1, (1,)) + refused + empty)
    assert [(r.command, r.error) for r in decoded.replies] == [(7, 0), (20, REFUSED), (19, 0)]
    assert decoded.replies[0].body == told[8:-4]
    assert len(decoded.records) == 1


def test_a_virtual_sensor_and_an_unknown_kind_of_orientation_are_doubted() -> None:
    frame = bytearray(viper_frame(1, (1, 2, 3)))
    frame[24] |= 0x80
    frame[24 + 32 + 1] |= 0x0C
    records = read(viper_closed(b"VPRP", bytes(frame[8:-4]))).records
    assert records.station.tolist() == [129, 2, 3]
    assert records.doubtful.tolist() == [True, True, False]
