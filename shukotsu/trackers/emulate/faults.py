"""Emulate faults: receivers that are plugged in and out, and bytes that are damaged on the line.

Times count from the first start of continuous output; before it there is no fault. They are seconds (`2.5`)
or cycles (`600f`). Faults of the line are `RATE` (a probability) or `COUNT@TIME`.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from shukotsu.errors import InputError

DETECTION_S = 1.0
"""A receiver that is plugged in is detected about so long after."""

PLUGS = {"unplug": "pull a receiver's plug", "plug": "plug a receiver in; it is found 1 s later"}
LINE_FAULTS = {
    "drop-bytes": "lose bytes",
    "flip-bytes": "change bytes",
    "duplicate-bytes": "send bytes twice",
    "garbage": "put bytes that are none between records",
}
FAULTS = {
    **{name: ("STATION@T", text) for name, text in PLUGS.items()},
    **{name: ("RATE|N@T", text) for name, text in LINE_FAULTS.items()},
}
"""Option of every fault -> what it takes, and its help."""

_TIME = r"(?P<time>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?f?)"
_PLUG = re.compile(rf"(?P<station>[1-9]\d{{0,4}})@{_TIME}", re.ASCII)
_AMOUNT = re.compile(rf"(?P<count>[1-9]\d{{0,4}})@{_TIME}|(?P<rate>\d*\.?\d+(?:[eE][+-]?\d+)?)", re.ASCII)


@dataclass(frozen=True)
class StreamTime:
    """A time since the start of the stream as it was written: seconds, or cycles with an `f`."""

    text: str

    def cycle(self, rate_hz: float) -> int:
        """The first cycle that is not before it."""
        if self.text.endswith("f"):
            return int(float(self.text[:-1]))
        return math.ceil(float(self.text) * rate_hz - 1e-9)


@dataclass(frozen=True)
class Plug:
    """A receiver that is plugged in, or out."""

    station: int
    time: StreamTime
    is_in: bool

    def cycle(self, rate_hz: float) -> int:
        """The first cycle that the device knows of it."""
        return self.time.cycle(rate_hz) + (round(DETECTION_S * rate_hz) if self.is_in else 0)


Edit = tuple[int, int, bytes]
"""A place in a cycle's bytes, how many of them go there, and what comes instead."""


@dataclass(frozen=True)
class LineFault:
    """A fault of the bytes on their way.

    kind : a name in LINE_FAULTS. rate : the probability of every place (bytes; of garbage, records); or,
    where that is 0, `count` places in the cycle of a time (of garbage, so many bytes before its first
    record).
    """

    kind: str
    rate: float = 0.0
    count: int = 0
    time: StreamTime | None = None

    def edits(
        self, data: bytes, starts: Sequence[int], since: int, rate_hz: float, rng: random.Random
    ) -> list[Edit]:
        """Draw the edits of a cycle's bytes; starts : first byte of each of its records."""
        by_record = self.kind == "garbage" and self.time is None
        places = self._places(len(starts) if by_record else len(data), since, rate_hz, rng)
        if self.kind == "drop-bytes":
            return [(at, 1, b"") for at in places]
        if self.kind == "flip-bytes":
            return [(at, 1, bytes([data[at] ^ rng.randint(1, 255)])) for at in places]
        if self.kind == "duplicate-bytes":
            return [(at, 0, data[at : at + 1]) for at in places]
        if by_record:
            return [(starts[nth], 0, rng.randbytes(rng.randint(1, 40))) for nth in places]
        return [(0, 0, rng.randbytes(len(places)))] if places else []

    def _places(self, count: int, since: int, rate_hz: float, rng: random.Random) -> list[int]:
        """Tell which of that many places are hit in the cycle, in ascending order."""
        if self.time is None:
            return list(_scattered(count, self.rate, rng))
        now = since == self.time.cycle(rate_hz)
        return sorted(rng.sample(range(count), min(self.count, count))) if now else []


def _scattered(count: int, rate: float, rng: random.Random) -> Iterator[int]:
    """Give places that are hit with that probability each, by drawing the gaps between them."""
    place = -1
    while True:
        place += 1 + int(math.log(1 - rng.random()) / math.log1p(-rate))
        if place >= count:
            return
        yield place


def damaged(
    data: bytes, starts: Sequence[int], faults: Sequence[LineFault], since: int, rate_hz: float, seed: int
) -> bytes:
    """Damage a cycle's bytes; the same cycle and seed are damaged the same way.

    starts : first byte of each of its records.
    """
    edits: list[Edit] = []
    for number, fault in enumerate(faults):
        rng = random.Random((seed * 1_000_003 + since) * 64 + number)
        edits += fault.edits(data, starts, since, rate_hz, rng)
    edits.sort(key=lambda edit: edit[0])
    out, done = bytearray(), 0
    for position, removed, inserted in edits:
        if position < done:
            continue  # another fault took that byte already
        out += data[done:position] + inserted
        done = position + removed
    return bytes(out + data[done:])


def parse_fault(name: str, text: str) -> Plug | LineFault:
    """Read one fault as the command line gives it. Raises InputError where it cannot be read."""
    matched = (_PLUG if name in PLUGS else _AMOUNT).fullmatch(text)
    if matched is not None:
        parts = matched.groupdict()
        if name in PLUGS:
            return Plug(int(parts["station"]), StreamTime(parts["time"]), name == "plug")
        if parts["count"]:
            return LineFault(name, count=int(parts["count"]), time=StreamTime(parts["time"]))
        if 0 < float(parts["rate"]) < 1:
            return LineFault(name, float(parts["rate"]))
    raise InputError(
        f"--{name}: is {text!r}; expected {FAULTS[name][0]}, with times in seconds (2.5) or cycles (600f)"
    )


def parse_time(name: str, text: str) -> StreamTime:
    """Read an option that is a single time. Raises InputError where it is none."""
    if not re.fullmatch(_TIME, text, re.ASCII):
        raise InputError(f"--{name}: is {text!r}; expected a time in seconds (2.5) or cycles (600f)")
    return StreamTime(text)
