"""Names of recordings as laboratories give them: what is read of each, and what is left to a person."""

from pathlib import Path

import pytest

from shukotsu.commands.recording_names import parts_of_names

EMPTY = {"subject": "", "session": "", "hand": "", "task": "", "trial": "", "role": ""}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("P01_L_calib.csv", "subject=P01 hand=left task=calib role=calibration"),
        ("sub-03_right_rom.c3d", "subject=03 hand=right task=rom role=calibration"),
        ("03-left-grip-2.csv", "subject=03 hand=left task=grip trial=2 role=both"),
        (
            "sub-01_ses-b_hand-right_task-rom.parquet",
            "subject=01 session=b hand=right task=rom role=calibration",
        ),
        ("P01/left/calib_01.csv", "subject=P01 hand=left task=calib trial=01 role=calibration"),
        ("P01L_scales.csv", "subject=P01 hand=left task=scales role=both"),
        ("2024-05-03_P01_L_calib.csv", "subject=P01 hand=left task=calib role=calibration"),
        (
            "20240503_142233_VP12_li_Kalibrierung.csv",
            "subject=VP12 hand=left task=Kalibrierung role=calibration",
        ),
        ("VP 4 LH tapping fast 3.csv", "subject=VP4 hand=left task=tapping-fast trial=3 role=both"),
        ("Subject 3 re rom2.csv", "subject=3 hand=right task=rom2 role=calibration"),
        ("Anna_grip2_re.csv", "subject=Anna hand=right task=grip2 role=both"),
        ("calib_P07_R.csv", "subject=P07 hand=right task=calib role=calibration"),
        ("day 1/rom.csv", "session=1 task=rom role=calibration"),
        ("romantic.csv", "task=romantic role=both"),
        ("hand-left.csv", "hand=left"),
        ("2024-05-03.csv", ""),
    ],
)
def test_what_a_name_says(name: str, said: str) -> None:
    (parts,) = parts_of_names([Path(name)])
    assert vars(parts) == EMPTY | dict(word.split("=") for word in said.split())


def test_a_task_is_evaluated_by_the_calibration_of_the_same_hand_and_session() -> None:
    names = ["P1_L_rom.csv", "P1_L_grip.csv", "P1_R_grip.csv", "P1_ses-2_L_grip.csv"]
    roles = [parts.role for parts in parts_of_names(map(Path, names))]
    assert roles == ["calibration", "evaluation", "both", "both"]
