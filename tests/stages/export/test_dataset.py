"""All evaluated recordings of several subjects in one dataset; what cannot be written is listed beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from export_samples.known_hands import FITTED, REPLAYED, KnownHand, make_hand

from schemas.catalogue import BONE_POSES
from stages.export.dataset import main


@pytest.fixture(scope="module")
def subjects(tmp_path_factory: pytest.TempPathFactory) -> list[KnownHand]:
    """Two subjects, of which the second's hand was not fitted."""
    folder = tmp_path_factory.mktemp("dataset")
    hands = []
    for subject in ("01", "02"):
        (folder / subject).mkdir()
        hands.append(make_hand(folder / subject, "right", 20, subject))
    hands[1].write(FITTED, BONE_POSES, "the hand was not fitted")
    return hands


def argv(subjects: list[KnownHand], out: Path) -> list[str]:
    return ["--plans", *(str(known.plan_path) for known in subjects), "--out", str(out)]


def test_every_subject_and_model(subjects: list[KnownHand], tmp_path: Path) -> None:
    """Receivers once, a skeleton for every model; participants with the columns of the sheet."""
    sheet = tmp_path / "participants.tsv"
    sheet.write_text("subject\thand_length_mm\n01\t180\n03\t190\n", "utf-8")
    out = tmp_path / "bids"
    options = ["--model", REPLAYED, "--participants", str(sheet), "--licence", "CC0"]
    assert main([*argv(subjects, out), *options]) == 0
    names = {path.name for path in out.rglob("*_motion.tsv")}
    assert names == {
        f"sub-{subject}_task-opposition_tracksys-righthand{skeleton}_motion.tsv"
        for subject in ("01", "02")
        for skeleton in ("", "skeletonpaperQdfig4")
    }
    table = (out / "participants.tsv").read_text("utf-8").splitlines()
    assert [line.split("\t")[0] for line in table] == ["participant_id", "sub-01", "sub-02"]
    assert table[1].split("\t")[2].startswith("180")
    assert '"License": "CC0"' in (out / "dataset_description.json").read_text("utf-8")


def test_a_recording_that_cannot_be_written_is_told_once_the_others_are(
    subjects: list[KnownHand], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bids"
    assert main(argv(subjects, out)) == 2
    sentence = f"{FITTED}, sub-02/right/opposition: the hand was not fitted"
    assert capsys.readouterr().err.endswith(f"error: {sentence}\n")
    assert len(list(out.rglob("*_motion.tsv"))) == 5
    assert main([*argv(subjects, out), "--record-failure"]) == 0
    assert (tmp_path / "bids.failed.txt").read_text("utf-8") == f"{sentence}\n"


def test_bad_input_is_refused_or_recorded(
    subjects: list[KnownHand], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bids"
    assert main([*argv(subjects, out), "--model", "none"]) == 2
    assert "has no model 'none'" in capsys.readouterr().err
    assert not out.exists()
    assert main([*argv(subjects, out), "--model", "none", "--record-failure"]) == 0
    assert "has no model 'none'" in (tmp_path / "bids.failed.txt").read_text("utf-8")
    assert out.is_dir()
