"""The command line of the simulation, and its files."""

from pathlib import Path

import numpy as np
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from stage_runs import simulate as main

from shukotsu.tables.catalogue import BONE_LENGTHS, BONE_TIP, JOINT_CENTRES, METACARPALS, TIPS
from shukotsu.tables.typed_table import read_metadata, read_table, rows_of

COLUMNS = ["frame", "time_s", "segment", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]


def words(out: Path, *more: str, task: str = "opposition") -> list[str]:
    name = ["--subject", "01", "--hand", "left", "--task", task, "--seed", "7"]
    return [*name, "--frames", "120", "--out", str(out), *more]


def test_both_formats_have_the_same_numbers(plain: Path, tmp_path: Path) -> None:
    assert main(words(tmp_path / "a.csv")) == 0
    parquet, csv = pq.read_table(plain), pyarrow.csv.read_csv(tmp_path / "a.csv")
    assert parquet.column_names == csv.column_names == COLUMNS
    assert parquet.num_rows == 120 * 16
    assert parquet.column("segment").to_pylist() == csv.column("segment").to_pylist()
    for name in set(COLUMNS) - {"segment"}:
        np.testing.assert_array_equal(parquet.column(name).to_numpy(), csv.column(name).to_numpy())
    assert parquet.column("frame")[0].as_py() == 1
    assert parquet.column("time_s")[0].as_py() == pytest.approx(1 / 240)


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    for folder in ("first", "second"):
        assert main(words(tmp_path / folder / "a.parquet", "--forearm")) == 0
    for path in sorted((tmp_path / "first").rglob("*.parquet")):
        twin = tmp_path / "second" / path.relative_to(tmp_path / "first")
        assert path.read_bytes() == twin.read_bytes()
    assert not list(tmp_path.rglob("*.tmp"))


def test_truth_tables_match_their_schemas(tmp_path: Path) -> None:
    assert main(words(tmp_path / "a.csv", "--realism", "exact", "--forearm", task="rom")) == 0
    truth = tmp_path / "a_truth"
    joints = {
        row["joint"]: row for row in rows_of(read_table(truth / "joint_centres.parquet", JOINT_CENTRES))
    }
    assert len(joints) == 16
    assert {row["model"] for row in joints.values()} == {"truth"}
    assert joints["wrist"]["parent_segment"] == "forearm"
    assert joints["index_mcp"]["parent_segment"] == "hand"
    assert all(abs(row["child_y_mm"]) < 1e-9 for row in joints.values())
    bones = {row["bone"]: row for row in rows_of(read_table(truth / "bone_lengths.parquet", BONE_LENGTHS))}
    assert len(bones) == 19
    assert bones["index_distal"]["ends_at"] == BONE_TIP
    assert bones["index_metacarpal"]["ends_at"] == "index_mcp"
    assert read_table(truth / "metacarpals.parquet", METACARPALS).num_rows == 5 * 120
    tips = read_table(truth / "tips.parquet", TIPS)
    assert tips.num_rows == 5 * 120
    assert 3 < tips.column("error_mm").to_numpy().mean() < 20


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("plain") / "plain.parquet"
    assert main(words(out)) == 0
    return out


@pytest.mark.parametrize(
    "option", [("--anatomy", "xray"), ("--mounts", "2"), ("--artefact", "0"), ("--faults", "3")]
)
def test_options_change_the_recording_and_are_recorded_in_the_truth(
    plain: Path, tmp_path: Path, option: tuple[str, str]
) -> None:
    other = tmp_path / "other.parquet"
    assert main(words(other, *option)) == 0
    assert not pq.read_table(plain).equals(pq.read_table(other))
    name, value = option[0].removeprefix("--"), option[1]
    parameters = read_metadata(other.with_name("other_truth") / "tips.parquet")["parameters"]
    assert str(parameters[name]).removesuffix(".0") == value
    assert name not in read_metadata(plain.with_name("plain_truth") / "tips.parquet")["parameters"]


@pytest.mark.parametrize(
    ("out", "more", "sentence"),
    [
        ("a.txt", (), "expected .parquet or .csv"),
        ("a.csv", ("--frames", "1"), "expected 2 or more"),
        ("file/a.csv", (), "cannot be written"),
    ],
)
def test_bad_arguments_are_refused_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], out: str, more: tuple[str, ...], sentence: str
) -> None:
    (tmp_path / "file").write_text("in the way")
    assert main(words(tmp_path / out, *more)) == 2
    message = capsys.readouterr().err
    assert sentence in message
    assert message.count("\n") == 1
