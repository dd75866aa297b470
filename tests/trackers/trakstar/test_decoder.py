"""trakSTAR and Flock of Birds: every number of a record."""

import numpy as np
import pytest
from fuzzing.decoding import decode
from fuzzing.tracker_streams import flock_record, pose, settings

from shukotsu.trackers.trakstar.decoder import FlockDecoder


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


def test_a_station_that_is_not_there_is_doubted() -> None:
    given = settings("trakstar", group=True, stations=(1, 2))
    data = b"".join(flock_record(1, station, True) for station in (1, 2, 9))
    assert decode(FlockDecoder(given), data).records.doubtful.tolist() == [False, False, True]
