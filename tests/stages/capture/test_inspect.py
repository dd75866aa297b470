"""`python -m stages.capture inspect`: what it says of each kind of file; its drafts lead to an import."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml

from kinematics.rotations import matrix, unit
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.mapping import read_mapping
from stages.capture.__main__ import main
from stages.capture.formats.readers import find_reader
from stages.capture.samples import ReadingOptions, Samples

REPOSITORY = Path(__file__).resolve().parents[3]
ARM = read_layout("arm")
RNG = np.random.default_rng(12)
FRAMES = 40
TURNED = unit(np.array([1.0, 0.2, -0.1, 0.3]) + RNG.normal(scale=0.05, size=(FRAMES, 4)))
PLACE = RNG.normal(scale=0.2, size=(FRAMES, 3))

GUIDE_FILE = """# lab export
Time;H_x;H_y;H_z;H_az;H_el;H_ro;F_x;F_y;F_z;F_az;F_el;F_ro
0;10,1;2,2;3,1;10;20;30;11,1;3,2;4,1;20;21;31
4,2;10,2;2,3;3,2;11;20;30;11,2;3,3;4,2;20;22;31
8,3;10,4;2,4;3,3;12;20;30;11,4;3,4;4,3;20;24;31
"""


def inspect(capsys: pytest.CaptureFixture[str], path: Path, *words: str, code: int = 0) -> str:
    """What the command prints, to stdout or on bad input to stderr."""
    assert main(["inspect", str(path), "--layout", "arm", *words]) == code
    out = capsys.readouterr()
    return out.err if code else out.out


def filled(tmp_path: Path, answers: dict[str, str]) -> Path:
    """The drafted mapping with the first place of each key set right; names go by their CHECK name."""
    path = tmp_path / "mapping.yaml"
    with pytest.raises(InputError, match=r"still says? CHECK: put the truth there"):
        read_mapping(path)
    text = path.read_text("utf-8")
    for key, value in answers.items():
        pattern = (
            rf"(?m)^(\s*){key}:( CHECK)?( *#.*)?"
            if key.startswith("CHECK")
            else rf"(?m)^(\s*{key}:) CHECK.*$"
        )
        replacement = rf"\g<1>{value}:" if key.startswith("CHECK") else rf"\g<1> {value}"
        text, count = re.subn(pattern, replacement, text, count=1)
        assert count == 1, (key, text)
    path.write_text(text, "utf-8")
    return path


def imported(path: Path, mapping_path: Path) -> Samples:
    mapping = read_mapping(mapping_path)
    return find_reader(path, "auto", mapping)(path, ARM, ReadingOptions(mapping))


def test_the_guides_page_shows_what_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("session3.csv").write_text(GUIDE_FILE)
    assert main(["inspect", "session3.csv", "--write-mapping", "mapping.yaml"]) == 0
    page = (REPOSITORY / "docs" / "mappings.md").read_text("utf-8")
    assert f"```text\n{capsys.readouterr().out}```" in page


def test_the_guides_mapping_reads_the_file_that_it_is_shown_for(tmp_path: Path) -> None:
    page = (REPOSITORY / "docs" / "mappings.md").read_text("utf-8")
    (tmp_path / "mapping.yaml").write_text(re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)[0])
    (tmp_path / "session3.csv").write_text(GUIDE_FILE)
    samples = imported(tmp_path / "session3.csv", tmp_path / "mapping.yaml")
    hand = samples.segment == samples.segments.index("hand")
    np.testing.assert_allclose(samples.numbers[hand, 0], np.array([10.1, 10.2, 10.4]) * 25.4)


def test_a_wide_table_of_quaternions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "old.txt"
    cells = np.concatenate([np.arange(FRAMES)[:, None] / 120, PLACE, TURNED], 1)
    path.write_text(
        "t\tpx\tpy\tpz\tw\ti\tj\tk\n" + "".join("\t".join(f"{v:.6f}" for v in row) + "\n" for row in cells)
    )
    out = inspect(capsys, path)
    assert "cells separated by tabs, decimal point, a header" in out
    assert "in s 120 Hz" in out
    assert "quaternion w i j k: median norm 1.00000" in out
    assert "so wxyz is likelier" in out
    assert re.search(r"position px py pz: span .* in mm nothing, .* in m a desk", out)
    assert (
        out.strip()
        .splitlines()[-1]
        .startswith(f"next: python -m stages.capture inspect {path} --write-mapping")
    )
    inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    answers = {
        "position_unit": "m",
        "order": "wxyz",
        "rotates": "receiver-to-transmitter",
        "time_unit": "s",
        "CHECK_1": "hand",
    }
    samples = imported(path, filled(tmp_path, answers))
    np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-3)
    np.testing.assert_allclose(samples.numbers[:, 3:], TURNED, atol=1e-6)
    np.testing.assert_allclose(samples.time_s, np.arange(FRAMES) / 120, atol=1e-6)


def test_a_small_z_before_a_quaternion_is_not_part_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rotation about nearly one axis, positions in metres: z, w, x, y have norm 1 within a thousandth."""
    path = tmp_path / "old.csv"
    half = np.linspace(0.1, 1.2, FRAMES)
    rows = np.stack([half, half, 0.02 * half, np.cos(half), np.sin(half), 0 * half, 0 * half], 1)
    rows[:, 3:] = unit(rows[:, 3:] + RNG.normal(scale=0.005, size=(FRAMES, 4)))
    path.write_text("a,b,c,d,e,f,g\n" + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows))
    out = inspect(capsys, path)
    assert "quaternion d e f g: median norm 1.00000" in out
    assert "position a b c: " in out


@pytest.mark.parametrize("time", ["Zeit", "Uhr", "t"])
def test_columns_are_grouped_by_name_whatever_the_first_is_called(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], time: str
) -> None:
    path = tmp_path / "wide.csv"
    path.write_text(GUIDE_FILE.replace("Time", time))
    out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert f"time column {time}: median step 4.15" in out
    draft = yaml.safe_load((tmp_path / "mapping.yaml").read_text("utf-8"))
    assert list(draft["receivers"].values()) == [
        {"position": [f"{who}_{axis}" for axis in "xyz"], "orientation": [f"{who}_{a}" for a in angles]}
        for who, angles in (("H", ("az", "el", "ro")), ("F", ("az", "el", "ro")))
    ]
    guessed = [line for line in (tmp_path / "mapping.yaml").read_text().splitlines() if "guessed" in line]
    assert [line.split()[0] for line in guessed] == ([] if time == "t" else ["time:"])


def test_a_column_between_named_ones_shifts_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "wide.csv"
    titles = "Nr,A_x_mm,A_y_mm,A_z_mm,odd,A_qw,A_qx,A_qy,A_qz,u,v,w0"
    rows = np.concatenate([PLACE, PLACE[:, :1], 1.2 * TURNED, PLACE + 3], 1)
    lines = [f"{7 - i % 3}," + ",".join(f"{v:.5f}" for v in row) for i, row in enumerate(rows)]
    path.write_text(titles + "\n" + "\n".join(lines) + "\n")
    inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    draft = (tmp_path / "mapping.yaml").read_text()
    whole = 'position: ["A_x_mm", "A_y_mm", "A_z_mm"], orientation: ["A_qw", "A_qx", "A_qy", "A_qz"]}'
    assert f"{whole}\n" in draft
    assert re.search(r'position: \["u", "v", "w0"\].*# CHECK: guessed from the place', draft)


def test_nine_numbers_and_columns_without_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "old.txt"
    cells = np.concatenate([PLACE, matrix(TURNED).reshape(-1, 9)], 1)
    path.write_text("".join("  ".join(f"{v:.6f}" for v in row) + "\n" for row in cells))
    out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "cells separated by blanks, decimal point, no header" in out
    answers = {
        "position_unit": "m",
        "rate_hz": "240",
        "rotates": "receiver-to-transmitter",
        "CHECK_1": "hand",
    }
    samples = imported(path, filled(tmp_path, answers))
    np.testing.assert_allclose(matrix(samples.numbers[:, 3:]), matrix(TURNED), atol=1e-5)
    np.testing.assert_allclose(samples.time_s, np.arange(FRAMES) / 240)


def test_a_long_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "old.csv"
    rows = [
        f"{frame},{sensor},{frame * 8},{frame + 0.5},{sensor},3.25,{frame},{-sensor * frame},{3 * frame},0"
        for frame in range(1, 30)
        for sensor in (1, 2)
    ]
    path.write_text(
        "sample,sensor,timestamp,p1,p2,p3,azimuth,elevation,roll,button\n" + "\n".join(rows) + "\n"
    )
    out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "frame column sample: 1 to 29" in out
    assert "receiver column sensor: one row a receiver and frame; it has 1, 2" in out
    assert "degrees, as 87 is more than two pi" in out
    answers = {
        "position_unit": "cm",
        "axes": "ZYX",
        "rotates": "receiver-to-transmitter",
        "time_unit": "ms",
        "CHECK_1": "hand",
        "CHECK_2": "forearm",
    }
    samples = imported(path, filled(tmp_path, answers))
    hand = samples.segment == samples.segments.index("hand")
    assert hand.sum() == (~hand).sum() == 29
    np.testing.assert_allclose(samples.numbers[hand, 0], (np.arange(1, 30) + 0.5) * 10)


def test_repeats_are_told_and_drafted_as_out_of_step(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "old.csv"
    held = np.arange(FRAMES) // 3
    lines = [
        f"{0.003 * row:.3f}," + ",".join(f"{v:.5f}" for v in (*TURNED[held[row]], *PLACE[held[row]]))
        for row in range(FRAMES)
    ]
    path.write_text("Time,w1,x1,y1,z1,loc1_x,loc1_y,loc1_z\n" + "\n".join(lines) + "\n")
    out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "w1 x1 y1 z1: 67% of the rows repeat the one before (14 new values)" in out
    answers = {
        "position_unit": "m",
        "rate_hz": "111",
        "order": "wxyz",
        "rotates": "receiver-to-transmitter",
        "time_unit": "s",
        "CHECK_1": "hand",
    }
    samples = imported(path, filled(tmp_path, answers))
    np.testing.assert_array_equal(samples.frame, np.arange(14))


def test_matrices_in_a_file_and_in_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "poses"
    folder.mkdir()
    whole = np.tile(np.eye(4), (FRAMES, 1, 1))
    whole[:, :3, :3], whole[:, :3, 3] = matrix(TURNED), PLACE
    texts = ["\n".join(" ".join(f"{v:.8f}" for v in row) for row in one) + "\n" for one in whole]
    for number, text in enumerate(texts):
        (folder / f"{number}.txt").write_text(text)
    (folder / "LICENSE").write_text("free")
    (tmp_path / "all.traj").write_text("\n".join(texts))
    answers = {
        "position_unit": "m",
        "rate_hz": "100",
        "rotates": "receiver-to-transmitter",
        "CHECK": "hand",
    }
    for path in (folder, tmp_path / "all.traj"):
        out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
        assert "40 matrices of 4 x 4" in out
        assert "40 of 40 are rotations within 0.01" in out
        samples = imported(path, filled(tmp_path, answers))
        np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-4)
        (tmp_path / "mapping.yaml").unlink()


def test_a_c3d_file_names_its_rigid_clusters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import ezc3d

    shape = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]])
    rigid = shape @ np.swapaxes(matrix(TURNED), 1, 2) + 1000 * PLACE[:, None]
    loose = RNG.normal(scale=100, size=(FRAMES, 3, 3))
    points = np.concatenate([rigid, loose], 1)
    points[:10, 3] = np.nan
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["Arm1", "Arm2", "Arm3", "Dot1", "Dot2", "Dot3"]
    file["data"]["points"] = np.concatenate([points, np.ones((FRAMES, 6, 1))], -1).transpose(2, 1, 0)
    file.write(str(tmp_path / "a.c3d"))
    out = inspect(capsys, tmp_path / "a.c3d", "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "C3D: 6 points, 40 frames numbered from 1" in out
    assert "rate 50 Hz" in out
    assert "unit mm (POINT:UNITS)" in out
    assert "missing: Dot1 25 %" in out
    assert re.search(r"Arm1, Arm2, Arm3: .*: a rigid cluster", out)
    assert re.search(r"Dot1, Dot2, Dot3: .*: not rigid", out)
    assert re.search(r"Arm1, .*: distances about [\d.]+ mm, varying by \S+ mm: ", out)
    draft = (tmp_path / "mapping.yaml").read_text()
    assert "first_frame" not in draft
    assert "#   last_frame: 40  # frames count from 1 at the first stored frame" in draft
    samples = imported(tmp_path / "a.c3d", filled(tmp_path, {"CHECK_Arm": "upper_arm"}))
    np.testing.assert_allclose(samples.numbers[:, :3], rigid[:, 0], atol=1e-3)
    told = ["--mapping", str(tmp_path / "mapping.yaml"), "--out", str(tmp_path / "poses.parquet")]
    who = ["--layout", "arm", "--subject", "01", "--hand", "right", "--task", "rom"]
    assert main(["import", "--in", str(tmp_path / "a.c3d"), *told, *who]) == 0
    assert "cluster upper_arm: 3 markers" in capsys.readouterr().err


def test_markers_that_are_never_seen_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import ezc3d

    points = np.full((FRAMES, 3, 3), np.nan)
    for marker in range(3):
        points[marker::3, marker] = PLACE[marker::3]
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = ["Dot1", "Dot2", "Dot3"]
    file["data"]["points"] = np.concatenate([points, np.ones((FRAMES, 3, 1))], -1).transpose(2, 1, 0)
    file.write(str(tmp_path / "a.c3d"))
    out = inspect(capsys, tmp_path / "a.c3d")
    assert "markers Dot1, Dot2, Dot3: never seen together" in out
    assert "nan" not in out


def test_a_c3d_file_of_rotations(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["data"]["points"] = np.ones((4, 0, FRAMES))
    whole = np.tile(np.eye(4)[:, :, None, None], (1, 1, 1, 2 * FRAMES))
    whole[:3, :3, 0, ::2], whole[:3, 3, 0, ::2] = np.moveaxis(matrix(TURNED), 0, -1), PLACE.T
    file.add_parameter("ROTATION", "LABELS", ["hand 1"])
    file["data"]["rotations"] = whole
    file.write(str(tmp_path / "a.c3d"))
    out = inspect(capsys, tmp_path / "a.c3d", "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "ROTATION labels: hand 1, 2 a frame" in out
    assert "no unit is stated" in out
    samples = imported(tmp_path / "a.c3d", filled(tmp_path, {"position_unit": "m", "CHECK_hand_1": "hand"}))
    np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-3)


def test_positions_alone_are_said_to_be_too_little(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "points.csv"
    lines = [",".join(f"{v:.5f}" for v in row) + ",,ok\n" for row in PLACE]
    path.write_text("x,y,z,quality,note\n" + "".join(lines))
    out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "no orientations were found: a joint cannot be found from positions alone" in out
    assert "text: quality, note" in out
    with pytest.raises(InputError, match="CHECK"):
        read_mapping(tmp_path / "mapping.yaml")


def test_parquet_of_other_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = TIDY.strip().replace("segment", "receiver").split(",")
    columns: dict[str, list[float]] = {name: [1, 2] for name in names} | {"qw": [1, 1]}
    columns |= {name: [0, 0] for name in ("qx", "qy", "qz")}
    pq.write_table(pa.table(columns), tmp_path / "tidy.parquet")
    out = inspect(capsys, tmp_path / "tidy.parquet")
    assert "a tidy recording (Parquet): needs no mapping" in out
    assert "receivers: 1, 2" in out
    pq.write_table(pa.table({"a": [1.5]}), tmp_path / "other.parquet")
    err = inspect(capsys, tmp_path / "other.parquet", code=2)
    assert "neither a tidy recording nor a table of this project; it has a (double)" in err


def test_sixteen_columns_that_are_no_matrix_are_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cells = np.concatenate([TURNED, PLACE, np.roll(TURNED, 1, 0), PLACE, np.ones((FRAMES, 2))], 1)
    (tmp_path / "a.txt").write_text("".join(" ".join(f"{v:.6f}" for v in row) + "\n" for row in cells))
    assert "a table as text: 40 rows, 16 columns" in inspect(capsys, tmp_path / "a.txt")


TIDY = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
TIDY_ROWS = "7,0.5,hand,1,2,3,1,0,0,0\n8,0.51,hand,,,,,,,\n8,0.51,elbow,1,2,3,1,0,0,0\n"


def test_own_files_need_no_mapping(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rom.csv"
    path.write_text(TIDY + TIDY_ROWS)
    out = inspect(capsys, path)
    assert "a tidy recording (CSV): needs no mapping" in out
    assert "3 rows, frames 7 to 8, 2 of them" in out
    assert "not measured in layout arm: elbow" in out
    assert "1 of 3 rows lack a number" in out
    assert "next: python -m stages.capture import --in" in out
    target = tmp_path / "mapping.yaml"
    assert "needs no mapping" in inspect(capsys, path, "--write-mapping", str(target), code=2)
    assert not target.exists()
    path.write_text(TIDY + TIDY_ROWS.replace("elbow", "forearm"))
    words = ["--layout", "arm", "--subject", "01", "--hand", "right", "--task", "rom"]
    assert main(["import", "--in", str(path), *words, "--out", str(tmp_path / "poses.parquet")]) == 0
    out = inspect(capsys, tmp_path / "poses.parquet")
    assert "table poses (version 1)" in out
    assert "column x_mm [mm]" in out
    assert "nothing to import" in out


@pytest.mark.parametrize("text", [GUIDE_FILE, GUIDE_FILE.split("\n", 1)[1]], ids=["comments", "semicolons"])
def test_importing_a_foreign_table_without_a_mapping_leads_here(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    path = tmp_path / "old.csv"
    path.write_text(text)
    words = ["--layout", "arm", "--subject", "01", "--hand", "right", "--task", "rom"]
    assert main(["import", "--in", str(path), *words, "--out", str(tmp_path / "poses.parquet")]) == 2
    assert f"`python -m stages.capture inspect {path}`" in capsys.readouterr().err


def test_a_motion_bids_recording_says_itself_what_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stem = "sub-01_task-rom_tracksys-liberty"
    kinds = [("x", "POS", "m"), ("y", "POS", "m"), ("z", "POS", "m")]
    kinds += [(f"quat_{axis}", "ORNT", "n/a") for axis in "xyzw"]
    channels = "".join(f"w_{c}\t{c}\t{kind}\twrist\t{units}\n" for c, kind, units in kinds)
    (tmp_path / f"{stem}_channels.tsv").write_text(f"name\tcomponent\ttype\ttracked_point\tunits\n{channels}")
    (tmp_path / f"{stem}_motion.json").write_text('{"TaskName": "rom", "SamplingFrequency": 240}')
    path = tmp_path / f"{stem}_motion.tsv"
    path.write_text("1\t2\t3\t0\t0\t0\t1\n")
    out = inspect(capsys, path, "--write-mapping", str(tmp_path / "mapping.yaml"))
    assert "tracked point wrist" in out
    assert read_mapping(tmp_path / "mapping.yaml").receivers == {"wrist": {"tracked_point": "wrist"}}
    (tmp_path / f"{stem}_channels.tsv").write_text(
        f"name\tcomponent\ttype\ttracked_point\tunits\n{channels}".replace("\twrist\t", "\thand\t")
    )
    out = inspect(capsys, path)
    assert "every tracked point is a segment of layout arm: needs no mapping" in out
    assert f"next: python -m stages.capture import --in {path} --layout arm" in out
    words = ["--layout", "arm", "--subject", "01", "--hand", "right", "--task", "rom"]
    assert main(["import", "--in", str(path), *words, "--out", str(tmp_path / "poses.parquet")]) == 0


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", "a.csv: is empty"),
        ("a.csv", b"hello\nworld\n", "a.csv: no table of numbers"),
        ("a.csv", b"\x00\xff\xfe", "a.csv: is not UTF-8 text"),
        ("a.c3d", b"hello", "a.c3d: not a readable C3D file"),
        ("a.parquet", b"hello", "a.parquet: not a readable Parquet file"),
        ("a.txt", b"1 0 0 0\n0 1 0 0\n", "a.txt: line 3: the matrix that begins in line 1 has 2 lines"),
        ("a.csv", b"t,x,y,z\n1,2,3,4\n2,3,4,5\n3,4\n", "a.csv: line 4: has 2 cells; expected 4"),
        ("a.xdf", b"hello", "a.xdf: "),
    ],
)
def test_what_cannot_be_read_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    err = inspect(capsys, tmp_path / name, code=2)
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1
    assert "no such file" in inspect(capsys, tmp_path / "nothing", code=2)


def test_an_edited_mapping_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text(GUIDE_FILE)
    target = tmp_path / "mapping.yaml"
    target.write_text("mine\n")
    assert "is there already" in inspect(capsys, tmp_path / "a.csv", "--write-mapping", str(target), code=2)
    assert target.read_text() == "mine\n"


@pytest.mark.parametrize(
    ("file", "facts"),
    [
        (
            "upper_limb_clusters_apache2/racing_full.c3d",
            ["rate 69.9926 Hz", "ForearmR1, ForearmR2, ForearmR3: "],
        ),
        ("pivot_bsd3", ["57 matrices of 4 x 4 in files *.txt", "57 of 57 are rotations"]),
        ("fastrak_wrist_cc0/user1_cup0.traj", ["290 matrices of 4 x 4", "in m a desk"]),
        (
            "upper_limb_poses/racing_right.csv",
            ["a tidy recording", "segments: scapula, upper_arm, forearm, hand"],
        ),
    ],
)
def test_real_files(
    real_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], file: str, facts: list[str]
) -> None:
    out = inspect(capsys, real_data / file)
    for fact in facts:
        assert fact in out
    if "tidy" not in out:
        inspect(capsys, real_data / file, "--write-mapping", str(tmp_path / "mapping.yaml"))
        assert "CHECK" in str(yaml.safe_load((tmp_path / "mapping.yaml").read_text()))


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom stages.capture.__main__ import main\n"
        "try:\n    main(['inspect', '--help'])\nexcept SystemExit:\n    pass\n"
        "sys.exit(str({'numpy', 'pyarrow', 'ezc3d', 'yaml', 'jsonschema'} & set(sys.modules) or ''))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.stderr.strip() == ""
    assert "--write-mapping" in done.stdout
