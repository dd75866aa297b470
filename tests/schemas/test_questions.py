"""Questions of a study file: what is left out is filled in, and what cannot be asked is refused by name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.schemas.factors import factor_levels
from shukotsu.schemas.study import read_study

ROWS = [(s, ses, "right", tempo) for s in "ABCD" for ses, tempo in (("pre", 60), ("post", 90))]
ROWS += [("A", "pre", "left", 120), ("A", "late", "right", 75)]
SHEET = "\n".join(
    ["subject\tsession\thand\ttask\trole\tfile\ttempo"]
    + [f"{s}\t{ses}\t{hand}\tscale\tboth\t{s}{ses}{hand}.csv\t{tempo}" for s, ses, hand, tempo in ROWS]
)
PEOPLE = "subject\tgroup\tyears\thand_length_mm\nA\tx\t3\t170\nB\tx\t5\t180\nC\ty\t9\t190\nD\ty\t\t\n"
RANGE = "quantity: range_deg, joint: index_pip, angle: flexion"
BETWEEN = f"name: a, {RANGE}, factor: group, hand: right"


def study(folder: Path, *questions: str, factors: str = "tempo") -> Path:
    (folder / "recordings.tsv").write_text(SHEET)
    (folder / "people.tsv").write_text(PEOPLE)
    asked = "".join(f"  - {{{question}}}\n" for question in questions)
    (folder / "study.yaml").write_text(
        "study: s\nrecordings: recordings.tsv\nparticipants: people.tsv\nlayout: liberty16\n"
        f"models: [rigid]\nfactors: [{factors}]\nquestions:\n{asked}"
    )
    return folder / "study.yaml"


def test_what_is_left_out_is_filled_in(tmp_path: Path) -> None:
    """Columns of questions are levels without being factors, and add nothing to a subject's plan."""
    crossed = (
        f"name: b, {RANGE}, factor: group, crossed_with: session, crossed_levels: [post, pre], hand: right"
    )
    distance = "name: c, quantity: contact_percent, digit: index, other_digit: thumb, hand: right"
    distance += ", covariate: hand_length_mm"
    slope = f"name: d, {RANGE}, covariate: tempo, hand: right"
    read = read_study(study(tmp_path, BETWEEN, crossed, distance, slope, factors=""))
    one, two, three, four = read.questions
    assert (one.levels, one.task, one.hand, one.whose) == (("x", "y"), "scale", "right", "index_pip flexion")
    assert (two.crossed_levels, two.factors) == (("post", "pre"), ("group", "session"))
    assert (three.whose, three.levels, four.factor) == ("thumb-index", (), "tempo")
    assert read.factors == ()
    assert factor_levels(read)[0] == {
        "subject": "A", "session": "pre", "hand": "right", "task": "scale", "trial": "",
        "group": "x", "hand_length_mm": "170.0", "tempo": "60",
    }  # fmt: skip
    other = study(tmp_path, BETWEEN.replace("name: a", "name: z") + ", levels: [y, x]")
    assert read_study(other).questions[0].digest == one.digest
    assert len({own.digest for own in read.questions}) == 4


@pytest.mark.parametrize(
    ("questions", "message"),
    [
        ([f"name: a, {RANGE}, hand: right"], "'a': expected one of factor and covariate"),
        ([BETWEEN.replace("group", "gruop")], "'a': factor: 'gruop' is no column of .*did you mean 'group'"),
        ([BETWEEN + ", levels: [x, z]"], "'a': levels: 'z' is no level of group here; expected one of x, y"),
        ([BETWEEN.replace("index_pip", "index_pop")], "joint: 'index_pop' is no joint of the study; did"),
        ([BETWEEN.replace("range_deg", "range")], "'range' is not measured; did you mean 'range_deg'"),
        ([BETWEEN.replace("joint: index_pip", "digit: index")], "range_deg: expected the keys joint and"),
        ([BETWEEN.replace("quantity: range_deg", "curve: key")], "the study has no event 'key'"),
        ([BETWEEN.replace(", hand: right", "")], "hand: the study has right, left; say which one is meant"),
        ([BETWEEN + ", task: chord"], "task: no evaluated recording is of 'chord'; expected one of scale"),
        ([BETWEEN + ", crossed_with: group"], "crossed_with: 'group' is the factor itself"),
        ([BETWEEN + ", design: within"], "design: within, but no subject has both levels of group"),
        ([BETWEEN + ", model: rigit"], "model: 'rigit' is no model of the study; did you mean 'rigid'"),
        ([BETWEEN.replace("factor: group", "covariate: group")], "group has 'x'; expected numbers"),
        ([BETWEEN.replace("factor: group", "factor: tempo, levels: [60, 70]")], "'70' is no level of"),
        ([BETWEEN.replace("factor: group", "factor: hand")], "hand: is what the question compares"),
        ([BETWEEN, BETWEEN], "two questions have that name"),
        ([BETWEEN, BETWEEN.replace("name: a", "name: b")], "'b': asks what 'a' asks; leave one out"),
        (["name: a, qantity: range_deg"], "questions.0: unknown key 'qantity'"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_refused(tmp_path: Path, questions: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_study(study(tmp_path, *questions))


def test_the_guides_questions_can_be_asked(tmp_path: Path) -> None:
    """Each block of the guide that has questions is a part of a study file as it stands."""
    guide = (Path(__file__).resolve().parents[2] / "docs" / "studies.md").read_text("utf-8")
    (block,) = [text for text in re.findall(r"```yaml\n(.*?)```", guide, re.DOTALL) if "questions:" in text]
    rows = [
        f"{s}\t{session}\tright\tscale\tboth\t{s}{session}.csv" for s in "ABC" for session in ("pre", "post")
    ]
    (tmp_path / "recordings.tsv").write_text("\n".join(["subject\tsession\thand\ttask\trole\tfile", *rows]))
    people = "subject\tgroup\tyears\nA\texpert\t9\nB\tnovice\t1\nC\tnovice\t2\n"
    (tmp_path / "participants.tsv").write_text(people)
    head = "study: s\nrecordings: recordings.tsv\nlayout: liberty16\nmodels: [whole-hand]\n"
    (tmp_path / "study.yaml").write_text(head + block)
    assert [own.levels for own in read_study(tmp_path / "study.yaml").questions] == [
        ("expert", "novice"),
        ("novice", "expert"),
        (),
    ]
