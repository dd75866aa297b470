"""Drivers of trackers that keep their settings from one program to the next: LIBERTY, PATRIOT and FASTRAK.

They do not answer when something is set. So: ask for everything, set what matters, ask again and compare.
What would last beyond this recording, or add up (saved settings, alignment, boresight), is never sent.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from shukotsu.trackers.families import FAMILIES
from shukotsu.trackers.record.conversation import Conversation
from shukotsu.trackers.record.driver import (
    Driver,
    is_default_alignment,
    is_zero,
    same_direction,
    same_value,
    shown,
)
from shukotsu.trackers.record.request import TRACK, RecordingRequest

State = dict[str, Any]
"""Name of a setting -> its value, or station -> value; None where the tracker did not say."""

LEFT = ", left as it is"
FILTER_OFF = (0.0, 1.0, 0.0, 0.0)
FRAMES = {
    "boresight": (is_zero, "a boresight turns its orientations"),
    "alignment": (is_default_alignment, "an alignment moves its frame"),
    "tip_offset": (is_zero, "a tip offset moves its positions"),
}
"""Setting that an earlier program may have left in force -> whether a value is none, what it does."""


@dataclass(frozen=True)
class Setting:
    """A setting that can be asked for, and most of them set.

    command : its letter. kind : of the answer, "number", "numbers" (a list of whole ones), "floats", "words",
    "stations" (two halves of bits) or "columns". count : how many floats; width : characters of each column.
    per_station : asked and set for each station.
    """

    command: bytes
    kind: str
    count: int = 1
    width: int = 0
    per_station: bool = False

    def question(self, station: int = 0) -> bytes:
        """The bytes that ask for it; of `stations`, 0 asks for all."""
        asks_station = self.per_station or self.kind == "stations"
        return self.command + (str(station).encode() if asks_station else b"") + b"\r"

    def assignment(self, value: float | Sequence[float], station: int | None = None) -> bytes:
        """The bytes that set it, of one station or (None) of all where it is a station's."""
        numbers = [value] if isinstance(value, int | float) else value
        words = [f"{number:g}" for number in numbers]
        if self.per_station or self.kind == "stations":
            words.insert(0, "*" if station is None else str(station))
        return self.command + ",".join(words).encode() + b"\r"


class SettingsDriver(Driver):
    """Driver of a tracker whose settings are compared before and after; settings : what is asked for."""

    settings: ClassVar[Mapping[str, Setting]]
    answers_all: ClassVar[bool] = True
    """Whether no answer to a question means that a setting was not taken; otherwise it is a warning."""

    def __init__(self, conversation: Conversation, request: RecordingRequest) -> None:
        super().__init__(conversation, request)
        self._ports = FAMILIES[request.family].ports[-1]
        self._before: State = {}
        self._complaints: list[str] = []

    @abstractmethod
    def _ask(self, setting: Setting, station: int = 0) -> Any:
        """Ask for a setting, of a station where it has its own; None where it is not answered."""

    def _ask_all(self) -> State:
        stations = range(1, self._ports + 1)
        return {
            name: {str(station): self._ask(setting, station) for station in stations}
            if setting.per_station
            else self._ask(setting)
            for name, setting in self.settings.items()
        }

    def _set_all(self, wanted: Mapping[str, Any], stations: Sequence[int | None] = (None,)) -> None:
        """Set what is wanted; stations : each that is set by itself, None for all at once."""
        for name, value in wanted.items():
            for station in stations if self.settings[name].per_station else (None,):
                self._conversation.send(self.settings[name].assignment(value, station))

    def _restore(self, names: Iterable[str]) -> None:
        """Set those settings to what they were before."""
        for name in names:
            setting, before = self.settings[name], self._before[name]
            for station, value in before.items() if setting.per_station else [(0, before)]:
                if value is not None:
                    self._conversation.send(setting.assignment(value, int(station)))

    def _compare(self, after: State, wanted: Mapping[str, Any], stations: tuple[int, ...]) -> None:
        """Raise InputError where a setting is not what was sent."""
        for name, value in wanted.items():
            title = "stylus mode" if name == "stylus" else name.replace("_", " ")
            if self.settings[name].per_station:
                for station in stations:
                    self._compare_one(
                        f"{title} of receiver {station}", name, after[name][str(station)], value
                    )
            else:
                self._compare_one(title, name, after[name], value)

    def _compare_one(self, what: str, name: str, reported: Any, sent: Any) -> None:
        if reported is None and not self.answers_all:
            self.warnings.append(f"it does not say its {what}")
            return
        # While it follows the receiver it may well tell the present half instead of 0, 0, 0.
        if name == "hemisphere" and (sent == TRACK or (reported and same_direction(reported, sent))):
            return
        # The manual gives the lowest and the highest in another order when it is asked for.
        if name.endswith("filter") and reported and same_value(tuple(sorted(reported)), tuple(sorted(sent))):
            return
        self._require(what, reported, sent, self._complaints)

    def _warn_of_frames(self, after: State, stations: tuple[int, ...]) -> None:
        """Warn of what an earlier program has left in force, which is not for a recorder to undo."""
        for name, (is_default, text) in FRAMES.items():
            if name not in after:
                continue
            odd = [s for s in stations if after[name][str(s)] and not is_default(after[name][str(s)])]
            if odd:
                self.warnings.append(
                    f"receiver {listed(odd)}: {text} ({shown(after[name][str(odd[0])])}){LEFT}"
                )


def listed(stations: Iterable[int]) -> str:
    """Write stations for people."""
    return ", ".join(map(str, stations)) or "none"
