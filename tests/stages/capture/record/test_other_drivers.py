"""VIPER and trakSTAR, against a small stand-in for each at the other end of a pseudo-terminal.

The stand-ins do what the sources say: Polhemus' interface header; the Flock of Birds guide.
"""

import os
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from schemas.errors import InputError
from stages.capture.archive import open_archive
from stages.capture.decode.stream import Tally, blocks_of
from stages.capture.record.port import open_port
from stages.capture.record.session import Plan, record
from stages.capture.record.stopping import Stop
from stages.capture.record.terminal import Terminal
from stages.capture.record.wishes import Wishes
from stages.capture.trackers.crc16 import crc16_arc
from stages.capture.trackers.records import concatenated

ANY = 0xFFFFFFFF
HEMISPHERE, FILTER, BORESIGHT, RATE, UNITS, STATION_MAP, STYLUS, CONTINUOUS, WHOAMI = (
    0,
    1,
    4,
    6,
    7,
    10,
    11,
    19,
    20,
)


class Viper:
    """Two sensors at 120 Hz in inches and degrees, streaming, as somebody left it."""

    period_s = 1 / 120

    def __init__(self, deaf_to: tuple[int, ...] = ()) -> None:
        self.deaf_to = deaf_to
        self.streaming = True
        self.frame = 12345
        self.settings: dict[tuple[int, int, int], bytes] = {
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
            assert frame == sealed(frame[:-4]), "the checksum of a command"
            _, command, action, sensor, argument = struct.unpack_from("<5I", frame, 8)
            out += self.answer(command, action, sensor, argument, frame[28:-4])
        return out

    def answer(self, command: int, action: int, sensor: int, argument: int, payload: bytes) -> bytes:
        """Answer one command."""
        key = (command, sensor, argument)
        if command == CONTINUOUS:
            self.streaming = action == 0
            if self.streaming:
                (self.frame,) = struct.unpack("<i", payload)
            return self.reply(command, 3, sensor, argument)
        if action == 0 and command not in self.deaf_to:
            self.settings[key] = payload
        known = key in self.settings
        return self.reply(
            command, 3 if known else 4, sensor, argument, self.settings.get(key, b"") if action == 1 else b""
        )

    def reply(self, command: int, action: int, sensor: int, argument: int, payload: bytes = b"") -> bytes:
        """Give the frame of an answer."""
        body = struct.pack("<5I", 7, command, action, sensor, argument) + payload
        return sealed(b"VPRC" + struct.pack("<I", len(body) + 4) + body)

    def cycle(self) -> bytes:
        """Give what it sends in one cycle."""
        position, orientation = struct.unpack("<2I", self.settings[UNITS, ANY, 0])
        body = struct.pack("<4I", 7, self.frame, 0, 2)
        for sensor in (0, 2):
            info = sensor | position << 8 | orientation << 10
            body += struct.pack("<I7f", info, 10, 20, 30, 1, 0, 0, 0)
        self.frame += 1
        return sealed(b"VPRP" + struct.pack("<I", len(body) + 4) + body)


def sealed(frame: bytes) -> bytes:
    return frame + struct.pack("<I", int(crc16_arc(np.frombuffer(frame, np.uint8)[None])[0]))


class Flock:
    """Birds at 100 Hz; a stream goes on until a record is asked for."""

    period_s = 0.01

    def __init__(self) -> None:
        self.streaming = True
        self.group = False
        self.quaternions: set[int] = set()

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        bird = 1
        for place, byte in enumerate(data):
            if 0xF1 <= byte <= 0xFE:
                bird = byte - 0xF0
            elif byte == ord("]"):
                self.quaternions.add(bird)
            elif byte == ord("@"):
                self.streaming = True
            elif byte == ord("B"):
                self.streaming = False
                return self.cycle()
            elif data[place : place + 3] == b"P\x23\x01":
                self.group = True
        return b""

    def cycle(self) -> bytes:
        """Give what it sends in one cycle."""
        numbers = [8192, -4096, 2048, 32764, 0, 0, 0]
        out = b""
        for bird in (1, 2) if self.group else (1,):
            words = [(number >> 2) & 0x3FFF for number in numbers]
            record = bytearray(byte for word in words for byte in (word & 0x7F, word >> 7))
            record[0] |= 0x80
            out += bytes(record) + (bytes([bird]) if self.group else b"")
        return out


@pytest.fixture
def recorded(at_a_port, tmp_path: Path) -> Callable[..., object]:
    """Record a stand-in for half a second; gives its records, its settings and the tally."""

    def run(device: Viper | Flock, wishes: Wishes):
        out = tmp_path / "rom.arrows"
        with at_a_port(device) as name, Path(os.devnull).open("w") as sink, Path(os.devnull).open() as keys:
            port = open_port(name, 115200)
            try:
                record(Plan(out, wishes, duration_s=0.5), port, Terminal(sink, keys), Stop(), {})
            finally:
                port.close()
        tally = Tally()
        blocks = list(blocks_of(open_archive(out), tally))
        return concatenated([block.records for block in blocks]), blocks[0].settings, tally

    return run


def test_a_viper_is_set_up_and_recorded(recorded) -> None:
    device = Viper()
    records, settings, tally = recorded(device, Wishes("viper", items=(), no_filters=True))
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
    assert len(records) == pytest.approx(2 * 60, abs=30)
    assert tally.summary is not None
    assert tally.summary["lost_frames"] == 0


def test_a_viper_that_does_not_take_a_setting_is_told(recorded, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"did not take its units: sent was 0200000002000000, and when asked it says"
    ):
        recorded(Viper(deaf_to=(UNITS,)), Wishes("viper", items=()))
    assert not (tmp_path / "rom.arrows").exists()


@pytest.mark.slow
@pytest.mark.parametrize("stations", [None, (1, 2)])
def test_birds_are_recorded(stations, recorded) -> None:
    device = Flock()
    records, settings, _ = recorded(device, Wishes("trakstar", items=(), stations=stations))
    assert device.group == (stations is not None)
    assert device.quaternions == set(stations or (1,))
    assert settings.rate_hz == pytest.approx(100, rel=0.2)
    assert set(records.station.tolist()) == set(stations or (1,))
    inch = 25.4
    assert records.position_mm[1] == pytest.approx([9 * inch, -4.5 * inch, 2.25 * inch])
    assert len(records) == pytest.approx(50 * len(stations or (1,)), rel=0.3)
    assert not device.streaming


def test_what_these_trackers_have_not_is_refused(recorded) -> None:
    for wishes, sentence in (
        (Wishes("viper", items=(), stations=(1,)), "--stations: a VIPER sends every sensor"),
        (Wishes("viper", mode="ascii", items=()), "--ascii: a VIPER sends binary only"),
        (
            Wishes("trakstar", items=(), hemisphere=(0.0, 0.0, 1.0)),
            "set them with the trakSTAR's own program",
        ),
    ):
        with pytest.raises(InputError, match=sentence):
            recorded(Viper(), wishes)
