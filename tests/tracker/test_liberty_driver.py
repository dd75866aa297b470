"""Setting up a LIBERTY that does not do as it is told: whatever it does not take is found."""

import pytest
from tracker_processes import EVERYTHING_HEARD, StubbornTracker, set_up

from shukotsu.errors import InputError
from shukotsu.tracker import liberty_driver as driver
from shukotsu.tracker.conversation import is_default_alignment
from shukotsu.tracker.emulated_device import EmulatedLiberty, built_in_motion
from shukotsu.tracker.liberty_driver import SETTINGS
from shukotsu.tracker.request import RecordingRequest

REQUEST = RecordingRequest(
    "liberty", asked_hz=120, stations=(1,), hemisphere=(0.0, 0.0, 1.0), no_filters=True
)


def stubborn(unheard: bytes, heard: bytes = b"", *, before: bytes = b"") -> StubbornTracker:
    """A LIBERTY with two receivers; before : what an earlier program has sent it."""
    device = EmulatedLiberty(built_in_motion(), frozenset({1, 2}), ports=4)
    device.receive(before)
    return StubbornTracker(device, unheard, heard)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unheard", "sentence"),
    [
        (b"U1\r", "did not take its units: sent was 1, and when asked it says 0; switch it off and on"),
        (b"R3\r", "did not take its rate: sent was 3, and when asked it says 4"),
        (b"Z1\r", "did not take its external sync: sent was 1, and when asked it says 0"),
        (b"O*,8,9,11,10,12,3,7\r", "did not take its output list of receiver 1: sent was 8, 9, 11, 10, 12"),
        (b"H*,0,0,1\r", "its hemisphere of receiver 1: sent was 0, 0, 1, and when asked it says 1, 0, 0"),
        (b"\x152,0\r", "did not take its active receivers: sent was 1, and when asked it says 1, 2"),
        (b"X0,1,0,0\r", "did not take its position filter"),
        (b"Y0,1,0,0\r", "did not take its attitude filter"),
        (b"U\r", "did not take its units: sent was 1, and when asked it says nothing about it"),
        (b"F1\r", "what answers is no LIBERTY"),
    ],
)
def test_a_setting_that_is_not_taken_ends_it(unheard: bytes, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        set_up(stubborn(unheard), REQUEST)
    assert sentence in str(refused.value)


@pytest.mark.parametrize("obeys", [True, False])
def test_receivers_that_an_earlier_run_has_switched_off_are_switched_on_or_told(obeys: bool) -> None:
    tracker = stubborn(EVERYTHING_HEARD if obeys else b"\x152,1\r", before=b"\x152,0\r")
    settings, warnings = set_up(tracker, RecordingRequest("liberty"))
    assert settings.stations == ((1, 2) if obeys else (1,))
    assert tracker.device.active() == settings.stations
    assert warnings == ([] if obeys else ["receiver 2: cannot be switched on; not recorded"])


COMMANDS = {
    b"U1": ("units", 1), b"R4": ("rate", 4), b"R3": ("rate", 3), b"Z0": ("external_sync", 0),
    b"\x050": ("echo", 0), b"O12,2,4,1": ("output_list", (2, 4, 1), 12),
    b"O*,8,9,11,10,12,3,7": ("output_list", (8, 9, 11, 10, 12, 3, 7)),
    b"H*,1,0,0": ("hemisphere", (1.0, 0.0, 0.0)), b"H3,0,-0.5,0.25": ("hemisphere", (0.0, -0.5, 0.25), 3),
    b"L*,0": ("stylus", 0), b"\x157,1": ("stations", 1, 7),
    b"X0,1,0,0": ("position_filter", driver.FILTER_OFF), b"Y0,1,0,0": ("attitude_filter", driver.FILTER_OFF),
}  # fmt: skip
QUESTIONS = {b"O16": ("output_list", 16), b"\x150": ("stations",), b"\x14": ("bit_errors",)}


def test_commands_are_the_manuals() -> None:
    assert [SETTINGS[name].assignment(*value)[:-1] for name, *value in COMMANDS.values()] == [*COMMANDS]
    assert [SETTINGS[name].question(*station)[:-1] for name, *station in QUESTIONS.values()] == [*QUESTIONS]
    assert (driver.RESET_COUNTERS, driver.STREAM, driver.POLL) == (b"Q0\r", b"C\r", b"P")
    assert (driver.WHOAMI, driver.RATES) == (b"\x16\r", {120: 3, 240: 4})


def test_the_default_frame_may_be_told_in_any_unit() -> None:
    assert is_default_alignment((0, 0, 0, 1, 0, 0, 0, 1, 0))
    assert is_default_alignment((0, 0, 0, 508, 0, 0, 0, 508, 0))
    assert not is_default_alignment((0, 0, 1, 1, 0, 0, 0, 1, 0))
    assert not is_default_alignment((0, 0, 0, 0, 1, 0, -1, 0, 0))
