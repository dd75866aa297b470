"""Setting up a LIBERTY that does not do as it is told: whatever it does not take is found."""

import pytest

from schemas.errors import InputError
from stages.capture.emulate.device import World
from stages.capture.emulate.liberty import Liberty
from stages.capture.emulate.poses_source import BuiltInMotion
from stages.capture.record.conversation import Conversation, NoJournal
from stages.capture.record.liberty_driver import LibertyDriver
from stages.capture.record.port import open_port
from stages.capture.record.reader import Reader
from stages.capture.record.wishes import FORWARD, Wishes


class Stubborn:
    """An emulated LIBERTY that hears something else, or nothing, for one of its commands."""

    streaming = True
    period_s = 1 / 240

    def __init__(self, unheard: bytes, heard: bytes = b"") -> None:
        self.device = Liberty(World(BuiltInMotion(), frozenset({1, 2})), ports=4)
        self.unheard, self.heard = unheard, heard

    def take(self, data: bytes) -> bytes:
        """Answer commands."""
        return self.device.receive(data.replace(self.unheard, self.heard))

    def cycle(self) -> bytes:
        """Give what it sends in one cycle."""
        return self.device.next_cycle().data


def set_up(name: str, wishes: Wishes, *, put_back: bool = False):
    """Set it up, and back; gives the settings and the warnings."""
    port = open_port(name, 115200)
    reader = Reader(port)
    driver = LibertyDriver(Conversation(port, reader, NoJournal()), wishes)
    try:
        return driver.set_up(), driver.warnings
    finally:
        if put_back:
            driver.put_back()
        reader.close()
        port.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unheard", "sentence"),
    [
        (b"U1\r", "did not take its units: sent was 1, and when asked it says 0; switch it off and on"),
        (b"R3\r", "did not take its rate: sent was 3, and when asked it says 4"),
        (b"Z1\r", "did not take its external sync: sent was 1, and when asked it says 0"),
        (
            b"O*,8,9,11,10,12,3,7\r",
            "did not take its output list of receiver 1: sent was 8, 9, 11, 10, 12, 3, 7",
        ),
        (
            b"H*,0,0,1\r",
            "did not take its hemisphere of receiver 1: sent was 0, 0, 1, and when asked it says 1, 0, 0",
        ),
        (b"\x152,0\r", "did not take its active receivers: sent was 1, and when asked it says 1, 2"),
        (b"X0,1,0,0\r", "did not take its position filter"),
        (b"Y0,1,0,0\r", "did not take its attitude filter"),
        (b"U\r", "did not take its units: sent was 1, and when asked it says nothing about it"),
        (b"F1\r", "the tracker was told to answer in binary and does not"),
    ],
)
def test_a_setting_that_is_not_taken_ends_it(unheard: bytes, sentence: str, at_a_port) -> None:
    wishes = Wishes("liberty", rate_hz=120, stations=(1,), hemisphere=(0.0, 0.0, 1.0), no_filters=True)
    with at_a_port(Stubborn(unheard)) as name, pytest.raises(InputError) as told:
        set_up(name, wishes)
    assert str(told.value).startswith(f"{name}: the tracker ")
    assert sentence in str(told.value)


@pytest.mark.slow
def test_what_the_tracker_complains_of_is_told(at_a_port) -> None:
    with at_a_port(Stubborn(b"R3\r", b"R9\r")) as name, pytest.raises(InputError) as told:
        set_up(name, Wishes("liberty", rate_hz=120))
    assert "sent was 3, and when asked it says 4 (it complained: parameter above its limit)" in str(
        told.value
    )


@pytest.mark.slow
def test_an_echo_is_switched_off_or_told(at_a_port) -> None:
    stubborn = Stubborn(b"\x050\r")
    stubborn.device.receive(b"\x051\r")
    with (
        at_a_port(stubborn) as name,
        pytest.raises(InputError, match="its echo: sent was 0, and when asked it says 1"),
    ):
        set_up(name, Wishes("liberty"))


def test_one_that_obeys(at_a_port) -> None:
    """The same wishes, all heard."""
    stubborn = Stubborn(b"not a command")
    wishes = Wishes("liberty", rate_hz=120, stations=(1,), hemisphere=(0.0, 0.0, 1.0), no_filters=True)
    with at_a_port(stubborn) as name:
        settings, warnings = set_up(name, wishes)
    assert warnings == []
    assert settings.stations == (1,)
    assert settings.rate_hz == 120
    assert sorted(settings.items) == [1, 2, 3, 4], "a receiver that is plugged in later is decoded too"
    assert not stubborn.device.streaming


@pytest.mark.parametrize("how", ["obeys", "keeps it off"])
def test_receivers_that_an_earlier_run_has_switched_off_are_switched_on_or_told(how: str, at_a_port) -> None:
    stubborn = Stubborn(b"not a command" if how == "obeys" else b"\x152,1\r")
    stubborn.device.receive(b"\x152,0\r")
    with at_a_port(stubborn) as name:
        settings, warnings = set_up(name, Wishes("liberty", hemisphere=FORWARD))
    assert settings.stations == ((1, 2) if how == "obeys" else (1,))
    assert stubborn.device.active() == settings.stations
    told = ["receiver 2: cannot be switched on; not recorded"]
    assert warnings == ([] if how == "obeys" else told)


@pytest.mark.parametrize("stations", [None, (2,)])
def test_receivers_are_switched_back(stations, at_a_port) -> None:
    stubborn = Stubborn(b"not a command")
    stubborn.device.receive(b"\x152,0\r")
    with at_a_port(stubborn) as name:
        settings, _ = set_up(name, Wishes("liberty", stations=stations), put_back=True)
    assert settings.stations == (stations or (1, 2))
    assert stubborn.device.active() == (1,)


@pytest.mark.slow
def test_with_no_receiver_that_can_be_switched_on_it_ends(at_a_port) -> None:
    stubborn = Stubborn(b",1\r", b",0\r")
    stubborn.device.receive(b"\x151,0\r\x152,0\r")
    with at_a_port(stubborn) as name, pytest.raises(InputError) as told:
        set_up(name, Wishes("liberty"))
    assert "its active receivers: sent was 1, 2, and when asked it says nothing" in str(told.value)
