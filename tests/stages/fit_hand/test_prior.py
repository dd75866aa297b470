"""The hand that anatomy expects: nothing moves it but its measured length."""

from pathlib import Path

import numpy as np
import pytest
from planned_subject import planned_subject

from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.parts import Part, part_metadata
from stages.fit_hand.hand_tables import PRIOR
from stages.fit_hand.prior import fit_prior, main

LAYOUT = read_layout("liberty16")


def test_the_prior_moves_nothing(tmp_path: Path) -> None:
    """Bones are those of an average hand or of one as long as measured; nothing is stated of errors."""
    subject = planned_subject(tmp_path, [("right", "rom", "both")], ["rigid"], n_frames=250)
    folder, part = subject.plan_file.parent, Part("right", "prior-only", subject="01")
    assert main([f"--plan={subject.plan_file}", f"--out={folder}"]) == 0
    rows = {name: subject.rows(folder / f"{name}.parquet", table.name, part) for name, table in PRIOR.items()}
    assert {row["status"] for row in rows["prior_joints"]} == {"ok"}
    assert {row["joint"] for row in rows["prior_joints"]} == set(LAYOUT.joints)
    assert {row["sd_mm"] for row in (*rows["prior_joints"], *rows["prior_bones"])} == {None}
    lengths = {row["bone"]: row["length_mm"] for row in rows["prior_bones"]}
    longer = fit_prior([subject.poses("rom")], LAYOUT, "right", 210.0)
    average = fit_prior([subject.poses("rom")], LAYOUT, "right", 189.0)
    ratio = [bone.length_mm / average.bones[name].length_mm for name, bone in longer.bones.items()]
    assert np.ptp(ratio) < 1e-9
    assert ratio[0] == pytest.approx(210 / 189)
    assert lengths["index_middle"] == pytest.approx(24.9)
    tips = rows["prior_posed_tips"]
    assert len(tips) == 5 * 63
    for digit in LAYOUT.digits:
        error, left_out = (
            np.mean([row[name] for row in tips if row["digit"] == digit])
            for name in ("error_mm", "error_left_out_mm")
        )
        assert 0 < error < left_out < 20, digit
    assert len(rows["prior_bone_poses"]) == 20 * 63


def test_a_prior_that_cannot_be_had_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A hand without calibration has a failed part; an arm, of which no anatomy is known, has none."""
    with pytest.raises(InputError, match="no calibration recording: none is given"):
        fit_prior([], LAYOUT, "right")
    options = ["--layout=liberty16", "--subject=01", "--hand=right", f"--out={tmp_path}"]
    assert main(options) == 2
    assert "no calibration recording: none is given" in capsys.readouterr().err
    assert main([*options, "--record-failure"]) == 0
    for name, table in PRIOR.items():
        (parameters,) = part_metadata(tmp_path / f"{name}.parquet", table).values()
        assert parameters["failure"] == "no calibration recording: none is given"
    assert main([*options, "--layout=arm"]) == 0
    assert part_metadata(tmp_path / "prior_joints.parquet", PRIOR["prior_joints"]) == {}
