"""What can go wrong, one small class a fault: at the sensors (what is measured) and on the line (the bytes).

Times count from the first start of continuous output; before it there is no fault. They are seconds (`2.5`)
or cycles (`600f`), a stretch is `2-4`. Line faults are `RATE` (a probability) or `COUNT@TIME`.
"""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from schemas.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    Flags = npt.NDArray[np.bool_]
    Wholes = npt.NDArray[np.int64]

DETECTION_S = 1.0
"""A receiver that is plugged in is found about so long after."""

_TIME = r"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?f?"
_WHEN = re.compile(rf"({_TIME})(?:-({_TIME}))?")


class NotOneError(ValueError):
    """A fault's text that cannot be read."""


@dataclass(frozen=True)
class When:
    """A time or a stretch of time, in seconds or cycles as written; `last` is None where there is none."""

    first: str
    last: str | None = None

    @classmethod
    def parse(cls, text: str) -> When:
        """Read `2.5`, `600f`, `2-4` or `480f-960f`."""
        found = _WHEN.fullmatch(text)
        if found is None:
            raise NotOneError
        return cls(found[1], found[2])

    def begins(self, rate_hz: float) -> int:
        """The first cycle of it."""
        return _cycles(self.first, rate_hz)

    def ends(self, rate_hz: float) -> int:
        """The first cycle after it; that after the first where only a time is given."""
        return self.begins(rate_hz) + 1 if self.last is None else _cycles(self.last, rate_hz)

    def holds(self, since: Wholes, rate_hz: float) -> Flags:
        """Whether cycles (T,) are in it."""
        return (since >= self.begins(rate_hz)) & (since < self.ends(rate_hz))


def _cycles(text: str, rate_hz: float) -> int:
    return int(float(text[:-1])) if text.endswith("f") else math.ceil(float(text) * rate_hz - 1e-9)


@dataclass
class Conditions:
    """What S stations are exposed to over T cycles; `since` counts from the stream's start, -1 before it.

    plugged, button : (T, S) bool; distortion : (T, S); source : (T,) code of the error letter, 0 for none;
    sync : (T,) bool.
    """

    stations: tuple[int, ...]
    rate_hz: float
    since: Wholes
    plugged: Flags
    button: Flags
    distortion: Wholes
    source: Wholes
    sync: Flags

    def column(self, station: int) -> slice:
        """Where the station stands in the second dimension; nowhere where it is not among these."""
        first = self.stations.index(station) if station in self.stations else len(self.stations)
        return slice(first, first + 1)


@runtime_checkable
class SensorFault(Protocol):
    """Changes what the stations are exposed to."""

    def apply(self, conditions: Conditions) -> None:
        """Change the conditions in place."""
        ...


@dataclass(frozen=True)
class Unplug:
    """A receiver's plug is pulled: its records end at once."""

    station: int
    when: When

    @classmethod
    def parse(cls, text: str) -> Unplug:
        """Read STATION@T."""
        station, when = _at(text)
        return cls(_whole(station), when)

    def apply(self, conditions: Conditions) -> None:
        """Take the station away from then on."""
        late = conditions.since >= self.when.begins(conditions.rate_hz)
        conditions.plugged[late, conditions.column(self.station)] = False


@dataclass(frozen=True)
class Plug:
    """A receiver is plugged in, and found a second later."""

    station: int
    when: When

    @classmethod
    def parse(cls, text: str) -> Plug:
        """Read STATION@T."""
        station, when = _at(text)
        return cls(_whole(station), when)

    def apply(self, conditions: Conditions) -> None:
        """Let the station be found from then on."""
        found = self.when.begins(conditions.rate_hz) + round(DETECTION_S * conditions.rate_hz)
        conditions.plugged[conditions.since >= found, conditions.column(self.station)] = True


@dataclass(frozen=True)
class SourceFail:
    """The transmitter fails: records carry its letter, a-g for the coils X, Y, XY, Z, XZ, YZ, XYZ; or u."""

    letter: str
    when: When

    @classmethod
    def parse(cls, text: str) -> SourceFail:
        """Read LETTER@T-T."""
        letter, when = _at(text)
        if letter not in tuple("abcdefgu"):
            raise NotOneError
        return cls(letter, when)

    def apply(self, conditions: Conditions) -> None:
        """Put the letter."""
        conditions.source[self.when.holds(conditions.since, conditions.rate_hz)] = ord(self.letter)


@dataclass(frozen=True)
class Distortion:
    """Metal near a receiver: the distortion level is 1 (minor) or 2 (significant)."""

    station: int
    level: int
    when: When

    @classmethod
    def parse(cls, text: str) -> Distortion:
        """Read STATION=LEVEL@T-T."""
        what, when = _at(text)
        station, _, level = what.partition("=")
        if level not in ("1", "2"):
            raise NotOneError
        return cls(_whole(station), int(level), when)

    def apply(self, conditions: Conditions) -> None:
        """Raise the station's level."""
        held = self.when.holds(conditions.since, conditions.rate_hz)
        conditions.distortion[held, conditions.column(self.station)] = self.level


@dataclass(frozen=True)
class Stylus:
    """A stylus' button is held down."""

    station: int
    when: When

    @classmethod
    def parse(cls, text: str) -> Stylus:
        """Read STATION@T-T."""
        station, when = _at(text)
        return cls(_whole(station), when)

    def apply(self, conditions: Conditions) -> None:
        """Press the button."""
        held = self.when.holds(conditions.since, conditions.rate_hz)
        conditions.button[held, conditions.column(self.station)] = True


@dataclass(frozen=True)
class Sync:
    """The input for external sync is grounded."""

    when: When

    @classmethod
    def parse(cls, text: str) -> Sync:
        """Read T-T."""
        return cls(When.parse(text))

    def apply(self, conditions: Conditions) -> None:
        """Ground the input."""
        conditions.sync[self.when.holds(conditions.since, conditions.rate_hz)] = True


@dataclass(frozen=True)
class BitErrors:
    """The built-in test finds an error in a station's channel; it stays until it is cleared (^T0)."""

    station: int
    when: When

    @classmethod
    def parse(cls, text: str) -> BitErrors:
        """Read STATION@T."""
        station, when = _at(text)
        return cls(_whole(station), when)


@dataclass(frozen=True)
class Edit:
    """At `position` of a cycle's bytes `removed` bytes go and `inserted` come in their place."""

    kind: str
    position: int
    removed: int
    inserted: bytes


@runtime_checkable
class LineFault(Protocol):
    """Spoils bytes on their way."""

    amount: Amount
    name: str

    def edits(
        self, data: bytes, starts: Sequence[int], hits: Iterable[int], rng: random.Random
    ) -> list[Edit]:
        """Give what happens to the cycle's bytes at the places that are hit."""
        ...


@dataclass(frozen=True)
class Amount:
    """How often: with a probability at every place, or `count` times in the cycle at a time."""

    rate: float = 0.0
    count: int = 0
    when: When | None = None

    @classmethod
    def parse(cls, text: str) -> Amount:
        """Read RATE or COUNT@TIME."""
        if "@" in text:
            count, when = _at(text)
            return cls(count=_whole(count), when=when)
        rate = _real(text)
        if not 0 < rate < 1:
            raise NotOneError
        return cls(rate=rate)

    def hits(self, places: int, since: int, rate_hz: float, rng: random.Random) -> list[int]:
        """Which of that many places are hit in the cycle, in ascending order."""
        if self.when is not None:
            now = self.when.begins(rate_hz) <= since < self.when.ends(rate_hz)
            return sorted(rng.sample(range(places), min(self.count, places))) if now else []
        return list(_scattered(places, self.rate, rng))


def _scattered(places: int, rate: float, rng: random.Random) -> Iterator[int]:
    """Give places that are hit with that probability each, by drawing the gaps between them."""
    place = -1
    while True:
        place += 1 + int(math.log(1 - rng.random()) / math.log1p(-rate))
        if place >= places:
            return
        yield place


@dataclass(frozen=True)
class DropBytes:
    """Bytes get lost."""

    amount: Amount
    name = "drop"

    def edits(
        self, data: bytes, starts: Sequence[int], hits: Iterable[int], rng: random.Random
    ) -> list[Edit]:
        """Lose the bytes."""
        del data, starts, rng
        return [Edit(self.name, at, 1, b"") for at in hits]


@dataclass(frozen=True)
class FlipBytes:
    """Bytes come out as others."""

    amount: Amount
    name = "flip"

    def edits(
        self, data: bytes, starts: Sequence[int], hits: Iterable[int], rng: random.Random
    ) -> list[Edit]:
        """Turn one or more bits of the bytes."""
        del starts
        return [Edit(self.name, at, 1, bytes([data[at] ^ rng.randint(1, 255)])) for at in hits]


@dataclass(frozen=True)
class DuplicateBytes:
    """Bytes come twice."""

    amount: Amount
    name = "duplicate"

    def edits(
        self, data: bytes, starts: Sequence[int], hits: Iterable[int], rng: random.Random
    ) -> list[Edit]:
        """Send the bytes again."""
        del starts, rng
        return [Edit(self.name, at, 0, data[at : at + 1]) for at in hits]


@dataclass(frozen=True)
class Garbage:
    """Bytes that nobody sent stand before a record; with COUNT@TIME so many before the cycle's first."""

    amount: Amount
    name = "garbage"

    def edits(
        self, data: bytes, starts: Sequence[int], hits: Iterable[int], rng: random.Random
    ) -> list[Edit]:
        """Put bytes in; the places that are hit are records where a rate is given."""
        del data
        if self.amount.when is not None:
            return [Edit(self.name, 0, 0, rng.randbytes(len(list(hits))))]
        return [Edit(self.name, starts[place], 0, rng.randbytes(rng.randint(1, 40))) for place in hits]


def damaged(
    data: bytes, starts: Sequence[int], faults: Sequence[LineFault], since: int, rate_hz: float, seed: int
) -> tuple[bytes, list[tuple[int, Edit]]]:
    """Spoil a cycle's bytes. Gives them, and every edit with where it stands in what came out.

    starts : first byte of each of its records. The same cycle and seed are spoilt the same way.
    """
    edits: list[Edit] = []
    for number, fault in enumerate(faults):
        rng = random.Random((seed * 1_000_003 + since) * 64 + number)
        places = len(starts) if fault.name == "garbage" and fault.amount.when is None else len(data)
        hits = fault.amount.hits(places, since, rate_hz, rng)
        if hits:
            edits += fault.edits(data, starts, hits, rng)
    return _applied(data, sorted(edits, key=lambda edit: edit.position))


def _applied(data: bytes, edits: Sequence[Edit]) -> tuple[bytes, list[tuple[int, Edit]]]:
    out, done, told = bytearray(), 0, []
    for edit in edits:
        if edit.position < done:
            continue  # another fault took that byte already
        out += data[done : edit.position]
        told.append((len(out), edit))
        out += edit.inserted
        done = edit.position + edit.removed
    return bytes(out + data[done:]), told


@dataclass(frozen=True)
class FaultOption:
    """One option of the command line: how its text is read, what it looks like and does."""

    parse: Callable[[str], object]
    metavar: str
    help: str


FAULTS = {
    "unplug": FaultOption(Unplug.parse, "STATION@T", "pull a receiver's plug"),
    "plug": FaultOption(Plug.parse, "STATION@T", "plug a receiver in; it is found 1 s later"),
    "source-fail": FaultOption(
        SourceFail.parse, "LETTER@T-T", "put a transmitter's error letter into records: a-g or u"
    ),
    "bit-errors": FaultOption(BitErrors.parse, "STATION@T", "let the built-in test fail until ^T0 clears it"),
    "distortion": FaultOption(Distortion.parse, "STATION=LEVEL@T-T", "raise the distortion level to 1 or 2"),
    "stylus": FaultOption(Stylus.parse, "STATION@T-T", "hold a stylus' button down"),
    "sync": FaultOption(Sync.parse, "T-T", "ground the external sync input"),
    "drop-bytes": FaultOption(lambda text: DropBytes(Amount.parse(text)), "RATE|N@T", "lose bytes"),
    "flip-bytes": FaultOption(lambda text: FlipBytes(Amount.parse(text)), "RATE|N@T", "change bytes"),
    "duplicate-bytes": FaultOption(
        lambda text: DuplicateBytes(Amount.parse(text)), "RATE|N@T", "send bytes twice"
    ),
    "garbage": FaultOption(
        lambda text: Garbage(Amount.parse(text)), "RATE|N@T", "put bytes that are none between records"
    ),
}
"""Every fault by the name of its option."""


def parse_fault(name: str, text: str) -> object:
    """Read one fault as the command line gives it. Raises InputError where it cannot be read."""
    option = FAULTS[name]
    try:
        return option.parse(text)
    except NotOneError as error:
        raise InputError(
            f"--{name}: is {text!r}; expected {option.metavar}, with times in seconds (2.5) or cycles (600f)"
        ) from error


def parse_time(name: str, text: str) -> When:
    """Read an option that is a single time. Raises InputError where it is none."""
    try:
        when = When.parse(text)
    except NotOneError:
        when = None
    if when is None or when.last is not None:
        raise InputError(f"--{name}: is {text!r}; expected a time in seconds (2.5) or cycles (600f)")
    return when


def _at(text: str) -> tuple[str, When]:
    what, mark, when = text.partition("@")
    if not mark:
        raise NotOneError
    return what, When.parse(when)


def _whole(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 100_000:
        raise NotOneError
    return int(text)


def _real(text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise NotOneError from error
