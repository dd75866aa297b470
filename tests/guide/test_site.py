"""The guide's site: built strictly, used offline from files, searched, and checked by axe-core.

axe-core is read from .tools or the folder SHUKOTSU_TOOLS.
"""

import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from browser import WatchedPage, watched
from guide_pages import REPOSITORY
from playwright.sync_api import Browser
from program_files import printed_by

pytestmark = pytest.mark.tools

PROGRAMS = Path(sys.executable).parent
SERIOUS = ("serious", "critical")
PAGES = ("index", "configuration", "calibrate", "first-study")
FETCHED = re.compile(
    r"""<(?:script|img|iframe|link(?=[^>]*stylesheet|[^>]*preconnect|[^>]*icon))[^>]*\s(?:src|href)="(http[^"]*|//[^"]*)"""
)
STYLES_FETCH = re.compile(r"""(?:@import|url\()\s*["']?(?:https?:)?//""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built in strict mode, in which a warning is an error."""
    folder = tmp_path_factory.mktemp("site")
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    words = ("build", "--quiet", "--site-dir", folder)
    printed_by(PROGRAMS / "mkdocs", *words, cwd=REPOSITORY, env=environment)
    return folder


@contextmanager
def opened(browser: Browser, page: Path, **options: object) -> Iterator[WatchedPage]:
    """Yield a page of the site; fail if it requests anything outside the site or writes to the console."""
    with watched(browser, **options) as watched_page:
        watched_page.open(page)
        yield watched_page
        foreign = [
            address
            for address in watched_page.requests
            if not address.startswith(("file:", "data:", "blob:"))
        ]
        assert foreign == []
        # The theme's language switch requests sitemap.xml, which browsers refuse to pages opened as files.
        assert [
            line for line in watched_page.console if "sitemap.xml" not in line and "ERR_FAILED" not in line
        ] == []
        watched_page.console.clear()
        watched_page.requests.clear()


def test_every_page_is_built_in_both_languages_without_python_files(site: Path) -> None:
    assert not list(site.rglob("*.py*"))
    pages = {path.name.removesuffix(".md") for path in (REPOSITORY / "docs").glob("*.md")}
    names = {name for name in pages if not name.endswith(".ja")}
    for folder, language in ((site, "en"), (site / "ja", "ja")):
        assert {path.stem for path in folder.glob("*.html")} - {"404"} == names
        assert f'<html lang="{language}"' in (folder / "index.html").read_text("utf-8")


def test_no_page_loads_external_resources(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert {
        page.name: FETCHED.findall(page.read_text("utf-8"))
        for page in pages
        if FETCHED.search(page.read_text("utf-8"))
    } == {}
    assert [
        style.name for style in site.rglob("*.css") if STYLES_FETCH.search(style.read_text("utf-8"))
    ] == []


def found_by_search(page: WatchedPage, word: str) -> list[Path]:
    """Return the pages that the search field lists for a word, best first."""
    field = page.page.locator("input.md-search__input")
    field.click()  # the index is loaded on the first use
    field.fill(word)
    field.press("End")  # the theme reacts to key releases
    page.wait("/\\d|No matching/.test(document.querySelector('.md-search-result__meta').textContent)")
    links = page.page.locator(".md-search-result__link").all()
    return [Path(unquote(urlsplit(str(link.get_attribute("href"))).path)) for link in links]


@pytest.mark.parametrize(
    ("start", "word", "target"),
    [
        ("index", "model-viewer", "other-programs"),
        ("ja/index", "model-viewer", "other-programs"),
        ("ja/index", "母指", "ja/calibrate"),
    ],
)
def test_search_works_from_a_file(browser: Browser, site: Path, start: str, word: str, target: str) -> None:
    """The best hit is the page about the word, and a click opens it."""
    with opened(browser, site / f"{start}.html") as page:
        hits = found_by_search(page, word)
        assert hits[0] == site / f"{target}.html"
        assert [path for path in hits if not path.is_file()] == []
        page.page.locator(".md-search-result__link").first.click()
        page.wait(f"location.href.startsWith('{hits[0].as_uri()}')")
        page.wait(f"document.querySelector('article')?.innerText.toLowerCase().includes('{word}')")


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("page", PAGES)
def test_nothing_is_wider_than_the_page(browser: Browser, site: Path, page: str, width: int) -> None:
    with opened(browser, site / f"{page}.html", viewport={"width": width, "height": 800}) as shown:
        assert shown.value("document.documentElement.scrollWidth") <= width


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("page", PAGES[:3])
def test_axe_finds_no_serious_violation(
    browser: Browser, site: Path, export_tool: Callable[..., Path], page: str, theme: str
) -> None:
    axe = export_tool("node_modules/axe-core/axe.min.js")
    with opened(browser, site / f"{page}.html", color_scheme=theme) as shown:
        shown.page.add_script_tag(content=axe.read_text("utf-8"))
        violations = shown.value("async () => (await axe.run({preload: false})).violations")
        serious = [
            f"{violation['id']}: {violation['nodes'][0]['html']}"
            for violation in violations
            if violation["impact"] in SERIOUS
        ]
        assert serious == []
