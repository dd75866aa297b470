"""A real browser for tests of pages: the Chromium of the machine, driven by Playwright.

A conftest imports what its tests use: `from browser import browser, watched_page`. Pages are files, opened as
their reader would. A watched page fails its test if it writes an error or a warning to the console, throws,
or asks for anything but the files that the test opened.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page, Playwright, Request

NAMES = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--no-sandbox",  # Chromium refuses its sandbox to root, which tests in a container run as
    "--use-angle=swiftshader",  # drawn by the processor: as slow as it gets, and the same everywhere
    "--enable-unsafe-swiftshader",
)
WINDOW = {"width": 1280, "height": 800}
PATIENCE_MS = 60_000
"""How long a condition may take to come true on a machine that others use, too."""
PAUSE_MS = 20
_OPEN = ExitStack()
"""What runs until the tests end: a driver can start but once, however many conftests import `browser`."""


class WatchedPage:
    """A page whose complaints and requests are kept.

    console : its errors and warnings so far, thrown ones among them; a test that provokes one takes it out.
    requests : every address that it asked for. opened : the addresses of the files that the test opened.
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.console: list[str] = []
        self.requests: list[str] = []
        self.opened: set[str] = set()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", self._hear)
        page.on("pageerror", lambda error: self.console.append(str(error)))
        page.on("request", self._note)

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            self.console.append(message.text)

    def _note(self, request: Request) -> None:
        self.requests.append(request.url)

    def open(self, path: Path) -> None:
        """Open a file, and wait until it is loaded."""
        self.opened.add(path.as_uri())
        self.page.goto(path.as_uri())

    def value(self, expression: str, argument: Any = None) -> Any:
        """Value of a JavaScript expression, or of a function of the argument."""
        return self.page.evaluate(expression, argument)

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression is true. Playwright's own wait runs text: pages forbid it."""
        for _ in range(PATIENCE_MS // PAUSE_MS):
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(PAUSE_MS)
        raise AssertionError(f"never came true: {condition}")

    def check(self) -> None:
        """Fail if the page complained, or asked for what was not opened."""
        assert self.console == []
        foreign = [url for url in self.requests if url.partition("#")[0] not in self.opened]
        assert [url for url in foreign if not url.startswith(("data:", "blob:"))] == []


@contextmanager
def watched(browser: Browser, **options: Any) -> Iterator[WatchedPage]:
    """A new page with nothing remembered, watched to its end; options as of Playwright's new_context."""
    context = browser.new_context(**{"viewport": WINDOW, **options})
    try:
        page = WatchedPage(context.new_page())
        yield page
        page.check()
    finally:
        context.close()


@cache
def _driver() -> Playwright:
    from playwright.sync_api import sync_playwright

    return _OPEN.enter_context(sync_playwright())


@contextmanager
def chromium(*options: str) -> Iterator[Browser]:
    """The Chromium on the path, started with further options; the test is skipped where there is none.

    Ask for the fixture `browser`, too: it ends the driver.
    """
    program = next((path for name in NAMES if (path := shutil.which(name))), None)
    if program is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is on the path")
    started = _driver().chromium.launch(executable_path=program, args=[*OPTIONS, *options])
    try:
        yield started
    finally:
        started.close()


@cache
def _browser() -> Browser:
    return _OPEN.enter_context(chromium())


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """One browser for all tests; each test has a page of its own, with nothing remembered."""
    yield _browser()
    _OPEN.close()


@pytest.fixture
def watched_page(browser: Browser) -> Iterator[WatchedPage]:
    """A watched page of WINDOW's size."""
    with watched(browser) as page:
        yield page
