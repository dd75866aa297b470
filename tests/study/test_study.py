"""Studies: paths, roles, sessions, events, factors and contradictions between rows of the sheets."""

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from small_study import write_study

from shukotsu.errors import InputError
from shukotsu.study.config_files import CONFIG_FOLDER
from shukotsu.study.layout import read_layout
from shukotsu.study.plan_file import StudyPlans, recordings_part
from shukotsu.study.sheets import CORRECTIONS, read_sheet
from shukotsu.study.study import Study, correction_problems, factor_levels, read_study
from shukotsu.tables.subjects import Hand, path_token


def study(tmp_path: Path, *rows: str, more: str = "") -> Study:
    return read_study(write_study(tmp_path, *rows, more=more))


def test_relative_paths_start_at_the_study_file(tmp_path: Path) -> None:
    """Recordings are relative to it too, although the sheet names them; shipped layouts and models are found
    by name.
    """
    read = study(
        tmp_path,
        "01 right rom both data/rom.csv",
        more="simulation: {folder: made, seed: 1}\nexports: [bvh]\n",
    )
    (recording,) = read.recordings
    assert recording.source.file == tmp_path / "data" / "rom.csv"
    assert recording.source.file_as_written == "data/rom.csv"
    assert read.sheets == {"recordings": tmp_path / "sheets" / "recordings.tsv"}
    assert read.layout == recording.source.layout == CONFIG_FOLDER / "layouts" / "liberty16.yaml"
    assert list(read.models) == ["rigid", "paper-fig4"]
    assert read.exports == ("bvh",)
    assert read.simulation is not None
    assert read.simulation.folder == tmp_path / "made"


def test_a_study_may_use_its_own_layouts_and_models(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("model: mine\ndescription: My own.\n")
    (tmp_path / "wing.yaml").write_bytes((CONFIG_FOLDER / "layouts" / "arm.yaml").read_bytes())
    read = read_study(write_study(tmp_path, "01 right rom both r.csv - wing.yaml", models=["mine.yaml"]))
    assert read.models == {"mine": tmp_path / "mine.yaml"}
    assert read.layout_of(Hand("01", "right")) == tmp_path / "wing.yaml"


def test_the_studys_mapping_applies_to_rows_that_may_need_one(tmp_path: Path) -> None:
    """It does not apply to rows that name a mapping or a format, nor to files of self-describing formats."""
    cells = ("a a.csv", "b b.c3d own.yaml", "c c.csv - csv", "d d.arrows", "e E.PARQUET")
    rows, header = (f"01 right both {row}" for row in cells), "subject hand role task file mapping format"
    read = read_study(write_study(tmp_path, *rows, header=header, more="mapping: lab.yaml\n"))
    mappings = [recording.source.mapping for recording in read.recordings]
    assert mappings == [tmp_path / "lab.yaml", tmp_path / "own.yaml", None, None, None]


@given(st.text(), st.text())
@example("a.b", "a%2Eb")
@example("é", "e\u0301")
@example("a/b", "a_b")
def test_different_names_never_share_a_path(first: str, second: str) -> None:
    assert (path_token(first) == path_token(second)) == (first == second)


@given(st.text())
def test_any_name_becomes_one_safe_part_of_a_path(name: str) -> None:
    token = path_token(name)
    assert all(letter.isalnum() or letter in "-_%" for letter in token)
    assert path_token(token.replace("%", "")) == token.replace("%", "")


@pytest.mark.parametrize(
    ("rows", "more", "message"),
    [
        ((), "", "recordings.tsv: has no recording; add a row for each"),
        (("01 right a both a.csv", "01 right A both b.csv"), "",
         "row 3: its results would have the path of row 2; rename"),
        (("01 right a_b both a.csv", "01 right a both b.csv b"), "",
         "row 3: its results would have the path of row 2"),
        (("01 right a both a.csv", "01 right b both b.csv - arm"), "",
         "row 3, column layout: arm has other bodies, joints or digits than liberty16"),
        (("01 right a both a.csv - arn",), "", "layout 'arn' is neither .*did you mean 'arm'"),
        (("01 right a both a.csv",), "participants: no.tsv\n", "no.tsv: no such file; expected the sheet of"),
        (("01 right a both a.csv",), "exports: [bvh]\nexport_settings: {models: [whole-hand]}\n",
         r"export_settings.models: 'whole-hand' is not a model of the study; expec"),
        (("01 right a both a.csv",), "particpants: no.tsv\n", "unknown key 'particpants'.*'participants'"),
    ],
)  # fmt: skip
def test_contradictions_are_refused(tmp_path: Path, rows: tuple[str, ...], more: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        study(tmp_path, *rows, more=more)


def test_each_correction_that_cannot_be_applied_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "corrections.tsv"
    joints = "right thumb_ip", "left thumb_ip", "right thumb_pi", "right xyz", "right index_cmc"
    rows = [f"01 {joint} 1 2 3".replace(" ", "\t") for joint in joints]
    path.write_text("\n".join(["subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm", *rows]))
    layout = read_layout("liberty16")
    problems = correction_problems(read_sheet(path, CORRECTIONS), path, [Hand("01", "right")], layout)
    rows_named = [problem.split(", column ")[0] for problem in problems]
    assert rows_named == [f"corrections.tsv: row {row}" for row in (3, 4, 5, 6)]
    assert "column subject: the study has no left hand of '01'" in problems[0]
    assert "'thumb_pi' is not a joint of layout liberty16; did you mean 'thumb_ip'?" in problems[1]
    assert "expected one of wrist, thumb_cmc, " in problems[2]
    assert "'index_cmc' is not a joint of layout" in problems[3]
    assert all(problem.endswith("the row was not applied") for problem in problems)


def study_of_sessions(folder: Path, *rows: str, **sheets: str) -> Study:
    header = "subject session hand task role file trial events pulses"
    return read_study(write_study(folder, *rows, header=header, **sheets))


def test_sessions_are_kept_apart(tmp_path: Path) -> None:
    read = study_of_sessions(
        tmp_path,
        "01 1 right rom both a.csv",
        "01 2/b right rom both b.csv - b.mid sync",
        "01 - left rom both c.csv",
    )
    assert read.subjects == ("01",)
    assert [who.token for who in read.sessions] == ["01_ses-1", "01_ses-2%2Fb", "01"]
    folders = ["sub-01_ses-1/right", "sub-01_ses-2%2Fb/right", "sub-01/left"]
    assert [hand.folder for hand in read.hands] == folders
    assert str(read.hands[1]) == "subject 01, session 2/b, right hand"
    (recording,) = read.of_session("01", "2/b").recordings
    assert (recording.source.file_as_written, recording.pulses) == ("b.csv", "sync")
    assert recording.events == tmp_path / "b.mid"
    with pytest.raises(InputError, match="has no subject '01, session 3'; expected one of 01, session 1, "):
        read.of_session("01", "3")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("01 right scale 1", "row 2: 01, right, scale names several recordings; state which in the"),
        ("01 left scale 1", "row 2: 01, left, scale names no recording of the recordings sheet"),
        ("01 right scale x", "row 2, column onset_s: is 'x'; expected a number"),
    ],
)
def test_a_row_of_events_must_name_a_single_recording(tmp_path: Path, row: str, message: str) -> None:
    recordings = ("01 1 right scale both a.csv", "01 2 right scale both b.csv", "01 2 right rom both c.csv")
    with pytest.raises(InputError, match=message):
        study_of_sessions(tmp_path, *recordings, events=f"subject hand task onset_s\n{row}\n")
    events = "subject hand session task onset_s name\n01 right 2 scale 1.5 key\n01 right - rom 2 key\n"
    read = study_of_sessions(tmp_path, *recordings, events=events.replace("-", ""))
    plans = StudyPlans(read, tmp_path / "results")
    for session, tasks in (("1", {"rom"}), ("2", {"scale", "rom"})):
        part = recordings_part(plans.content("01", session))
        assert {row["task"] for row in part["events"]} == tasks


def study_of_factors(tmp_path: Path, factors: str, participants: str = "group") -> Study:
    rows = "01 1 right scale both a slow", "01 2 right scale both b fast", "02 1 right scale evaluation c n/a"
    header, people = "subject session hand task role file condition", f"subject {participants}\n01 expert\n"
    more = f"factors: [{factors}]\n"
    return read_study(write_study(tmp_path, *rows, header=header, more=more, participants=people))


def test_factor_levels_come_from_either_sheet(tmp_path: Path) -> None:
    """A participant without a row, an empty cell and n/a have no level; calibration recordings have no
    row.
    """
    names = ("subject", "session", "hand", "task", "trial", "group", "condition")
    rows = factor_levels(study_of_factors(tmp_path, "group, condition, session"))
    assert [tuple(row[name] for name in names) for row in rows] == [
        ("01", "1", "right", "scale", "", "expert", "slow"),
        ("01", "2", "right", "scale", "", "expert", "fast"),
        ("02", "1", "right", "scale", "", "", ""),
    ]


@pytest.mark.parametrize(
    ("factors", "column", "message"),
    [
        ("condition, gruop", "group", "'gruop' is not a column of the sheets.*did you mean 'group'?"),
        ("condition, role", "group", "'role' cannot be a factor; expected one of session, hand"),
        ("condition", "condition", "'condition' is a column of both sheets"),
    ],
)
def test_a_wrong_factor_is_refused(tmp_path: Path, factors: str, column: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        study_of_factors(tmp_path, factors, column)
