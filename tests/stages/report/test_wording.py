"""The report in another language: its catalogue is whole, what it says, and what stays English."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from finding_examples import examples
from matplotlib import font_manager
from report_samples.made_movement import write_movement
from report_samples.many_subjects import many_subjects
from report_samples.rendered import whole_report

from schemas.advice import ADVICE, ENOUGH, MOVE, advice_text
from schemas.config_files import json_schema
from schemas.errors import InputError
from schemas.finding_groups import row_sentence, row_what
from schemas.finding_sentences import templates as templates_of_findings
from schemas.findings import KINDS, NOTE, Finding, same_file, unchecked
from schemas.study import Hand, Study, read_study
from stages.report import subject, templates, wording
from stages.report.movement_page.movement_page import render_movement
from stages.report.movement_page.movement_results import read_movement
from stages.report.print_figures import style
from stages.report.recording_page.recording_content import recording_page
from stages.report.recording_results import read_recording
from stages.report.study_page import render_failure, render_study
from stages.report.study_results import StudyResults, read_results
from stages.report.templates import texts_of
from stages.report.wording import END, FOREIGN, Catalogue, catalogue_of, full_name, say, speaking, told, word

REPOSITORY = Path(__file__).resolve().parents[3]
REPORT = REPOSITORY / "stages" / "report"
OTHERS = [language for language in json_schema("study")["properties"]["language"]["enum"] if language != "en"]

GRAMMAR = {"verb", "are"}
"""Placeholders of English grammar, which another language may leave out."""
MESSAGE_MAKERS = (
    "stages/solve_joints/anatomical.py",
    "stages/solve_joints/solve.py",
    "stages/project_planes/place.py",
    "stages/fit_hand/posterior_summary.py",
    "stages/fit_hand/hand_tables.py",
    "stages/estimate_metacarpals/wrist_row.py",
    "stages/evaluate_tips/tip_tables.py",
    "stages/compare_movement/level_differences.py",
)
"""Where the sentences are made that come with the tables."""
NOT_MESSAGES = ("fit, corrected by hand", "fit of the whole hand")


@pytest.fixture(params=OTHERS)
def catalogue(request: pytest.FixtureRequest) -> Catalogue:
    """Every language's catalogue."""
    return catalogue_of(request.param)


def _said() -> set[str]:
    """Every sentence of the report's code, and of findings."""
    trees = (ast.parse(path.read_text("utf-8")) for path in REPORT.rglob("*.py"))
    return {*templates_of_findings(), *(kind.meaning for kind in KINDS.values())} | {
        str(node.args[0].value)
        for tree in trees
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in ("say", "mark")
        and node.args
        and isinstance(node.args[0], ast.Constant)
    }


def _counted() -> set[str]:
    """Every thing that the report's code counts."""
    trees = (ast.parse(path.read_text("utf-8")) for path in REPORT.rglob("*.py"))
    calls = (node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Call))
    named = (call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "counted")
    return {str(call.args[1].value) for call in named if isinstance(call.args[1], ast.Constant)}


def _in_templates() -> set[str]:
    """Every text of the templates that says something: no file's name, no number, no value."""
    texts = {text for path in REPORT.rglob("*.j2") for text in texts_of(path.read_text("utf-8"))}
    values = re.compile(r"\{\{[^\"]*?\}\}")
    return {
        text
        for text in texts
        if re.search(r"[A-Za-z]{2}", values.sub("", text))
        and not re.search(r"\.(css|js|html\.j2)$|^xyz$|^en$|auto-phrase|(figure_of|by-joint)", text)
    }


def _places(text: str) -> set[str]:
    return set(re.findall(r"\{(\w*)(?::[^}]*)?\}", text))


def test_every_sentence_has_a_translation_and_every_translation_a_sentence(catalogue: Catalogue) -> None:
    said = _said()
    assert sorted(said - set(catalogue.sentences)) == []
    assert sorted(set(catalogue.sentences) - said) == []


def test_everything_counted_has_a_translation(catalogue: Catalogue) -> None:
    wanted = {f"{{count}} {thing}" for thing in _counted()}
    assert sorted(wanted ^ set(catalogue.counts)) == ["{count} receiver"]  # named by an argument


def test_every_text_of_the_templates_has_a_translation(catalogue: Catalogue) -> None:
    texts = _in_templates()
    assert sorted(texts - set(catalogue.pages)) == []
    assert sorted(set(catalogue.pages) - texts - {"{{ " + "x }}"}) == []


def test_every_translated_string_of_a_script_is_in_one(catalogue: Catalogue) -> None:
    source = "".join(path.read_text("utf-8") for path in REPORT.rglob("*.js"))
    lost = [text for text in catalogue.scripts if f'"{text}"' not in source and f"`{text}`" not in source]
    assert lost == []


def test_a_translated_string_of_a_script_is_as_whole_as_it_was(catalogue: Catalogue) -> None:
    """The same expressions, and nothing that would end the string."""
    inside = re.compile(r"\$\{[^}]*\}")
    for english, own in catalogue.scripts.items():
        assert sorted(inside.findall(own)) == sorted(inside.findall(english)), english
        assert not re.search(r'["`\\\n]', own), english


def test_a_translated_text_of_a_template_ends_no_attribute(catalogue: Catalogue) -> None:
    for english, own in catalogue.pages.items():
        assert own.count('"') == english.count('"'), english
        assert not re.search(r"[<>]", own), english


def test_a_script_says_nothing_else_in_words(catalogue: Catalogue) -> None:
    source = "".join(path.read_text("utf-8") for path in REPORT.rglob("*.js"))
    strings = set(re.findall(r'"([a-zA-Z][a-z]+(?: [a-zA-Z]+)+[^"\n]*)"', source))
    own = {text for text in strings if text not in catalogue.scripts}
    assert own == {"use strict"}


def test_a_translation_has_the_placeholders_of_its_sentence(catalogue: Catalogue) -> None:
    for kind in (catalogue.sentences, catalogue.counts):
        for english, own in kind.items():
            assert _places(own) <= _places(english), english
            assert _places(english) - _places(own) <= GRAMMAR, english


def _expressions(text: str) -> list[str]:
    """What a template's text puts in: names in its expressions, texts and functions of the language aside."""
    inside = " ".join(re.findall(r"\{\{(.*?)\}\}", text))
    return sorted(set(re.findall(r"[a-z_][a-z_.]*", re.sub(r"\"[^\"]*\"", "", inside))) - {"say", "told"})


def test_a_translated_text_of_a_template_keeps_its_expressions(catalogue: Catalogue) -> None:
    for english, own in catalogue.pages.items():
        assert _expressions(own) == _expressions(english), english


def test_a_pattern_puts_in_what_it_finds(catalogue: Catalogue) -> None:
    for pattern, own in catalogue.messages:
        assert _places(own) <= set(pattern.groupindex), pattern.pattern


def _fragments(path: Path) -> Iterator[str]:
    """Literal pieces of sentences in a module, docstrings aside."""
    tree = ast.parse(path.read_text("utf-8"))
    documented = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(text, str) and id(node) not in documented and re.search(r"[a-z]+ [a-z]+ [a-z]+", text):
            yield text.strip(" .,:;(){}`")


@pytest.mark.parametrize("path", MESSAGE_MAKERS)
def test_every_sentence_that_comes_with_the_tables_has_a_pattern(path: str, catalogue: Catalogue) -> None:
    known = " ".join(re.sub(r"\\(.)", r"\1", pattern.pattern) for pattern, _ in catalogue.messages).lower()
    lacking = [text for text in _fragments(REPOSITORY / path) if text.lower() not in known]
    with speaking(catalogue.language):
        assert [text for text in lacking if text not in NOT_MESSAGES and FOREIGN in told(text)] == []


def _texts_of_the_project() -> str:
    """Every text of the code and of the models that ship, spaces as one."""
    paths = [
        path
        for room in ("stages", "checks", "schemas", "skeleton")
        for path in (REPOSITORY / room).rglob("*.py")
    ]
    trees = (ast.parse(path.read_text("utf-8")) for path in paths)
    constants = (node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    models = (path.read_text("utf-8") for path in (REPOSITORY / "config" / "models").glob("*.yaml"))
    return " ".join([*(text for text in constants if isinstance(text, str)), *models]).lower()


def test_every_pattern_is_of_a_sentence_that_the_project_makes(catalogue: Catalogue) -> None:
    made = _texts_of_the_project()
    for pattern, _ in catalogue.messages:
        pieces = re.split(r"\(\?P[<=][^)]*\)", re.sub(r"\\(.)", r"\1", pattern.pattern))
        words = max((piece.strip(" .,:;()`{}").lower() for piece in pieces), key=len).split()
        runs = [" ".join(words[place : place + 3]) for place in range(max(1, len(words) - 2))]
        assert any(run.strip(",.;:") in made for run in runs), pattern.pattern


STANDS = same_file("right", "rom").columns
"""A finding that advice quotes."""

ADVICE_VALUES = {
    "wanted_deg": 30.0,
    "gap_mm": 8.71,
    "sd_mm": 353.6,
    "enough_mm": 3.4,
    "parent": "hand",
    "child": "index_proximal",
    "finding": row_what(STANDS),
}
EXAMPLES = (
    *(advice_text("index_mcp", kind, ADVICE_VALUES) for kind in ADVICE if kind != ENOUGH),
    advice_text("elbow", MOVE, ADVICE_VALUES),
    "the axis lies in the plane that should cut it",
    "the point that keeps its distance from 4 MCP joints",
    "no receiver on ring_middle or ring_distal: no worn receiver carries the centre; what is known is in "
    "bone_lengths and bone_poses",
)


@pytest.mark.parametrize("message", EXAMPLES)
def test_sentences_that_come_with_the_tables_are_told_whole(message: str) -> None:
    with speaking("ja", [STANDS]):
        said = told(message)
    assert FOREIGN not in said
    assert re.search("[ぁ-ん]", said)
    assert not re.search(r"[a-z]+ [a-z]+ [a-z]+", re.sub("`[^`]*`", "", said))


def test_numbers_and_joints_of_a_message_are_kept() -> None:
    with speaking("ja"):
        said = told("ring_distal and hand have 1 valid frames in common; expected 2 or more")
    assert said.startswith("環指末節骨と")
    assert "フレームは 1 である" in said


def test_a_sentence_without_a_pattern_stays_english_and_says_so() -> None:
    with speaking("ja"):
        page = wording.typeset(f'<p title="{told("Rain fell")}">{told("Rain fell & wet")}</p>')
    assert page == '<p title="Rain fell"><span lang="en">Rain fell & wet</span></p>'


def test_a_joint_is_named_with_its_abbreviation() -> None:
    assert (word("index_mcp"), full_name("index_mcp")) == ("index_mcp", "index_mcp")
    with speaking("ja"):
        assert (word("index_mcp"), word("wrist"), word("whole-hand")) == ("示指 MCP", "手関節", "whole-hand")
        assert full_name("index_mcp") == "示指 MCP (中手指節関節)"


def test_a_hand_is_named_in_a_sentence() -> None:
    with speaking("ja"):
        assert say("{hand}", hand=Hand("01", "right")) == "被験者 01 の右手"
    assert say("{hand}", hand=Hand("01", "right")) == "subject 01, right hand"


def test_english_comes_back_after_another_language(results: StudyResults, study: Study, page: str) -> None:
    with speaking("ja"):
        assert whole_report(results, study) != page
    assert whole_report(results, study) == page


class _Said(HTMLParser):
    """Texts of a page that are not marked as English, nor its configuration and references."""

    def __init__(self) -> None:
        super().__init__()
        self.stack: list[tuple[str, str | None]] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        own = dict(attrs)
        self.texts += [own[name] or "" for name in ("aria-label", "title", "placeholder") if own.get(name)]
        if tag not in ("meta", "link", "input", "br", "path"):
            self.stack.append((tag, own.get("lang")))

    def handle_endtag(self, tag: str) -> None:
        while self.stack and self.stack.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        tags = {tag for tag, _ in self.stack}
        in_english = any(own == "en" for tag, own in self.stack if tag != "html")
        if not in_english and not tags & {"script", "style", "pre", "ol"}:
            self.texts.append(data)


NAMES = ("Modeling of Hand Skeletal Structure", "no such file", "axis is 4 deg from the plane")
"""A paper's title, and what refusals say of files: these stay English."""


def _english_left(page: str) -> list[str]:
    reader = _Said()
    reader.feed(page)
    sentence = re.compile(r"\b[a-z]+ [a-z]+ [a-z]+ [a-z]+\b")
    return [
        text for text in reader.texts if sentence.search(text) and not any(name in text for name in NAMES)
    ]


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> tuple[StudyResults, Study]:
    """A study of nine subjects in two groups and two sessions, with all that is compared."""
    file, folder = many_subjects(tmp_path_factory.mktemp("many"), 9)
    study = read_study(file)
    write_movement(folder, study.subjects)
    return read_results(study, folder), study


def test_nothing_of_a_japanese_report_is_left_in_english(
    results: StudyResults,
    study: Study,
    fitted: StudyResults,
    fitted_made: tuple[Path, Path],
    many: tuple[StudyResults, Study],
) -> None:
    fitted_study = read_study(fitted_made[0])
    with speaking("ja"):
        pages = [whole_report(results, study), whole_report(fitted, fitted_study)]
        pages += [render_movement(own, read_movement(own)) for own in (results, fitted, many[0])]
        pages.append(render_study(*many, read_movement(many[0])))
        pages += [recording_page(read_recording(fitted, recording)) for recording in fitted.shown]
    assert [text for page in pages for text in _english_left(page)] == []
    assert all('<html lang="ja">' in page for page in pages)
    assert not any(mark in page for page in pages for mark in (FOREIGN, END))


def test_a_language_is_a_catalogue_and_a_value_of_the_key() -> None:
    assert sorted(OTHERS) == sorted(path.stem for path in wording.CATALOGUES.glob("*.yaml"))


def test_templates_of_another_language_are_the_same_but_for_what_they_say(catalogue: Catalogue) -> None:
    for path in REPORT.rglob("*.j2"):
        source = path.read_text("utf-8")
        own = templates.in_language(path.name, source, catalogue)
        assert re.findall(r"<[a-z]+|\{% *[a-z]+", own) == re.findall(r"<[a-z]+|\{% *[a-z]+", source)


def test_where_no_font_writes_the_language_one_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(font_manager.fontManager, "ttflist", [])
    monkeypatch.setattr(font_manager, "findSystemFonts", list)
    style._seek_fonts.cache_clear()
    with pytest.raises(InputError, match=r"language: ja: its figures need a font.*fonts-ipaexfont-gothic"):
        style.check_font("ja")
    style.check_font("en")
    style._seek_fonts.cache_clear()


def test_a_page_in_an_unknown_language_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "plan.json").write_text("{}")
    argv = ["--plan", str(tmp_path / "plan.json"), "--out", str(tmp_path / "pages"), "--language", "xx"]
    assert subject.main(argv) == 2
    assert "xx" in capsys.readouterr().err


def test_a_failure_is_told_in_the_language_of_the_study() -> None:
    with speaking("ja"):
        page = render_failure("no calibration recording")
    assert "レポートを作成できなかった: キャリブレーション記録がない" in page


MOVED = "it moved 4.2 mm and turned 3 deg on its bone"
SAID_BY_STAGES = (
    unchecked("internal error in stages.check_recordings (KeyError: 1); please report it with the log"),
    *(
        Finding(kind, NOTE, "", {"segment": "hand", "message": message})
        for kind, message in (
            ("receiver-loose", f"came loose in rom at 12.3 s: {MOVED}; 8 % of its frames were left out"),
            (
                "receiver-slid",
                f"slid in rom between 3.0 s and 21.0 s: {MOVED}; all of its frames were used, as no joint "
                "centre is the worse for it",
            ),
        )
    ),
)
"""Findings that hold a sentence, as the stages make it."""
FINDINGS = [
    *(own for own in examples() if own.kind not in {stage.kind for stage in SAID_BY_STAGES}),
    *SAID_BY_STAGES,
]


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda own: f"{own.kind}-{own.variant}")
def test_a_finding_is_said_whole_in_another_language(finding: Finding) -> None:
    with speaking("ja"):
        said = row_sentence(finding.columns, say)
    assert FOREIGN not in said
    assert not re.search(r"\{\w*\}|。。|\.。", said.replace("`", ""))
    assert re.search("[ぁ-ん]", said)
    assert not re.search(r"[a-z]+ [a-z]+ [a-z]+", re.sub("`[^`]*`", "", said))
    numbers = [f"{value:.0f}" for value in finding.values.values() if isinstance(value, float) and value > 20]
    assert all(number in said for number in numbers)


def test_a_finding_that_a_message_quotes_is_said_by_its_values() -> None:
    finding = Finding("wrong-hand", NOTE, "", {"hand": "right", "hand_2": "left"}, "seen on video")
    message = f"no valid pose in the calibration; {finding.message}"
    with speaking("ja"):
        assert FOREIGN in told(message)
    with speaking("ja", [finding.columns]):
        text = told(f"no calibration recording is left: {message}")
        advice = told("nothing can be said before this is settled: This seems to be a right hand")
    assert FOREIGN not in text
    assert "右手と考えられる" in text
    assert "seen on video" in text
    assert advice == "これが解決するまで何も判定できない: 右手と考えられる"


def test_what_is_to_be_written_into_a_file_stays_as_files_have_it() -> None:
    with speaking("ja"):
        text = row_sentence(Finding("wrong-hand", NOTE, "", {"hand": "right", "hand_2": "left"}).columns, say)
    assert "右手" in text
    assert "`right`" in text
    assert "--hand right" in text
