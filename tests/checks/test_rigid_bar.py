"""A bar that is one, and what is told from a field: a receiver that comes loose, flips, spikes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from wands import bar

from shukotsu.checks.rigid_bar import Bar, usable_bar
from shukotsu.errors import InputError
from shukotsu.skeleton.rotations import about_axis, multiply


def loosened(own: Bar, *rows: int) -> Bar:
    """The second receiver is turned by 3 deg on the bar in those frames."""
    turn, loose = own.quaternion.copy(), about_axis(np.array([0.0, 0.0, 1.0]), np.radians(3.0))
    turn[slice(*rows), 1] = multiply(turn[slice(*rows), 1], loose)
    return replace(own, quaternion=turn)


def mirrored(own: Bar, *rows: int) -> Bar:
    place = own.position_mm.copy()
    place[slice(*rows), 0] *= -1
    return replace(own, position_mm=place)


@pytest.mark.parametrize("steel", [False, True])
def test_a_rigid_bar_is_as_long_as_it_is_and_loses_no_frame(steel: bool) -> None:
    own, found, notes = usable_bar(bar(steel=steel))
    assert (len(own.time_s), notes) == (14_400, [])
    assert found.length_mm == pytest.approx(100.0, abs=0.2)
    assert (found.longer_mm.std() > 0.5) == steel


REFUSED: dict[str, tuple[Callable[[Bar], Bar], str]] = {
    "loose": (lambda own: loosened(own, 7000, None), r"came loose 29\.\d s after the start.* deg elsewhere"),
    "flips": (lambda own: mirrored(own, 3000, 3500), r"receiver 1 jumps .* 12\.5 s after the start"),
    "a side": (lambda own: mirrored(own, None), r"mm apart; expected 20 to 500"),
    "metres": (lambda own: replace(own, position_mm=own.position_mm / 1e3), r" 0\.1.* mm apart; .* in mm"),
    "no bar": (
        lambda own: replace(own, quaternion=np.stack([own.quaternion[:, 0], own.quaternion[::-1, 1]], 1)),
        "which no rigid bar lets them",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_is_no_rigid_bar_is_refused_beside_steel_too(what: str) -> None:
    change, message = REFUSED[what]
    with pytest.raises(InputError, match=message):
        usable_bar(change(bar(steel=True)))


def test_handling_spikes_and_a_short_flip_are_left_out() -> None:
    own = mirrored(loosened(bar(), 0, 600), 5000, 5020)
    own.position_mm[9000::700, 1] += 20.0
    kept, found, notes = usable_bar(own)
    words = ("on the transmitter's other side", "with a spike", "before both receivers were fixed")
    assert [word for word in words if any(word in note for note in notes)] == [*words]
    assert kept.time_s[0] == pytest.approx(600 / 240, abs=0.1)
    assert np.abs(found.longer_mm).max() < 1.5
