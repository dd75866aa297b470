"""An export needs as much memory for twenty minutes of a hand as for one, in the formats that stream."""

from pathlib import Path

import pytest

from benchmarks.long_recordings import LongHand, process

SHORT, LONG = 1.0, 20.0
MOST_MB = 60.0

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def hands(tmp_path_factory: pytest.TempPathFactory) -> dict[float, LongHand]:
    """The tables of a short and of a long recording."""
    made = {}
    for minutes in (SHORT, LONG):
        hand = LongHand(tmp_path_factory.mktemp("hand"))
        hand.write(minutes)
        for job, _, _ in hand.jobs():
            if job.stage != "export":
                process(["-m", f"stages.{job.stage}", *job.words])
        made[minutes] = hand
    return made


@pytest.mark.parametrize("name", ["bvh", "csv", "c3d", "glb", "bids"])
def test_memory_does_not_grow_with_the_recording(
    hands: dict[float, LongHand], tmp_path: Path, name: str
) -> None:
    memory_mb = {}
    for minutes, hand in hands.items():
        job = hand.export(name, tmp_path / f"{minutes:g}")
        memory_mb[minutes] = process(["-m", "stages.export", *job.words]).memory_mb
    assert memory_mb[LONG] - memory_mb[SHORT] < MOST_MB
