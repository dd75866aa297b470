"""VIPER: every field of a frame, its checksum, replies, commands; set up and recorded against a stand-in."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from tracker_streams import check_tiles, decode, pose, settings, viper_closed, viper_frame, viper_reply

from shukotsu.errors import InputError
from shukotsu.tracker.records import Decoded
from shukotsu.tracker.request import RecordingRequest
from shukotsu.tracker.viper_decoder import REFUSED, ViperDecoder


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
    answer, refused = viper_reply(7, b"\2\0\0\0"), viper_reply(20, b"", REFUSED)
    empty = viper_frame(3, ())
    decoded = read(answer + viper_frame(1, (1,)) + refused + empty)
    assert [(r.command, r.error) for r in decoded.replies] == [(7, 0), (20, REFUSED), (19, 0)]
    assert decoded.replies[0].body == answer[8:-4]
    assert len(decoded.records) == 1


def test_a_virtual_sensor_and_an_unknown_kind_of_orientation_are_doubted() -> None:
    frame = bytearray(viper_frame(1, (1, 2, 3)))
    frame[24] |= 0x80
    frame[24 + 32 + 1] |= 0x0C
    records = read(viper_closed(b"VPRP", bytes(frame[8:-4]))).records
    assert records.station.tolist() == [129, 2, 3]
    assert records.doubtful.tolist() == [True, True, False]


ANY = 0xFFFFFFFF
HEMISPHERE, FILTER, BORESIGHT, RATE, UNITS = 0, 1, 4, 6, 7
STATION_MAP, STYLUS, CONTINUOUS, WHOAMI = 10, 11, 19, 20


class Viper:
    """Two sensors at 120 Hz in inches and degrees, streaming, as somebody left it."""

    period_s = 1 / 120

    def __init__(self, deaf_to: tuple[int, ...] = ()) -> None:
        self.deaf_to = deaf_to
        self.streaming = True
        self.frame = 12345
        self.settings: dict[tuple[int, ...], bytes] = {
            (UNITS, ANY, 0): struct.pack("<2I", 0, 0),
            (RATE, ANY, 0): struct.pack("<I", 2),
            (STYLUS, ANY, 0): struct.pack("<I", 3),
            (STATION_MAP, ANY, 0): struct.pack("<I", 0b101),
            (WHOAMI, ANY, 0): b"VIPER 16".ljust(64, b"\0") + b"1234".ljust(128, b"\0"),
        }
        for sensor in (0, 2):
            self.settings[HEMISPHERE, sensor, 0] = struct.pack("<I3f", 1, 0, 0, 1)
            self.settings[BORESIGHT, sensor, 0] = struct.pack("<4f", 1 - sensor, sensor, 0, 0)
            for kind in (1, 2):
                self.settings[FILTER, sensor, kind] = struct.pack("<I4f", 2, 0.2, 0.2, 0.8, 0.9)

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        out = b""
        while data:
            (size,) = struct.unpack_from("<I", data, 4)
            frame, data = data[: 8 + size], data[8 + size :]
            assert frame == viper_closed(frame[:4], frame[8:-4]), "the checksum of a command"
            _, command, action, *key = struct.unpack_from("<5I", frame, 8)
            out += self.answer(command, action, (command, *key), frame[28:-4])
        return out

    def answer(self, command: int, action: int, key: tuple[int, ...], payload: bytes) -> bytes:
        """Answer one command."""
        if command == CONTINUOUS:
            self.streaming = action == 0
            self.frame = struct.unpack("<i", payload)[0] if self.streaming else self.frame
            return viper_reply(command, b"")
        if action == 0 and command not in self.deaf_to:
            self.settings[key] = payload
        answer = self.settings.get(key, b"") if action == 1 else b""
        return viper_reply(command, answer, 3 if key in self.settings else 4)

    def cycle(self) -> bytes:
        """Return what it sends in one cycle."""
        position, orientation = struct.unpack("<2I", self.settings[UNITS, ANY, 0])
        body = struct.pack("<4I", 7, self.frame, 0, 2)
        for sensor in (0, 2):
            info = sensor | position << 8 | orientation << 10
            body += struct.pack("<I7f", info, 10, 20, 30, 1, 0, 0, 0)
        self.frame += 1
        return viper_closed(b"VPRP", body)


def test_a_viper_is_set_up_and_recorded(recorded) -> None:
    device = Viper()
    records, settings, tally = recorded(device, RecordingRequest("viper", no_filters=True))
    assert settings.stations == (1, 3)
    assert (settings.unit, settings.rate_hz) == ("cm", 240.0)
    assert "VIPER 16 1234" in settings.options["whoami"]
    assert settings.options["warnings"] == ["sensor 3: a boresight is in force, left as it is"]
    assert device.settings[UNITS, ANY, 0] == struct.pack("<2I", 2, 2)
    assert device.settings[RATE, ANY, 0] == struct.pack("<I", 3)
    assert device.settings[STYLUS, ANY, 0] == struct.pack("<I", 0)
    assert device.settings[HEMISPHERE, 2, 0] == struct.pack("<I3f", 0, 1, 0, 0)
    assert device.settings[FILTER, 2, 1][:4] == bytes(4)
    assert not device.streaming
    assert set(records.station.tolist()) == {1, 3}
    assert records.position_mm[0].tolist() == [100.0, 200.0, 300.0]
    assert records.frame[0] == 0
    assert len(records) > 2 * 6
    assert tally.summary is not None
    assert tally.summary["lost_frames"] == 0


def test_a_viper_that_does_not_take_a_setting_is_told(recorded, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"did not take its units: sent was 0200000002000000, and when"):
        recorded(Viper(deaf_to=(UNITS,)), RecordingRequest("viper"))
    assert not (tmp_path / "rom.arrows").exists()
