"""Setting up and recording a trakSTAR, against a stand-in that does what the Flock of Birds guide says."""

import pytest

from shukotsu.trackers.record.request import RecordingRequest


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


@pytest.mark.slow
@pytest.mark.parametrize("stations", [None, (1, 2)])
def test_birds_are_recorded(stations, recorded) -> None:
    device = Flock()
    records, settings, _ = recorded(device, RecordingRequest("trakstar", items=(), stations=stations))
    assert device.group == (stations is not None)
    assert device.quaternions == set(stations or (1,))
    assert 0 < settings.rate_hz < 150  # it is measured
    assert set(records.station.tolist()) == set(stations or (1,))
    inch = 25.4
    assert records.position_mm[1] == pytest.approx([9 * inch, -4.5 * inch, 2.25 * inch])
    assert len(records) > 2 * len(stations or (1,))
    assert not device.streaming
