"""Setting up a FASTRAK: what it takes, what it does not take, and setting it back."""

import pytest
from stubborn_trackers import StubbornTracker, set_up

from shukotsu.errors import InputError
from shukotsu.trackers.emulate.device import World
from shukotsu.trackers.emulate.pose_sources import built_in_motion
from shukotsu.trackers.fastrak.emulated_device import EmulatedFastrak
from shukotsu.trackers.record.request import RecordingRequest

REQUEST = RecordingRequest("fastrak", stations=(1,), hemisphere=(0.0, 0.0, 1.0), no_filters=True)


def stubborn(unheard: bytes) -> StubbornTracker:
    """A FASTRAK with two receivers that an earlier program has left streaming."""
    device = EmulatedFastrak(World(built_in_motion(), frozenset({1, 2})))
    device.power_up_streaming()
    device.receive(b"A1,0,0,0,0,1,0,-1,0,0\r")
    return StubbornTracker(device, unheard)


def test_one_that_obeys_is_set_up_and_back() -> None:
    tracker = stubborn(b"not a command")
    before = {number: (each.items, each.stylus) for number, each in tracker.device.stations.items()}
    settings, warnings = set_up(tracker, REQUEST, put_back=True)
    assert (settings.stations, settings.rate_hz, settings.unit) == ((1,), 120.0, "cm")
    assert settings.items[1] == (2, 11, 16, 1)
    assert settings.options["after"]["stylus"]["1"] == (0.0,)
    assert warnings == [
        "receiver 1: an alignment moves its frame (0, 0, 0, 0, 1, 0, -1, 0, 0), left as it is"
    ]
    assert not tracker.device.streaming
    assert before == {number: (each.items, each.stylus) for number, each in tracker.device.stations.items()}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unheard", "sentence"),
    [
        (b"O1,2,11,16,1\r", "did not take its output list of receiver 1: sent was 2, 11, 16, 1"),
        (
            b"H1,0,0,1\r",
            "did not take its hemisphere of receiver 1: sent was 0, 0, 1, and when asked it says",
        ),
        (b"e1,0\r", "did not take its stylus mode of receiver 1: sent was 0, and when asked it says 1"),
        (b"l2,0\r", "did not take its active receivers: sent was 1, and when asked it says 1, 2"),
        (b"x0,1,0,0\r", "did not take its position filter: sent was 0, 1, 0, 0"),
    ],
)
def test_a_setting_that_is_not_taken_ends_it(unheard: bytes, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        set_up(stubborn(unheard), REQUEST)
