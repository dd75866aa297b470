"""Every Japanese page of the guide corresponds to the English one, section by section."""

import re
from pathlib import Path

import pytest
from guide_pages import FENCE, REPOSITORY, blocks

JAPANESE = [*sorted((REPOSITORY / "docs").glob("*.ja.md")), REPOSITORY / "README.ja.md"]
ONLY_IN_JAPANESE = {"language: ja", "--language ja"}
"""Code for a report in Japanese, which English pages need not mention."""

LINK = re.compile(r"!?\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
CODE = re.compile(r"`((?:[^`\n]|\n(?!\n))+)`")


def code(page: Path) -> list[tuple[str, list[str]]]:
    """Return the language and the words of every fenced block, without comments."""
    return [(block.language, re.sub(r"(?m)(^|\s+)# .*$", "", block.text).split()) for block in blocks(page)]


def sections(text: str) -> list[tuple[str, str]]:
    """Return the marks of every heading and the text below it, without blocks and comments."""
    text = re.sub(r"<!--.*?-->", "", FENCE.sub("", text), flags=re.DOTALL)
    parts = re.split(r"^(#+) ", text, flags=re.MULTILINE)
    before = [("", parts[0])] if parts[0].strip() else []
    return before + list(zip(parts[1::2], parts[2::2], strict=True))


def codes(section: str) -> set[str]:
    return {" ".join(code.split()) for code in CODE.findall(section)}


def numbers(section: str) -> set[str]:
    """Return the numbers in a section's prose, without code and targets of links."""
    prose = CODE.sub(" ", LINK.sub(r"\1", section))
    return set(re.findall(r"(?<![A-Za-z\d.])\d+(?:\.\d+)?", re.sub(r"(?<=\d)[\s,](?=\d{3})", "", prose)))


def files(section: str) -> list[str]:
    """Return the pages and pictures that a section links to, regardless of their language."""
    return sorted(re.sub(r"\.ja(?=\.)|#.*", "", target) for _, target in LINK.findall(section))


@pytest.mark.parametrize("page", JAPANESE, ids=lambda page: page.name)
def test_a_japanese_page_corresponds_to_the_english_one(page: Path) -> None:
    english = page.with_name(page.name.replace(".ja.md", ".md"))
    assert code(page) == code(english)
    theirs, ours = (sections(each.read_text("utf-8")) for each in (english, page))
    assert [level for level, _ in ours] == [level for level, _ in theirs]
    for (_, original), (_, translation) in zip(theirs, ours, strict=True):
        heading = original.partition("\n")[0]
        assert numbers(original) - numbers(translation) == set(), heading
        assert codes(original) ^ codes(translation) <= ONLY_IN_JAPANESE, heading
        assert len(files(original)) == len(files(translation)), heading
        assert {file for file in files(original) if file} == {file for file in files(translation) if file}, (
            heading
        )
        assert original.count("\n|") == translation.count("\n|"), heading
