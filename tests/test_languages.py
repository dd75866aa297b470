"""Every Japanese page of the guide is in step with the English one, and in one language with itself."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from guide_pages import REPOSITORY
from page_pairs import (
    CHARACTER,
    CODE,
    FENCE,
    LINK,
    Page,
    Section,
    missing_quantities,
    paragraphs,
    target_without_language,
    unclosed_emphasis,
)

JAPANESE = [*sorted((REPOSITORY / "docs").glob("*.ja.md")), REPOSITORY / "README.ja.md"]
ONLY_IN_JAPANESE = {"language: ja", "--language ja"}
"""Code that tells how to have the report in Japanese, which an English page need not."""

TERMS = {
    r"(?<!_)metacarpals?": "中手骨",
    r"phalan(?:x|ges)": "指骨|節骨",
    r"\bCMC\b": "CMC",
    r"\bMCP\b": "MCP",
    r"\bPIP\b": "PIP",
    r"\bDIP\b": "DIP",
    r"receivers?\b": "レシーバ",
    r"transmitter": "トランスミッタ",
    r"tracker": "トラッカー|計測装置",
    r"quaternion": "クォータニオン",
    r"joint centres?": "関節中心",
    r"skeleton model": "骨格モデル",
    r"\bthumb": "母指",
    r"index (?:finger|and)": "示指",
    r"ring (?:finger|and)": "環指",
    r"little fingers?": "小指",
    r"\bwrist": "手関節",
    r"\bpalm": "手掌",
    r"forearm": "前腕",
    r"tip errors?": "指先誤差",
    r"calibrat": "キャリブレーション",
    r"\blayouts?\b": "レイアウト",
    r"range of motion": "可動域",
    r"standard deviation": "標準偏差",
    r"subjects?\b": "被験者",
    r"nobody corrected|manual correction": "手動",
}
"""English and the only word for it in Japanese, both as regular expressions."""

NOT_THE_WORD = {
    "レシーバー": "レシーバ",
    "トランスミッター": "トランスミッタ",
    r"トラッカ(?!ー)": "トラッカー",
    r"(?<!中手)掌骨": "中手骨",
    "メタカルパル": "中手骨",
    r"MP関節|中手指関節": "MCP関節（中手指節関節）",
    r"CM関節": "CMC関節（手根中手関節）",
    "親指|拇指": "母指",
    "人差し指|人差指": "示指",
    "薬指": "環指",
    "手首": "手関節",
    "手のひら|掌側(?<!手掌側)": "手掌",
    "四元数|クオータニオン|クォータニヨン": "クォータニオン",
    "フォルダー": "フォルダ",
    "キャリブレイション|較正": "キャリブレーション",
    "関節中央|間接": "関節中心",
    "骨格構造モデル|スケルトンモデル": "骨格モデル",
    "信じ": "信頼できる",
    "あなた": "nothing, or 自分の",
}
"""What other texts say, as a regular expression, and what this guide says."""


def english_of(page: Path) -> Path:
    return page.with_name(page.name.replace(".ja.md", ".md"))


def page_at(path: Path) -> Page:
    return Page(path.read_text("utf-8"))


def pair(page: Path) -> list[tuple[Section, Section]]:
    """Sections side by side: English, Japanese."""
    return list(zip(page_at(english_of(page)).sections, page_at(page).sections, strict=True))


every_page = pytest.mark.parametrize("page", JAPANESE, ids=lambda page: page.name)


@every_page
def test_headings_are_those_of_the_english_page(page: Path) -> None:
    english, japanese = page_at(english_of(page)), page_at(page)
    assert [each.level for each in japanese.sections] == [each.level for each in english.sections]


@every_page
def test_blocks_are_those_of_the_english_page(page: Path) -> None:
    """All but their comments: tests/studies/test_guide_runs.py runs the English ones."""
    assert page_at(page).blocks == page_at(english_of(page)).blocks


@every_page
def test_every_section_has_the_tables_lists_and_pictures_of_the_english_one(page: Path) -> None:
    for english, japanese in pair(page):
        assert japanese.tables == english.tables, str(english)
        assert japanese.items == english.items, str(english)
        assert japanese.pictures == english.pictures, str(english)


@every_page
def test_every_section_has_the_links_of_the_english_one(page: Path) -> None:
    for english, japanese in pair(page):
        theirs = (target_without_language(page.parent, english_of(page), link) for link in english.links)
        ours = (target_without_language(page.parent, page, link) for link in japanese.links)
        assert sorted(ours) == sorted(theirs), str(english)


@every_page
def test_links_lead_to_the_japanese_page_where_there_is_one(page: Path) -> None:
    targets = {target.partition("#")[0] for each in page_at(page).sections for target in each.links}
    english = {target for target in targets - {english_of(page).name} if target.endswith(".md")}
    assert [
        target
        for target in english
        if english_of(page).parent.joinpath(target).with_suffix(".ja.md").exists()
    ] == []


@every_page
def test_every_section_has_the_numbers_and_the_code_of_the_english_one(page: Path) -> None:
    for english, japanese in pair(page):
        assert missing_quantities(english, japanese) == [], str(english)
        assert english.codes ^ japanese.codes <= ONLY_IN_JAPANESE, str(english)


@every_page
def test_every_term_has_its_japanese_word_in_the_same_section(page: Path) -> None:
    for english, japanese in pair(page):
        said = {term for term in TERMS if re.search(term, english.prose, re.IGNORECASE)}
        assert {term for term in said if not re.search(TERMS[term], japanese.prose)} == set(), str(english)


@every_page
def test_no_term_has_a_second_word(page: Path) -> None:
    for section in page_at(page).sections:
        prose = re.sub(r"^>.*$|論文の「[^」]*」", "", section.prose, flags=re.MULTILINE)
        assert [f"{word}: {ours}" for word, ours in NOT_THE_WORD.items() if re.search(word, prose)] == [], (
            section
        )


@every_page
def test_punctuation_is_japanese(page: Path) -> None:
    text = CODE.sub("x", LINK.sub(r"\2", FENCE.sub("", page.read_text("utf-8"))))
    assert (
        re.findall(rf".{{0,8}}{CHARACTER} ?[,.;:!?()].{{0,8}}|.{{0,8}}[,;:!?()]{CHARACTER}.{{0,8}}", text)
        == []
    )
    assert re.findall(r".{0,8}[｡､，．！０-９Ａ-Ｚａ-ｚ].{0,8}", text) == []
    assert list(unclosed_emphasis(page.read_text("utf-8"))) == []


@every_page
def test_a_paragraph_is_one_line_of_polite_sentences(page: Path) -> None:
    """A browser shows a line break in Japanese as a gap."""
    for paragraph in paragraphs(page_at(page)):
        assert "\n" not in paragraph
        plain = re.sub(r"「[^」]*」|\*\*.*?\*\*|（[^）]*）", "", CODE.sub("x", LINK.sub(r"\2", paragraph)))
        rude = [
            each
            for each in plain.split("。")[:-1]
            if re.search(r"(?:である|する|(?<![まで])した|ない|いる|だ|れる|る)$", each)
        ]
        assert rude == []


PARTS = ("sentences", "pages")
CATALOGUE = REPOSITORY / "stages" / "report" / "languages" / "ja.yaml"
LABEL = re.compile(
    r"(?:「|\*\*|\| [✓◆✕]? ?|、)([^「」*|、（）]+)(?:」|\*\*)?（([A-Za-z][a-z][A-Za-z ,-]*|no)）"
)
"""What the report says in Japanese, and in brackets what it says in English."""


def plain_label(text: str) -> str:
    """Without marks, brackets, units, numbers' places and spaces."""
    return re.sub(r"[✓◆✕()]|\[.*?\]|\{.*?\}|\s", "", text).lower()


def test_words_of_the_report_are_those_of_its_catalogue() -> None:
    catalogue = yaml.safe_load(CATALOGUE.read_text("utf-8"))
    said = {
        (plain_label(english), plain_label(japanese))
        for part in PARTS
        for english, japanese in catalogue[part].items()
    }
    quoted = [pair for page in JAPANESE for pair in LABEL.findall(page.read_text("utf-8"))]
    assert len(quoted) > 20
    labels = {(plain_label(english), plain_label(japanese)) for japanese, english in quoted}
    assert labels - said == set()


ENGLISH_PAGE = """# One
Bend the thumb by 40 deg, two times ([why](why.md)): `rigid`.

| a | b |
|---|---|
| 1.5 mm | ![picture](a.png) |

```sh
shukotsu run  # all of it
```
"""
JAPANESE_PAGE = """# 一
母指を40°、2回曲げます（[理由](why.md)）：`rigid`。

| い | ろ |
|---|---|
| 1.5 mm | ![図](a.png) |

```sh
shukotsu run  # すべて
```
"""


def differences(japanese: str) -> set[str]:
    """What the comparisons above find between the small English page and a text."""
    ours, theirs = Page(japanese), Page(ENGLISH_PAGE)
    found = {"blocks"} if ours.blocks != theirs.blocks else set()
    for english, translated in zip(theirs.sections, ours.sections, strict=True):
        for what in ("level", "tables", "links", "pictures", "codes"):
            found |= {what} if getattr(english, what) != getattr(translated, what) else set()
        found |= {"numbers"} if missing_quantities(english, translated) else set()
    return found


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("# 一", "# 一", set()),
        ("# 一", "## 一", {"level"}),
        ("40°", "41°", {"numbers"}),
        ("40°", "40 mm", {"numbers"}),
        ("1.5 mm", "1.5 cm", {"numbers"}),
        ("2回", "3回", {"numbers"}),
        ("why.md", "how.md", {"links"}),
        ("| い | ろ |", "| い |", {"tables"}),
        ("a.png", "b.png", {"pictures"}),
        ("`rigid`", "`rigit`", {"codes"}),
        ("run  #", "check  #", {"blocks"}),
    ],
)
def test_a_translation_that_says_another_thing_is_found(old: str, new: str, found: set[str]) -> None:
    assert differences(JAPANESE_PAGE.replace(old, new)) == found


def test_emphasis_that_a_renderer_would_not_close_is_found() -> None:
    assert list(unclosed_emphasis("**語**を、**「語」**。\n**語。** 文")) == []
    assert list(unclosed_emphasis("**語。**文\n**「語」**を")) == ["**語。**文", "**「語」**を"]
