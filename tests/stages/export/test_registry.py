"""What holds for every format: the same bytes again, the motion left as it was, one sentence where it cannot
be.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_samples.moving_fingers import moving_fingers, timed

from shukotsu.errors import InputError
from shukotsu.schemas.poses import RecordingName
from shukotsu.skeleton.posing import Origin, PosedRecording
from shukotsu.stages.export.registry import FORMATS, Settings, write_format

WITHOUT_GAPS = [name for name, form in FORMATS.items() if not form.holds_gaps]
ON_TIME = ("glb", "osim")


def write(motion: PosedRecording, name: str, folder: Path) -> tuple[str, ...]:
    """Write a motion by its format's own writer, as it is."""
    chosen = FORMATS[name]
    path = folder / (chosen.shared or f"a{chosen.extensions[0]}")
    return tuple(chosen.writers.write(motion, path))


def files(folder: Path) -> dict[str, bytes]:
    """Content of all files, by path."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_motion_is_the_same_files(name: str, tmp_path: Path) -> None:
    motion = moving_fingers(10, slip_mm=0.5)
    place, turn = motion.position_mm.copy(), motion.quaternion.copy()
    for folder in ("a", "b"):
        write_format(motion, Settings(), name, tmp_path / folder / (FORMATS[name].shared or f"x.{name}"))
    assert files(tmp_path / "a")
    assert files(tmp_path / "a") == files(tmp_path / "b")
    np.testing.assert_array_equal(motion.position_mm, place)
    np.testing.assert_array_equal(motion.quaternion, turn)


@pytest.mark.parametrize("name", FORMATS)
def test_provenance_is_in_a_file_or_beside_it(name: str, tmp_path: Path) -> None:
    """The subject's name in its own script, the licence, and the tables' hashes."""
    motion = moving_fingers(5)
    origin = Origin(RecordingName("Ö", "right", "wave"), licence="CC BY 4.0", inputs={"a.parquet": "ab" * 32})
    path = tmp_path / (FORMATS[name].shared or f"a{FORMATS[name].extensions[0]}")
    remarks = write_format(replace(motion, origin=origin), Settings(fps=50), name, path)
    assert remarks[0].startswith("resampled from 5 frames")
    assert f"not in the file: {FORMATS[name].drops}" in remarks
    whole = b"".join(files(tmp_path).values())
    assert b"CC BY 4.0" in whole
    assert b"ab" * 32 in whole
    assert "Ö".encode() in whole or rb"\xd6" in whole


@pytest.mark.parametrize("name", WITHOUT_GAPS)
def test_a_missing_pose_is_refused_and_no_file_left(name: str, tmp_path: Path) -> None:
    motion = moving_fingers(5)
    position, turn = motion.position_mm.copy(), motion.quaternion.copy()
    position[2, 3, 1] = np.nan
    turn[4, 0, 0] = np.nan
    for bad in (
        replace(motion, position_mm=position),
        replace(motion, quaternion=turn),
        motion.take(slice(0, 0)),
    ):
        with pytest.raises(InputError, match="holds no frame without a pose and no file without a frame"):
            write(bad, name, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ON_TIME)
@pytest.mark.parametrize(
    ("times", "message"),
    [
        (np.full(5, np.nan), "has no device time, and .* needs it; give its rate_hz"),
        ([0.0, 0.1, 0.2, np.nan, 0.3], "has no device time"),
        ([0.0, 0.1, 0.2, 0.2, 0.3], "does not grow from frame 9 to the next"),
        ([0.0, 0.1, 0.2, 0.15, 0.3], "does not grow from frame 9 to the next"),
    ],
)
def test_times_must_be_known_and_grow(name: str, times: list[float], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        write(timed(moving_fingers(5), time_s=np.array(times)), name, tmp_path)
    assert not list(tmp_path.iterdir())
