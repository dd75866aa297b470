"""Properties of all formats, and preparing a motion for one by the export settings."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from moving_fingers import moving_fingers, timed

from shukotsu.errors import InputError
from shukotsu.export import registry
from shukotsu.export.exported_motion import local_motion
from shukotsu.export.registry import DIRECTIONS, FORMATS, ExportSettings, prepare, upright, write_format
from shukotsu.hand.posing import Origin, PosedRecording
from shukotsu.hand.rotations import angle, conjugate, matrix, multiply, rotate
from shukotsu.study import config_files
from shukotsu.tables.poses import RecordingName

WITHOUT_GAPS = [name for name, form in FORMATS.items() if not form.holds_gaps]
ON_TIME = ("glb", "osim")


def path_of(name: str, folder: Path) -> Path:
    return folder / (FORMATS[name].shared or f"a{FORMATS[name].extensions[0]}")


def write(motion: PosedRecording, name: str, folder: Path) -> None:
    FORMATS[name].writers.write(motion, path_of(name, folder))


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


def test_no_format_overwrites_files_of_another() -> None:
    """All files of a recording have the same stem."""
    endings = [ending for form in FORMATS.values() for ending in form.extensions]
    assert len(endings) == len({*endings})


def test_formats_with_long_names_are_described_in_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    formats = config_files.export_constants()["formats"]
    formats = formats | {"animation": formats["csv"]}
    monkeypatch.setattr(config_files, "export_constants", lambda: {"formats": formats})
    lines = runpy.run_path(registry.__file__)["DESCRIPTION"].splitlines()[-len(formats) :]
    assert {line.index(form["what"]) for line, form in zip(lines, formats.values(), strict=True)} == {13}


@pytest.mark.parametrize("name", FORMATS)
def test_the_same_motion_gives_the_same_files(name: str, tmp_path: Path) -> None:
    motion = moving_fingers(10, slip_mm=0.5)
    position_mm, turn = motion.position_mm.copy(), motion.quaternion.copy()
    for folder in ("a", "b"):
        write_format(motion, ExportSettings(), name, path_of(name, tmp_path / folder))
    assert files(tmp_path / "a")
    assert files(tmp_path / "a") == files(tmp_path / "b")
    np.testing.assert_array_equal(motion.position_mm, position_mm)
    np.testing.assert_array_equal(motion.quaternion, turn)


@pytest.mark.parametrize("name", FORMATS)
def test_provenance_is_in_the_file_or_beside_it(name: str, tmp_path: Path) -> None:
    """It has the subject's name in its script, the licence and the tables' hashes."""
    motion = moving_fingers(5)
    origin = Origin(RecordingName("Ö", "right", "wave"), licence="CC BY 4.0", inputs={"a.parquet": "ab" * 32})
    motion = replace(motion, origin=origin)
    remarks = write_format(motion, ExportSettings(fps=50), name, path_of(name, tmp_path))
    assert remarks[0].startswith("resampled from 5 frames")
    assert f"not in the file: {FORMATS[name].drops}" in remarks
    whole = b"".join(files(tmp_path).values())
    assert b"CC BY 4.0" in whole
    assert b"ab" * 32 in whole
    assert "Ö".encode() in whole or rb"\xd6" in whole


@pytest.mark.parametrize("name", WITHOUT_GAPS)
def test_a_missing_pose_is_refused_without_a_file(name: str, tmp_path: Path) -> None:
    motion = moving_fingers(5)
    position, turn = motion.position_mm.copy(), motion.quaternion.copy()
    position[2, 3, 1] = np.nan
    turn[4, 0, 0] = np.nan
    for bad in (
        replace(motion, position_mm=position),
        replace(motion, quaternion=turn),
        motion.take(slice(0, 0)),
    ):
        with pytest.raises(InputError, match="needs at least one frame, and a pose in every frame"):
            write(bad, name, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ON_TIME)
@pytest.mark.parametrize(
    ("times", "message"),
    [
        (np.full(5, np.nan), "has no device time, and .* needs it; give its rate_hz"),
        ([0.0, 0.1, 0.2, np.nan, 0.3], "has no device time"),
        ([0.0, 0.1, 0.2, 0.2, 0.3], "does not increase from frame 9 to the next"),
        ([0.0, 0.1, 0.2, 0.15, 0.3], "does not increase from frame 9 to the next"),
    ],
)
def test_times_must_increase(name: str, times: list[float], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        write(timed(moving_fingers(5), time_s=np.array(times)), name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_jump_of_the_clock_is_bridged_only_on_request() -> None:
    """Frame numbers are consecutive but time jumps by 0.3 s, in which the motion is unknown."""
    motion = moving_fingers(40)
    time_s = motion.time_s.copy()
    time_s[20:] += 0.3
    jumped = timed(motion, time_s=time_s)
    with pytest.raises(InputError, match=r"nothing was recorded about 0\.2\d\d s \(frame 26\)"):
        prepare(jumped, ExportSettings(fps=30), holds_gaps=False, up="y")
    assert not prepare(jumped, ExportSettings(fps=30), holds_gaps=True, up="").whole.all()
    wide = ExportSettings(fps=30, gaps="interpolate", max_gap_s=0.5)
    assert prepare(jumped, wide, holds_gaps=False, up="y").whole.all()


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("transmitter_up", DIRECTIONS)
def test_the_up_axis_is_mapped_by_a_proper_rotation(transmitter_up: str, up: str) -> None:
    turn, axes = upright(transmitter_up, up), dict(zip(DIRECTIONS, [*np.eye(3), *-np.eye(3)], strict=True))
    np.testing.assert_allclose(rotate(turn, axes[transmitter_up]), axes[up], atol=1e-12)
    assert np.linalg.det(matrix(turn)) == pytest.approx(1)
    np.testing.assert_allclose(np.abs(matrix(turn)).max(0), 1, atol=1e-12)


def test_a_changed_up_axis_does_not_change_the_posture() -> None:
    motion = moving_fingers(20, slip_mm=1.0)
    there = prepare(motion, ExportSettings(), holds_gaps=True, up="y")
    (before_mm, before), (after_mm, after) = local_motion(motion), local_motion(there)
    np.testing.assert_allclose(before_mm[:, 1:], after_mm[:, 1:], atol=1e-9)
    assert angle(multiply(conjugate(before), after))[:, 1:].max() < 1e-7
    np.testing.assert_allclose(there.position_mm[..., 1], motion.position_mm[..., 2], atol=1e-9)
    np.testing.assert_allclose(there.receivers.position_mm[..., 1], motion.receivers.position_mm[..., 2])
