"""A subject's results, read from the subject's own tables, and its pages."""

from pathlib import Path
from typing import Any

import pytest
from report_samples.made_study import HOSTILE, NO_SOURCE, MadeStudy, make_study
from report_samples.pages import read_page
from stage_runs import subject_pages

from shukotsu.errors import InputError
from shukotsu.report.skeleton_tables import measured_table
from shukotsu.study.plan_file import read_plan
from shukotsu.tables.catalogue import JOINT_CENTRES, RANGES_OF_MOTION
from shukotsu.tables.parts import parts_writer
from shukotsu.tables.typed_table import columns_from_rows


@pytest.fixture
def hostile(tmp_path: Path) -> MadeStudy:
    """A study of one subject, whose name is hostile."""
    return make_study(tmp_path / "made", n_frames=4, models=("whole-hand",), subjects=(HOSTILE,))


@pytest.mark.slow
def test_the_pages_are_written_or_the_reason_is_reported(
    hostile: MadeStudy, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The subject and each recording get a page. Without a plan the command exits with 2 and one sentence, or
    with --record-failure writes a page with it.
    """
    plan = hostile.paths.plan(HOSTILE)
    out, argv = tmp_path / "all", ["--plan", str(plan), "--out"]
    assert subject_pages([*argv, str(out)]) == 0
    written = {p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()}
    assert set(written) == {"subject.html", "right/opposition.html", "left/opposition.html"}
    assert f"Subject {HOSTILE}" in read_page(written["subject.html"].decode("utf-8")).text
    argv = ["--plan", str(tmp_path / "nothing.json"), "--out", str(tmp_path / "out")]
    assert subject_pages(argv) == 2
    assert "nothing.json: no such file" in capsys.readouterr().err
    assert subject_pages([*argv, "--record-failure"]) == 0
    assert "nothing.json: no such file" in (tmp_path / "out" / "subject.html").read_text("utf-8")


def test_a_failed_part_is_listed_as_a_problem_and_the_others_are_shown(hostile: MadeStudy) -> None:
    plan = read_plan(hostile.paths.plan(HOSTILE))
    right, left = plan.part("right", "whole-hand"), plan.part("left", "whole-hand")
    row = hostile.subject(HOSTILE).joints_of[plan.hand("right"), "whole-hand"][0]
    path = plan.table("joint_centres")
    with parts_writer(path, JOINT_CENTRES, NO_SOURCE) as writer:
        writer.columns(right, columns_from_rows(JOINT_CENTRES, [row]))
        writer.failure(left, "no frame was valid")
    results = hostile.subject(HOSTILE)
    (problem,) = [p for p in results.rows.problems if p["message"] == "no frame was valid"]
    names = ("hand", "model", "stage")
    assert [problem[name] for name in names] == ["left", "whole-hand", "estimate_metacarpals"]
    assert results.joints_of == {(plan.hand("right"), "whole-hand"): [row]}
    path.unlink()
    with pytest.raises(InputError, match="joint_centres"):
        hostile.subject(HOSTILE)


def test_a_range_without_numbers_is_shown_with_its_reason() -> None:
    """Messages on rows with numbers, which are in the table of results, are not repeated."""
    empty = dict.fromkeys(column.name for column in RANGES_OF_MOTION.columns)
    weak: Any = empty | {"joint": "ring_mcp", "angle": "flexion", "range_deg": 50.0, "status": "weak"}
    failed: Any = empty | {"joint": "ring_cmc", "angle": "flexion", "status": "failed"}
    rows = [weak | {"message": "no errors are stated"}, failed | {"message": "it is fixed"}]
    (block,) = measured_table("rigid", rows, with_recording=False).blocks
    assert block.header[-1] == "Message"
    assert [(row[0], row[2], row[-1]) for row in block.rows] == [
        ("ring_mcp", "50.0", ""),
        ("ring_cmc", "–", "it is fixed"),
    ]
    assert "Message" not in measured_table("rigid", rows[:1], with_recording=False).blocks[0].header
