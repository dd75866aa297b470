"""Setting up a LIBERTY or VIPER that ignores commands, and recording a simulated VIPER."""

import io
import struct
from contextlib import closing
from fractions import Fraction
from pathlib import Path

import pytest
from captures import decoded
from tracker_processes import StubbornTracker, at_a_port
from tracker_streams import viper_closed, viper_reply

from shukotsu.errors import InputError
from shukotsu.tables.line_printer import LinePrinter
from shukotsu.tracker import conversation, viper_driver
from shukotsu.tracker import liberty_driver as driver
from shukotsu.tracker.conversation import Conversation, RecordingRequest, StopRequest
from shukotsu.tracker.emulated_device import built_in_motion
from shukotsu.tracker.liberty_driver import SETTINGS, is_default_alignment
from shukotsu.tracker.port import SerialPort, open_port
from shukotsu.tracker.records import StreamSettings
from shukotsu.tracker.session import DRIVERS, RecordingPlan, record

REQUEST = RecordingRequest(
    "liberty", asked_hz=120, stations=(1,), hemisphere=(0.0, 0.0, 1.0), no_filters=True
)


@pytest.fixture(autouse=True)
def _answers_come_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (driver, viper_driver):
        monkeypatch.setattr(module, "ANSWER_S", 0.4)


def set_up(
    tracker: StubbornTracker, request: RecordingRequest, line_baud: int | None = None
) -> tuple[StreamSettings, list[str]]:
    """Set up a tracker at a pseudo-terminal; return the settings and the warnings."""
    with at_a_port(tracker) as name, closing(open_port(name, 115200)) as port:
        port.line_baud = line_baud
        with closing(Conversation(port)) as talk:
            there = DRIVERS[request.family](talk, request)
            return there.set_up(), there.warnings


def stubborn(unheard: bytes = b"no command", heard: bytes = b"", *, before: bytes = b"") -> StubbornTracker:
    """Return a LIBERTY with two receivers that ignores some commands; before : sent by an earlier program."""
    tracker = StubbornTracker(built_in_motion(), frozenset({1, 2}), ports=4)
    tracker.receive(before)
    tracker.unheard, tracker.heard = unheard, heard
    return tracker


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unheard", "sentence"),
    [
        (b"U1\r", "did not accept its units: sent 1, but it reports 0; switch it off and on"),
        (b"R3\r", "did not accept its rate: sent 3, but it reports 4"),
        (b"Z1\r", "did not accept its external sync: sent 1, but it reports 0"),
        (b"O*,8,9,11,10,12,3,7\r", "did not accept its output list of receiver 1: sent 8, 9, 11, 10, 12"),
        (b"H*,0,0,1\r", "its hemisphere of receiver 1: sent 0, 0, 1, but it reports 1, 0, 0"),
        (b"\x152,0\r", "did not accept its active receivers: sent 1, but it reports 1, 2"),
        (b"X0,1,0,0\r", "did not accept its position filter"),
        (b"Y0,1,0,0\r", "did not accept its attitude filter"),
        (b"U\r", "did not accept its units: sent 1, but it reports nothing"),
        (b"F1\r", "the device there is not a LIBERTY"),
    ],
)
def test_a_setting_that_is_not_accepted_is_refused(unheard: bytes, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        set_up(stubborn(unheard), REQUEST)
    assert sentence in str(refused.value)


@pytest.mark.parametrize("obeys", [True, False])
def test_receivers_switched_off_earlier_are_switched_on_or_reported(obeys: bool) -> None:
    tracker = stubborn(b"no command" if obeys else b"\x152,1\r", before=b"\x152,0\r")
    settings, warnings = set_up(tracker, RecordingRequest("liberty"))
    assert settings.stations == ((1, 2) if obeys else (1,))
    assert tracker.active() == settings.stations
    assert warnings == ([] if obeys else ["receiver 2: cannot be switched on; not recorded"])


@pytest.mark.slow
def test_another_line_speed_is_found_by_trying(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = SerialPort.read

    def read(port: SerialPort) -> bytes:
        data = plain(port)
        return data if port.line_baud == 38400 else bytes(255 - byte for byte in data)

    monkeypatch.setattr(SerialPort, "read", read)
    monkeypatch.setattr(conversation, "OTHER_BAUDS", (38400, 19200))
    _, warnings = set_up(stubborn(), RecordingRequest("liberty"), 115200)
    assert warnings == ["it answered at 38400 baud and not at 115200; 38400 is used"]


COMMANDS = {
    b"U1": ("units", 1), b"R4": ("rate", 4), b"R3": ("rate", 3), b"Z0": ("external_sync", 0),
    b"\x050": ("echo", 0), b"O12,2,4,1": ("output_list", (2, 4, 1), 12),
    b"O*,8,9,11,10,12,3,7": ("output_list", (8, 9, 11, 10, 12, 3, 7)),
    b"H*,1,0,0": ("hemisphere", (1.0, 0.0, 0.0)), b"H3,0,-0.5,0.25": ("hemisphere", (0.0, -0.5, 0.25), 3),
    b"L*,0": ("stylus", 0), b"\x157,1": ("stations", 1, 7),
    b"X0,1,0,0": ("position_filter", driver.FILTER_OFF), b"Y0,1,0,0": ("attitude_filter", driver.FILTER_OFF),
}  # fmt: skip
QUESTIONS = {b"O16": ("output_list", 16), b"\x150": ("stations",), b"\x14": ("bit_errors",)}


def test_commands_are_those_of_the_manual() -> None:
    assert [SETTINGS[name].assignment(*value)[:-1] for name, *value in COMMANDS.values()] == [*COMMANDS]
    assert [SETTINGS[name].question(*station)[:-1] for name, *station in QUESTIONS.values()] == [*QUESTIONS]
    assert (driver.RESET_COUNTERS, driver.STREAM, driver.POLL) == (b"Q0\r", b"C\r", b"P")
    assert (driver.WHOAMI, driver.RATES) == (b"\x16\r", {120: 3, 240: 4})


def test_the_default_alignment_is_recognised_in_any_unit() -> None:
    assert is_default_alignment((0, 0, 0, 1, 0, 0, 0, 1, 0))
    assert is_default_alignment((0, 0, 0, 508, 0, 0, 0, 508, 0))
    assert not is_default_alignment((0, 0, 1, 1, 0, 0, 0, 1, 0))
    assert not is_default_alignment((0, 0, 0, 0, 1, 0, -1, 0, 0))


ANY = 0xFFFFFFFF
HEMISPHERE, FILTER, BORESIGHT, RATE, UNITS = 0, 1, 4, 6, 7
STATION_MAP, STYLUS, CONTINUOUS, WHOAMI = 10, 11, 19, 20


class Viper:
    """A VIPER left streaming by an earlier program: two sensors at 120 Hz in inches and degrees."""

    rate = Fraction(120)

    def __init__(self, deaf_to: tuple[int, ...] = ()) -> None:
        self.deaf_to = deaf_to
        self.streaming = True
        self.cycle, self.frame = 0, 12345
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

    def receive(self, data: bytes) -> bytes:
        """Return the answers to commands."""
        out = b""
        while data:
            (size,) = struct.unpack_from("<I", data, 4)
            frame, data = data[: 8 + size], data[8 + size :]
            assert frame == viper_closed(frame[:4], frame[8:-4]), "the checksum of a command"
            _, command, action, *key = struct.unpack_from("<5I", frame, 8)
            out += self.answer(command, action, (command, *key), frame[28:-4])
        return out

    def answer(self, command: int, action: int, key: tuple[int, ...], payload: bytes) -> bytes:
        """Return the answer to one command."""
        if command == CONTINUOUS:
            self.streaming = action == 0
            self.frame = struct.unpack("<i", payload)[0] if self.streaming else self.frame
            return viper_reply(command, b"")
        if action == 0 and command not in self.deaf_to:
            self.settings[key] = payload
        answer = self.settings.get(key, b"") if action == 1 else b""
        return viper_reply(command, answer, 3 if key in self.settings else 4)

    def next_cycle(self) -> bytes:
        """Return the data of one cycle."""
        self.cycle += 1
        if not self.streaming:
            return b""
        position, orientation = struct.unpack("<2I", self.settings[UNITS, ANY, 0])
        body = struct.pack("<4I", 7, self.frame, 0, 2)
        for sensor in (0, 2):
            info = sensor | position << 8 | orientation << 10
            body += struct.pack("<I7f", info, 10, 20, 30, 1, 0, 0, 0)
        self.frame += 1
        return viper_closed(b"VPRP", body)


def recorded(device: Viper, request: RecordingRequest, folder: Path) -> Path:
    plan = RecordingPlan(folder / "rom.arrows", request, duration_s=0.3)
    with at_a_port(device) as name, closing(open_port(name, 115200)) as port:
        record(plan, port, LinePrinter(io.StringIO()), StopRequest(), {})
    return plan.out


def test_a_viper_is_set_up_and_recorded(tmp_path: Path) -> None:
    device = Viper()
    out = recorded(device, RecordingRequest("viper", no_filters=True), tmp_path)
    records, tally, settings = decoded(out)
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
    assert {*records.station.tolist()} == {1, 3}
    assert records.position_mm[0].tolist() == [100.0, 200.0, 300.0]
    assert records.frame.tolist() == [frame for frame in range(len(records) // 2) for _ in settings.stations]
    assert len(records) > 2 * 6
    assert tally.summary is not None
    assert tally.summary["lost_frames"] == 0


def test_a_viper_that_does_not_accept_a_setting_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"did not accept its units: sent 0200000002000000, but it"):
        recorded(Viper(deaf_to=(UNITS,)), RecordingRequest("viper"), tmp_path)
    assert not (tmp_path / "rom.arrows").exists()
