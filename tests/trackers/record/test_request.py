"""What the user may ask for, and what is refused in a sentence."""

import pytest

from shukotsu.errors import InputError
from shukotsu.trackers.record import request


@pytest.mark.parametrize(
    ("family", "settings", "sentence"),
    [
        ("viper", {"stations": (1,)}, "--stations: a VIPER sends every sensor"),
        ("viper", {"short": True}, "--items: a VIPER has no output lists"),
        ("patriot", {"asked_hz": 120}, "--rate: a patriot has a rate of its own"),
        ("fastrak", {}, "--tracker: fastrak left in 0.2: record with the tracker's own program"),
        ("trakstar", {}, "--tracker: trakstar left in 0.2: record with the tracker's own program"),
        ("openigtlink", {}, "--tracker: openigtlink left in 0.2: record with PLUS or 3D Slicer"),
        ("libety", {}, "--tracker: is 'libety'; expected one of liberty, patriot, viper"),
    ],
)
def test_what_a_family_cannot_do_is_refused(family: str, settings, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        request.RecordingRequest(family, **settings)
