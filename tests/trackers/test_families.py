"""Which family a port has: what is named, what the port's own name says, and where the two differ."""

from dataclasses import replace

import pytest

from shukotsu.errors import InputError
from shukotsu.trackers.families import FAMILIES, family_at


def test_a_port_may_say_its_family(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(FAMILIES, "own", replace(FAMILIES["viper"], scheme="own"))
    assert family_at("/dev/ttyUSB0", None) == family_at("socket://host:1", None) == "liberty"
    assert family_at("COM3", "viper") == "viper"
    assert family_at("own:x", None) == family_at("own:x", "own") == "own"
    with pytest.raises(InputError, match="--tracker: is viper, and --port is own:x; expected own"):
        family_at("own:x", "viper")
    with pytest.raises(
        InputError, match=r"--tracker: is own, and --port is COM3; expected a port own:\.\.\."
    ):
        family_at("COM3", "own")
