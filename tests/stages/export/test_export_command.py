"""The command line: files with their names, notes beside them, and one sentence where it cannot be done."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand, make_hand
from export_samples.minimal_bvh import read_bvh
from export_samples.minimal_glb import read_glb

from schemas.catalogue import BONE_POSES
from stages.export.__main__ import main
from stages.export.formats import FORMATS

STEM = f"sub-01_hand-right_task-opposition_model-{FITTED}"


def run(known: KnownHand, out: Path, *words: str, model: str = FITTED) -> int:
    who = ["--subject", known.recording.hand.subject, "--hand", known.recording.hand.hand]
    where = ["--study", str(known.study), "--results", str(known.paths.folder), "--out", str(out)]
    return main([*who, *where, "--recording", "opposition", "--model", model, "--formats", "bvh,csv", *words])


def test_files_have_their_names_and_notes(
    right: KnownHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(right, tmp_path, "--licence", "CC BY 4.0") == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {f"{STEM}{end}" for end in (".bvh", ".bvh.txt", ".csv", "_angles.csv", ".json")}
    told = capsys.readouterr()
    assert told.out.splitlines() == [str(tmp_path / f"{STEM}.bvh"), str(tmp_path / f"{STEM}.csv")]
    assert "bvh: not in the file: device times" in told.err
    note = (tmp_path / f"{STEM}.bvh.txt").read_text("utf-8")
    assert "licence: CC BY 4.0\n" in note
    assert f"models/{FITTED}/sub-01/right/bone_poses.parquet\n" in note
    assert str(tmp_path) not in note


def test_the_same_input_gives_the_same_bytes(right: KnownHand, tmp_path: Path) -> None:
    for out in ("a", "b"):
        assert run(right, tmp_path / out) == 0
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_both_formats_have_the_same_joints_in_their_own_worlds(right: KnownHand, tmp_path: Path) -> None:
    """CSV is in the transmitter's frame and mm; BVH has y up and cm: x, z, -y."""
    assert run(right, tmp_path, "--fps", "60", "--frames", "20:200") == 0
    bvh, rows = read_bvh(tmp_path / f"{STEM}.bvh"), pd.read_csv(tmp_path / f"{STEM}.csv")
    assert bvh.frame_time_s == pytest.approx(1 / 60)
    mcp = rows[rows["joint"] == "index_mcp"]
    expected = mcp[["x_mm", "z_mm", "y_mm"]].to_numpy() * [0.1, 0.1, -0.1]
    assert len(expected) == 46
    np.testing.assert_allclose(bvh.series("index_mcp"), expected, atol=1e-6)


def test_options_reach_the_files(
    right: KnownHand, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--unit", "m", "--up", "z", "--transmitter-up=-z", "--rig", "mixamo", "--bones", "stiff"]
    assert run(right, tmp_path, *words) == 0
    bvh, rows = read_bvh(tmp_path / f"{STEM}.bvh"), pd.read_csv(tmp_path / f"{STEM}.csv")
    wrist = rows[rows["joint"] == "mixamorig:RightHand"][["x_mm", "y_mm", "z_mm"]].to_numpy()
    np.testing.assert_allclose(bvh.series("mixamorig:RightHand"), wrist * [1e-3, -1e-3, -1e-3], atol=1e-8)
    assert "mixamorig:RightHandIndex1" in [node.name for node in bvh.nodes]
    assert [len(node.channels) for node in bvh.nodes if node.name] == [6] + [3] * 15
    assert "folded into the bones after them" in capsys.readouterr().err


def test_a_gap_is_refused_by_one_format_and_kept_by_the_other(tmp_path: Path) -> None:
    known = make_hand(tmp_path, "right", 60)
    rows = known.rows(FITTED, BONE_POSES)
    for row in rows:
        if row["segment"] == "index_middle" and 10 <= row["frame"] < 14:
            row |= dict.fromkeys(("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"))
    known.write(FITTED, BONE_POSES, rows)
    out = tmp_path / "out"
    assert run(known, out) == 2
    assert not list(out.glob("*.bvh*"))
    cells = pd.read_csv(out / f"{STEM}.csv")
    assert cells["x_mm"].isna().sum() == 4
    assert run(known, out, "--gaps", "interpolate") == 0
    assert not pd.read_csv(out / f"{STEM}.csv")["x_mm"].isna().any()
    assert len(read_bvh(out / f"{STEM}.bvh").numbers) == 60
    assert "1 gaps (4 frames" in (out / f"{STEM}.bvh.txt").read_text("utf-8")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--formats", "bvh,fbx"], "'fbx' is no format; expected one or more of"),
        (["--subject", "99"], "has no right hand of '99'; it has 01 right"),
        (["--recording", "rom"], "'rom' is not one recording of that hand; expected one of opposition"),
        (["--model", "rigid"], "has no model 'rigid'"),
        (["--frames", "5000:"], "no frame of the recording is in 5000:"),
        (["--rig", "maya"], "there is no rig 'maya'"),
        (["--rate-hz", "100"], "has device times of its own"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_sentence(
    right: KnownHand, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert run(right, tmp_path / "out", *words) == 2
    told = capsys.readouterr().err.splitlines()
    assert said in told[-1]
    assert told[-1].startswith("error: ")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("words", [["--frames", "7"], ["--fps", "0"], ["--max-gap-s", "nan"], ["--fps", "x"]])
def test_words_that_are_no_numbers_are_refused(right: KnownHand, tmp_path: Path, words: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        run(right, tmp_path, *words)
    assert ended.value.code == 2


def test_a_failure_can_be_recorded(right: KnownHand, tmp_path: Path) -> None:
    assert run(right, tmp_path, "--frames", "5000:", "--record-failure") == 0
    for name in ("bvh", "csv"):
        assert "no frame of the recording" in (tmp_path / f"{STEM}_{name}.failed.txt").read_text("utf-8")
    assert run(right, tmp_path, "--record-failure", model="none") == 0
    assert "has no model 'none'" in next(tmp_path.glob("*model-none.failed.txt")).read_text("utf-8")


def test_both_hands_stand_in_one_glb(tmp_path: Path) -> None:
    """Each with its own skeleton and animation; a format for one hand says so and writes nothing."""
    known = make_hand(tmp_path, "right", 30)
    make_hand(tmp_path, "left", 30)
    sheet = (tmp_path / "sheet.tsv").read_text("utf-8")
    (tmp_path / "sheet.tsv").write_text(
        sheet + sheet.splitlines()[1].replace("left", "right") + "\n", "utf-8"
    )
    out = tmp_path / "out"
    assert run(known, out, "--formats", "glb", "--hand", "both") == 0
    scene = read_glb(out / f"{STEM.replace('right', 'both')}.glb").json
    assert len(scene["skins"]) == len(scene["animations"]) == 2
    assert {"right-hand", "left-hand"} <= {node.get("name") for node in scene["nodes"]}
    assert run(known, out, "--hand", "both") == 2
    assert not list(out.glob("*.bvh"))


def test_a_subject_of_any_script_has_its_files(tmp_path: Path) -> None:
    known = make_hand(tmp_path, "left", 30, subject="山田 太郎")
    assert run(known, tmp_path / "out", model=REPLAYED) == 0
    assert (tmp_path / "out" / f"sub-山田%20太郎_hand-left_task-opposition_model-{REPLAYED}.bvh").is_file()


def test_help_tells_every_format_and_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom stages.export.__main__ import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numpy', 'pyarrow', 'scipy', 'ezc3d') if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(f"  {name} " in done.stdout for name in FORMATS)
