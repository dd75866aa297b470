"""Factors: levels of a study's recordings, from either sheet; what is none is refused."""

from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.schemas.study import factor_levels, read_study

SHEET = """subject\tsession\thand\ttask\trole\tfile\tcondition
01\t1\tright\tscale\tboth\ta.csv\tslow
01\t2\tright\tscale\tboth\tb.csv\tfast
02\t1\tright\tscale\tevaluation\tc.csv\tn/a
02\t1\tright\trom\tcalibration\td.csv
"""
PARTICIPANTS = "subject\thand_length_mm\tgroup\n01\t180\texpert\n"


def write(folder: Path, factors: str, participants: str = PARTICIPANTS) -> Path:
    (folder / "recordings.tsv").write_text(SHEET)
    (folder / "participants.tsv").write_text(participants)
    (folder / "study.yaml").write_text(
        "study: s\nrecordings: recordings.tsv\nparticipants: participants.tsv\nlayout: liberty16\n"
        f"models: [rigid]\nfactors: [{factors}]\n"
    )
    return folder / "study.yaml"


def test_levels_of_either_sheet_and_of_the_recordings_own_columns(tmp_path: Path) -> None:
    """A participant without a row, an empty cell and n/a have no level; what only calibrates has no row."""
    study = read_study(write(tmp_path, "group, condition, session"))
    names = ("subject", "session", "hand", "task", "trial", "group", "condition")
    assert [tuple(row[name] for name in names) for row in factor_levels(study)] == [
        ("01", "1", "right", "scale", "", "expert", "slow"),
        ("01", "2", "right", "scale", "", "expert", "fast"),
        ("02", "1", "right", "scale", "", "", ""),
    ]


@pytest.mark.parametrize(
    ("factors", "participants", "message"),
    [
        ("condition, gruop", PARTICIPANTS, "'gruop' is no column of the sheets.*did you mean 'group'?"),
        ("condition, role", PARTICIPANTS, "'role' tells no levels apart; expected one of session, hand"),
        ("condition", PARTICIPANTS.replace("group", "condition"), "'condition' is a column of both sheets"),
    ],
)
def test_what_is_no_factor_is_refused(tmp_path: Path, factors: str, participants: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_study(write(tmp_path, factors, participants))
