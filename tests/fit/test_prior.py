"""The reference hand: average anatomy, scaled only by the measured hand length."""

from pathlib import Path

import numpy as np
import pytest
from small_study import planned_subject

from shukotsu.errors import InputError
from shukotsu.fit.calibration import calibrated_hand
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.layout import read_layout
from shukotsu.study.model import read_model
from shukotsu.study.plan import NamedHand, plan_of_poses
from shukotsu.study.results import FIT_TABLES
from shukotsu.study.study import read_study
from shukotsu.tables.catalogue import table_in

LAYOUT = read_layout("liberty16")


def test_the_reference_hand_has_average_bones_and_no_stated_error(tmp_path: Path) -> None:
    """Bones are those of an average hand, scaled if a hand length was measured; sds and gains are empty."""
    subject = planned_subject(tmp_path, [("right", "rom", "both")], ["rigid"], n_frames=250)
    folder, part = subject.fit_folder(model=REFERENCE), subject.part(REFERENCE)
    assert subject.fit("right", model=REFERENCE) == 0
    rows = {name: subject.rows(folder / f"{name}.parquet", table_in(name).name, part) for name in FIT_TABLES}
    assert {row["status"] for row in rows["fitted_joints"]} == {"ok"}
    assert {row["joint"] for row in rows["fitted_joints"]} == set(LAYOUT.joints)
    assert {row["sd_mm"] for row in (*rows["fitted_joints"], *rows["fitted_bones"])} == {None}
    assert [rows[name] for name in ("gains", "joint_angles")] == [[], []]
    lengths = {row["bone"]: row["length_mm"] for row in rows["fitted_bones"]}
    assert lengths["index_middle"] == pytest.approx(24.9)

    def bones_mm(hand_length_mm: float) -> np.ndarray:
        poses, model = [subject.poses("rom")], read_model(REFERENCE)
        sizes = {"hand_length_mm": hand_length_mm}
        plan = plan_of_poses(NamedHand(poses, poses, sizes_mm=sizes), LAYOUT, [model])
        tips = calibrated_hand(plan, plan.part("right", REFERENCE), {}).tips
        return np.array([bone.length_mm for bone in tips.fit.bones.values()])

    np.testing.assert_allclose(bones_mm(210.0) / bones_mm(189.0), 210 / 189)
    tips = rows["posed_tips"]
    assert len(tips) == 5 * 63
    for digit in LAYOUT.digits:
        error, left_out = (
            np.mean([row[name] for row in tips if row["digit"] == digit])
            for name in ("error_mm", "error_left_out_mm")
        )
        assert 0 < error < left_out < 20, digit
    assert len(rows["bone_poses"]) == 20 * 63


def test_a_study_that_names_a_reference_as_its_model_is_refused(tmp_path: Path) -> None:
    subject = planned_subject(tmp_path, [("right", "rom", "both")], ["rigid"], n_frames=20)
    study = subject.folder / "study.yaml"
    text = (subject.folder / "quick.yaml").read_text()
    (subject.folder / "quick.yaml").write_text(text.replace("steps: 10", "steps: 0"))
    study.write_text(study.read_text().replace("[rigid]", "[quick.yaml]").replace("- rigid", "- quick.yaml"))
    with pytest.raises(InputError, match=r"quick.yaml: is a reference, which every study has"):
        read_study(study)
