"""An emulated LIBERTY or PATRIOT: its settings, how it frames answers, and how it takes bytes in. No I/O.

Source: LIBERTY User Manual URM03PH156, command syntax and reply framing. What no manual says is invented and
listed in docs/emulator.md.
"""

from __future__ import annotations

import copy
import struct
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from stages.capture.emulate.device import Device, World
from stages.capture.emulate.encode import Block, Measured, encode, from_euler_deg, liberty_framing
from stages.capture.emulate.frames import StationFrames
from stages.capture.emulate.liberty_commands import COMMANDS, arguments_of
from stages.capture.emulate.liberty_settings import ERRORS, NO_FILTER, RefusedError, Settings, StationSettings
from stages.capture.trackers.liberty.items import SINGLE, STREAMED, TAGS
from stages.capture.trackers.settings import MM_PER_UNIT

MAX_COMMAND_CHARACTERS = 255

RATES_HZ = {2: 60, 3: 120, 4: 240}
OLD_LIST = (2, 4, 9, 1)
"""What a device that is found streaming was told before: not what a recorder asks for."""

_CR, _LF, _P = b"\r"[0], b"\n"[0], b"P"[0]


class Liberty(Device):
    """LIBERTY with 4 to 16 connectors, or PATRIOT with 2.

    rate_hz : 240 or 120 (PATRIOT: 60). Raises ValueError where the device has no such rate.
    """

    def __init__(
        self, world: World, *, family: str = "liberty", ports: int = 16, rate_hz: int | None = None
    ) -> None:
        self.family, self.ports = family, ports
        self._rates = [60] if family == "patriot" else [240, 120]
        rate_hz = rate_hz or self._rates[0]
        if rate_hz not in self._rates:
            raise ValueError(f"{family} has no rate of {rate_hz} Hz")
        self._factory_rate = next(code for code, hz in RATES_HZ.items() if hz == rate_hz)
        self.settings = self._factory()
        self.slots: dict[int, Settings] = {}
        self.startup_slot = 0
        self._typed = bytearray()
        super().__init__(world)

    @property
    def rate(self) -> Fraction:
        """Cycles a second."""
        return Fraction(RATES_HZ[self.settings.rate])

    @property
    def buffered(self) -> bool:
        """Whether the USB FIFO is on (@B)."""
        return bool(self.settings.buffered)

    @property
    def rate_codes(self) -> tuple[int, ...]:
        """Values that the rate command takes."""
        return (2, 3, 4) if self.family == "patriot" else (3, 4)

    @property
    def all_stations(self) -> tuple[int, ...]:
        """One for every connector."""
        return tuple(range(1, self.ports + 1))

    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; give the answers, echo among them where that is on."""
        if self.deaf_until is not None:
            return b""
        out = bytearray()
        for byte in data:
            if self.settings.echo:
                out.append(byte)
            out += self._take(byte)
        return bytes(out)

    def power_up_streaming(self) -> None:
        """Be as an earlier client left it: streaming in binary, centimetres, an output list of its own."""
        self.settings.binary, self.settings.unit = 1, 1
        for station in self.settings.stations.values():
            station.items = OLD_LIST
        self.start_stream()

    def reply(self, command: int, text: str, binary: bytes = b"", station: int = 0) -> bytes:
        """Frame an answer: in binary 8 bytes and the body, in ASCII station, letter, error, blank, text."""
        if self.settings.binary:
            return self._header(station, command, 0, len(binary)) + binary
        letter = chr(command + 0x60) if command < 0x20 else chr(command)
        return f"{station:02d}{letter}  {text}\r\n".encode("latin-1")

    def change_rate(self, code: int) -> None:
        """Measure that often from the next cycle on; a PATRIOT does not heed it."""
        if self.family == "liberty":
            before, self.settings.rate = self.rate, code
            self.keep_time(before)

    def save(self, slot: int) -> None:
        """Keep the settings in a slot."""
        self.slots[slot] = copy.deepcopy(self.settings)

    def reinitialise(self) -> None:
        """Start again, with the settings of the start-up slot."""
        before = self.rate
        self.settings = copy.deepcopy(self.slots.get(self.startup_slot, self._factory()))
        self.keep_time(before)
        self._typed.clear()
        self.restart()

    def ready_text(self) -> bytes:
        """What RS-232 brings after power-up."""
        return f"{self.family.upper()} Ready!\r\n".encode()

    def enabled(self, station: int) -> bool:
        """Whether the station's state is on."""
        return self.settings.stations[station].enabled

    def frames_of(self, station: int) -> StationFrames:
        """The reference frames of a station."""
        return self.settings.stations[station].frames

    def hemisphere_of(self, station: int) -> tuple[float, ...]:
        """Its hemisphere."""
        return self.settings.stations[station].hemisphere

    def new_share(self) -> float:
        """Halfway between the least and the most that the position filter lets in."""
        _, low, high, _ = self.settings.position_filter
        return 1.0 if self.settings.position_filter == NO_FILTER else (low + high) / 2

    def mounting(self) -> npt.NDArray[np.float64]:
        """How the transmitter is mounted, quaternion (4,)."""
        azimuth, elevation, roll = self.settings.mounting_deg
        return from_euler_deg(azimuth, elevation, roll)

    def mm_per_unit(self) -> float:
        """Millimetres of the unit."""
        return MM_PER_UNIT["cm"] if self.settings.unit else MM_PER_UNIT["inch"]

    def button_toggles(self, station: int) -> bool:
        """Only in point and track mode does a press act on the stream."""
        return self.settings.stations[station].stylus == 1

    def encoded(self, measured: Measured, *, single: bool) -> Block:
        """Encode cycles as the settings of the moment say."""
        if not self.settings.sync:
            measured.sync[:] = 0
        lists = {number: station.items for number, station in self.settings.stations.items()}
        framing = liberty_framing(self.family, SINGLE if single else STREAMED)
        return encode(measured, lists, framing, binary=bool(self.settings.binary))

    def _factory(self) -> Settings:
        return Settings(
            {number: StationSettings() for number in range(1, self.ports + 1)}, rate=self._factory_rate
        )

    def _header(self, station: int, command: int, error: int, size: int) -> bytes:
        return TAGS[self.family] + struct.pack("<BBBBh", station, command, error, 0, size)

    def _take(self, byte: int) -> bytes:
        """Take one byte: P acts at once, CR ends a command, LF is nothing."""
        if byte == _LF:
            return b""
        if not self._typed and byte in (_P, _P + 32):
            self.leave_block()
            self.streaming = False
            return self.single()
        if byte != _CR:
            self._typed.append(byte)
            if len(self._typed) <= MAX_COMMAND_CHARACTERS:
                return b""
            self._typed.clear()
            return self._error(0, 16)
        typed = bytes(self._typed)
        self._typed.clear()
        return self._obey(typed)

    def _obey(self, typed: bytes) -> bytes:
        code = typed[:1].upper()
        if typed[:2].upper() == b"@B":
            code, typed = b"@", typed[1:]
        command = COMMANDS.get(code)
        first = code[0] if code else _CR
        if command is None:
            return self._error(first, 1)
        self.leave_block()
        try:
            return command(self, arguments_of(code, typed[1:]))
        except RefusedError as refused:
            return self._error(first, refused.code)

    def _error(self, command: int, code: int) -> bytes:
        text = f"{ERRORS[code]}\r\n".encode()
        return self._header(0, command, code, len(text)) + text if self.settings.binary else text
