"""The report in another language: completeness of the catalogue, its style, and what stays English."""

import re
from functools import cache
from pathlib import Path

import pytest
from babel.messages.catalog import Catalog
from babel.messages.catalog import Message as Translation
from babel.messages.extract import DEFAULT_KEYWORDS, extract_from_dir
from babel.messages.frontend import parse_mapping_cfg
from babel.messages.pofile import read_po
from report_samples.made_study import MadeStudy
from report_samples.pages import read_page

from shukotsu.report import templates
from shukotsu.report.figures import style
from shukotsu.report.recording_page import recording_page
from shukotsu.report.templates import languages, speaking
from shukotsu.translation import END, FOREIGN, punctuated, translated, word

REPOSITORY = Path(__file__).resolve().parents[2]
REPORT = REPOSITORY / "shukotsu" / "report"
OTHERS = languages()[1:]


def _extracted() -> set[str]:
    """Return all messages to translate, as found by `pybabel extract` (docs/studies.md)."""
    with (REPOSITORY / "babel.cfg").open(encoding="utf-8") as stream:
        methods, options = parse_mapping_cfg(stream)
    keywords = DEFAULT_KEYWORDS | {"tr": None, "N_": None, "plural": (1, 2)}
    messages = extract_from_dir(REPOSITORY, methods, options, keywords)
    return {message[0] if isinstance(message, tuple) else message for _, _, message, _, _ in messages}


@cache
def _catalogue(code: str) -> Catalog:
    with (templates.CATALOGUES / f"{code}.po").open(encoding="utf-8") as stream:
        return read_po(stream)


def _texts(message: Translation) -> tuple[list[str], list[str]]:
    """Return the English texts of a message, and its translations."""
    both = (message.id, message.string)
    english, translations = ([*texts] if isinstance(texts, tuple) else [texts] for texts in both)
    return english, translations


def _places(text: str) -> set[str]:
    return {a or b for a, b in re.findall(r"\{(\w*)(?::[^}]*)?\}|%\((\w+)\)s", text)}


@pytest.mark.slow
@pytest.mark.parametrize("code", OTHERS)
def test_catalogue_and_texts_match_one_to_one(code: str) -> None:
    """Translations have the placeholders of their text and no markup."""
    messages = [_texts(message) for message in _catalogue(code) if message.id]
    translated_texts, wanted = {english[0] for english, _ in messages}, _extracted()
    assert (sorted(wanted - translated_texts), sorted(translated_texts - wanted)) == ([], [])
    for english, translations in messages:
        assert all(translations), english
        for translation in translations:
            assert _places(translation) in [_places(text) for text in english], english
            assert not re.search(r"[<>]", translation), english


def test_japanese_uses_the_glossarys_terms_and_one_style() -> None:
    """Report and guide avoid the terms that the glossary excludes; the report has plain forms, full-width
    marks.
    """
    lines = (templates.CATALOGUES / "ja.glossary.tsv").read_text("utf-8").splitlines()
    header, *terms = (line.split("\t") for line in lines)
    assert header == ["english", "japanese", "not"]
    assert len({english for english, *_ in terms}) == len(terms) >= 30
    said = [text for message in _catalogue("ja") if message.id for text in _texts(message)[1]]
    guide = [
        path.read_text("utf-8") for path in [*REPOSITORY.rglob("docs/*.ja.md"), REPOSITORY / "README.ja.md"]
    ]
    everything = "\n".join(said + guide)
    assert [word for _, word, _ in terms if word not in everything] == []
    assert [word for *_, others in terms for word in others.split("、") if word in everything] == []
    report = re.sub(r"`[^`]*`|\{[^{}]*\}|%\(\w+\)s", "", "\n".join(said))
    assert re.findall(r".*(?:です|ます|ません|ください).*", report) == []
    assert re.findall(r".*[ぁ-んァ-ヶ一-龥][(:;].*", report) == []


def test_joints_have_their_anatomical_names_in_japanese() -> None:
    with speaking("ja"):
        names = [word(name) for name in ("thumb_cmc", "index_mcp", "little_distal", "wrist")]
    assert names == ["母指CM関節", "示指MCP関節", "小指末節骨", "手関節"]


def test_scripts_contain_no_untranslated_texts() -> None:
    source = "".join(path.read_text("utf-8") for path in REPORT.rglob("*.js"))
    assert set(re.findall(r'"([a-zA-Z][a-z]+(?: [a-zA-Z]+)+[^"\n]*)"', source)) == {"use strict"}
    assert set(re.findall(r'wording\((?:[\w.]+ \? )?"(\w+)"', source)) <= templates.SCRIPT_TEXTS.keys()


def test_untranslatable_sentences_are_marked_as_english() -> None:
    with speaking("ja"):
        page = templates.typeset(f'<p title="{translated("Rain fell")}">{translated("Rain fell & wet")}</p>')
    assert page == '<p title="Rain fell"><span lang="en">Rain fell & wet</span></p>'


ENGLISH = re.compile(r'<(script|style)\b.*?</\1>|<(\w+)[^>]* lang="en".*?</\2>', re.DOTALL)
"""Scripts, styles and elements that are marked as English."""
NAMES = ("Modeling of Hand Skeletal Structure", "no such file", "axis is 4 deg from the plane")
"""A paper's title and parts of refusals, which stay English."""


def _english_left(page: str) -> list[str]:
    reader = read_page(ENGLISH.sub("", page))
    spoken = [attributes.get(name) for _, attributes in reader.tags for name in ("aria-label", "title")]
    sentence = re.compile(r"\b[a-z]+ [a-z]+ [a-z]+ [a-z]+\b")
    texts = [text for text in (*reader.text, *spoken) if text and sentence.search(text)]
    return [text for text in texts if not any(name in text for name in NAMES)]


@pytest.mark.slow
def test_a_japanese_report_has_no_english_left(fitted_study: MadeStudy) -> None:
    with speaking("ja"):
        pages = [*MadeStudy(fitted_study.file, fitted_study.folder).pages.values()]
        pages.append(recording_page(fitted_study.recording_results()))
    assert [text for page in pages for text in _english_left(page)] == []
    assert all('<html lang="ja">' in page for page in pages)
    assert not any(mark in page for page in pages for mark in (FOREIGN, END))


def test_without_a_font_only_figures_for_print_are_in_english(monkeypatch: pytest.MonkeyPatch) -> None:
    """A note states which font to install; pages stay in the language, since their readers have fonts."""
    monkeypatch.setattr(style, "font_of", lambda _: None)
    assert (style.print_language("ja"), style.print_language("en"), style.font_note("en")) == ("en", "en", "")
    note = style.font_note("ja")
    assert note.startswith("language: ja: none of the fonts ")
    assert "figures for print are in English; install one" in note
    assert "fonts-ipaexfont-gothic" in note
    with speaking("ja"):
        assert style.label("関節\0") == "関節\\x00"


@pytest.mark.slow
def test_punctuation_beside_japanese_letters_is_full_width(fitted_study: MadeStudy) -> None:
    """HTML entities and punctuation between Latin letters are not changed."""
    with speaking("ja"):
        assert punctuated("右手, A: 4.9 mm (被験者 2 名). 骨; A &amp; 骨, B, C") == (
            "右手、A: 4.9 mm（被験者 2 名）. 骨；A &amp; 骨、B, C"
        )
        assert punctuated("手 (1/3).") == "手（1/3）。"
        pages = [*MadeStudy(fitted_study.file, fitted_study.folder).pages.values()]
        pages.append(recording_page(fitted_study.recording_results()))
    texts = [text for page in pages for text in read_page(page).text]
    assert [text for text in texts if re.search("[ぁ-んァ-ヶ一-龥][,;:.](?: |$)", text)] == []
    assert punctuated("right, left (both).") == "right, left (both)."
