"""Every Japanese page of the guide is in step with the English one, and in one language with itself."""

from __future__ import annotations

from pathlib import Path

import pytest
from guide_pages import REPOSITORY
from page_pairs import (
    Page,
    Section,
    target_without_language,
)

JAPANESE = [*sorted((REPOSITORY / "docs").glob("*.ja.md")), REPOSITORY / "README.ja.md"]
ONLY_IN_JAPANESE = {"language: ja", "--language ja"}
"""Code that tells how to have the report in Japanese, which an English page need not."""


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
        assert english.numbers - japanese.numbers == set(), str(english)
        assert english.codes ^ japanese.codes <= ONLY_IN_JAPANESE, str(english)
