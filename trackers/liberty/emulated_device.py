"""An emulated LIBERTY or PATRIOT: its settings, how it frames answers, and how it takes bytes in. No I/O.

Source: LIBERTY User Manual URM03PH156, command syntax and reply framing. What no manual says is invented and
listed in docs/emulator.md.
"""

from __future__ import annotations

import struct
from fractions import Fraction

from trackers.emulate.device import EmulatedDevice, RefusedError, StationSettings, World
from trackers.emulate.encoding import Framing
from trackers.liberty.emulated_commands import COMMANDS, UNKNOWN_COMMAND
from trackers.liberty.items import DEFAULT_LIST, OUTPUT_ITEMS, SINGLE, STREAMED, TAGS
from trackers.liberty.replies import ERRORS

RATES_HZ = {2: 60, 3: 120, 4: 240}
"""Value of the rate command -> frames a second."""

_CR, _LF, _P = b"\r"[0], b"\n"[0], b"P"[0]


class EmulatedLiberty(EmulatedDevice):
    """LIBERTY with 4 to 16 connectors, or PATRIOT with 2; rate_hz : at power-up."""

    earlier_list = (2, 4, 9, 1)

    def __init__(self, world: World, *, family: str = "liberty", ports: int = 16, rate_hz: int = 240) -> None:
        stations = {number: StationSettings(DEFAULT_LIST) for number in range(1, ports + 1)}
        super().__init__(world, stations, (0.2, 0.2, 0.8, 0.95))
        self.family, self.ports = family, ports
        self.rate_code = next(code for code, hz in RATES_HZ.items() if hz == rate_hz)
        self.mounting_deg: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.sync = self.echo = 0
        self.buffered = 1

    @property
    def rate(self) -> Fraction:
        """Cycles a second; a PATRIOT does not heed the rate command."""
        return Fraction(60 if self.family == "patriot" else RATES_HZ[self.rate_code])

    def receive(self, data: bytes) -> bytes:
        """Take bytes of the client; give the answers, echo among them where that is on."""
        if self.deaf_until is not None:
            return b""
        out = bytearray()
        for byte in data:
            if self.echo:
                out.append(byte)
            out += self._take(byte)
        return bytes(out)

    def reply(self, command: int, text: str, binary: bytes = b"", station: int = 0) -> bytes:
        """Frame an answer: in binary 8 bytes and the body, in ASCII station, letter, error, blank, text."""
        if self.binary:
            return self._header(station, command, 0, len(binary)) + binary
        letter = chr(command + 0x60) if command < 0x20 else chr(command)
        return f"{station:02d}{letter}  {text}\r\n".encode("latin-1")

    def ready_text(self) -> bytes:
        """What RS-232 brings after power-up."""
        return f"{self.family.upper()} Ready!\r\n".encode()

    def framing(self, *, single: bool) -> Framing:
        """How records are framed, while streaming or in answer to a single poll."""
        header: dict[str, bytes | int] = {"tag": TAGS[self.family], "command": SINGLE if single else STREAMED}
        return Framing(OUTPUT_ITEMS, header, station_byte=0, text_header="%02d  ")

    def _header(self, station: int, command: int, error: int, size: int) -> bytes:
        return TAGS[self.family] + struct.pack("<BBBBh", station, command, error, 0, size)

    def _take(self, byte: int) -> bytes:
        """Take one byte: P acts at once, CR ends a command, LF is nothing."""
        if byte == _LF:
            return b""
        if not self._typed and byte in (_P, _P + 32):
            self.streaming = False
            return self.single()
        if byte != _CR:
            self._typed.append(byte)
            return b""
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
            return self._error(first, UNKNOWN_COMMAND)
        self.leave_block()
        arguments = [part.strip() for part in typed[1:].decode("latin-1").split(",")]
        try:
            return command(self, [] if arguments == [""] else arguments)
        except RefusedError as refused:
            return self._error(first, refused.code)

    def _error(self, command: int, code: int) -> bytes:
        text = f"{ERRORS[code].title()}\r\n".encode()
        return self._header(0, command, code, len(text)) + text if self.binary else text
