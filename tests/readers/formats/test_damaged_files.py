"""Damaged files of every format are either read or refused in one sentence, by import and inspect."""

import contextlib
import io
import json
from contextlib import closing
from pathlib import Path

import pytest
from damaged_bytes import assert_read_or_refused, damaged
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_files import LIBERTY
from sample_files import RECORDINGS

from shukotsu.commands.inspect_file import build_parser, inspect
from shukotsu.readers.import_recording import read_parts
from shukotsu.readers.poses_table import poses_table
from shukotsu.study.mapping import read_mapping

PARENTS = {joint.child: joint.parent_receiver for joint in LIBERTY.solvable}


def read_poses(path: Path) -> int:
    """Read a recording as import does, up to the rows of the poses table; return its number of frames."""
    mapping_path = path.with_name("mapping.yaml")
    mapping = read_mapping(mapping_path) if mapping_path.exists() else None
    parts = read_parts(path, LIBERTY, mapping)
    with closing(poses_table(parts, PARENTS, path.parent)) as poses:
        list(poses.row_groups())
        return len(poses.frame)


C3D = pytest.param("c3d", marks=pytest.mark.slow)  # a damaged count may require much memory


@pytest.fixture(scope="module")
def recording(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An undamaged recording, with its mapping beside it if it needs one."""
    sample, folder = RECORDINGS[request.param](), tmp_path_factory.mktemp("damaged")
    (folder / sample.path).write_bytes(sample.content)
    if sample.mapping:
        (folder / "mapping.yaml").write_text(json.dumps(sample.mapping))
    assert read_poses(folder / sample.path) > 0
    return folder / sample.path


@pytest.mark.parametrize("recording", [C3D, *(name for name in RECORDINGS if name != "c3d")], indirect=True)
@settings(max_examples=12)
@given(data=st.data())
def test_a_damaged_recording_is_read_or_refused(recording: Path, data: st.DataObject) -> None:
    sound = recording.read_bytes()
    try:
        recording.unlink()  # a new file, as its modification time may be the same
        recording.write_bytes(data.draw(damaged(sound)))
        assert_read_or_refused(lambda: read_poses(recording))
        with contextlib.redirect_stdout(io.StringIO()):
            assert_read_or_refused(lambda: inspect(build_parser().parse_args([str(recording)])))
    finally:
        recording.write_bytes(sound)
