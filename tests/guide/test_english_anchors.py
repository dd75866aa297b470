"""A Japanese page has the anchors of the English one beside it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from guide.english_anchors import anchors, on_page_markdown, with_anchors

ENGLISH = """# What went wrong?

```sh
# no heading
```

## An error is [printed](x.md) {#error}

## `status`: weak
"""
JAPANESE = ENGLISH.replace("What went wrong?", "うまくいかないとき").replace(" {#error}", "")


def test_anchors_are_those_of_the_site() -> None:
    assert anchors(ENGLISH) == ["what-went-wrong", "error", "status-weak"]


def test_every_heading_gets_its_anchor_and_a_comment_in_a_block_none() -> None:
    text = with_anchors(JAPANESE, ["one", "two", "three"])
    assert '# <a id="one"></a>うまくいかないとき\n' in text
    assert '## <a id="three"></a>`status`: weak' in text
    assert "\n# no heading\n" in text


def test_a_page_with_other_headings_is_refused() -> None:
    with pytest.raises(ValueError, match="3 headings; expected 2, as in English"):
        with_anchors(JAPANESE, ["one", "two"])


def test_only_a_japanese_page_is_changed(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text(ENGLISH, "utf-8")
    for name, marked in (("page.md", False), ("page.ja.md", True)):
        page = SimpleNamespace(file=SimpleNamespace(abs_src_path=str(tmp_path / name)))
        text = on_page_markdown(JAPANESE, page=page)
        assert ('<a id="error"></a>' in text) is marked
