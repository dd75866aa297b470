"""trakSTAR and Flock of Birds: every number of a record."""

import numpy as np
import pytest
from fuzzing.decoding import decode
from fuzzing.tracker_streams import flock_record, pose, settings

from schemas.errors import InputError
from trackers.trakstar.decoder import FlockDecoder


@pytest.mark.parametrize("group", [False, True])
def test_every_number_comes_out(group: bool) -> None:
    names = [(frame, station) for frame in (1, 2) for station in (1, 2, 3, 4)]
    data = b"".join(flock_record(f, s, group) for f, s in names)
    records = decode(FlockDecoder(settings("trakstar", group=group)), data).records
    assert records.station.tolist() == ([s for _, s in names] if group else [1] * 8)
    assert records.frame.tolist() == [-1] * 8
    assert not records.doubtful.any()
    for row, (frame, station) in enumerate(names):
        position, quaternion = pose(frame, station)
        np.testing.assert_allclose(records.position_mm[row], 10 * np.array(position), atol=914.4 / 8192)
        sign = np.sign(records.quaternion[row] @ quaternion)
        np.testing.assert_allclose(sign * records.quaternion[row], quaternion, atol=2e-4)


def test_a_word_is_two_times_seven_bits() -> None:
    data = bytes([0x80 | 0x01, 0x40, 0x7F, 0x3F, 0, 0x20]) + bytes([0x7F, 0x3F, 0, 0, 0, 0, 0, 0])
    records = decode(FlockDecoder(settings("trakstar", stations=(5,))), data).records
    step_mm = 36 * 25.4 / 8192
    np.testing.assert_allclose(records.position_mm[0], [-8191 * step_mm, 8191 * step_mm, 4096 * step_mm])
    assert records.quaternion[0].tolist() == [8191 / 8192, 0, 0, 0]
    assert records.station.tolist() == [5]


def test_a_station_that_is_not_there_is_doubted() -> None:
    given = settings("trakstar", group=True, stations=(1, 2))
    data = b"".join(flock_record(1, station, True) for station in (1, 2, 9))
    assert decode(FlockDecoder(given), data).records.doubtful.tolist() == [False, False, True]


def test_stations_that_there_are_not() -> None:
    with pytest.raises(InputError, match="expected numbers from 1 to 126"):
        FlockDecoder(settings("trakstar", stations=(127,)))
