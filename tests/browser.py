"""A real browser for tests of pages: the machine's Chromium, driven by Playwright.

A conftest imports the fixtures that its tests use: `from browser import browser, watched_page`. Pages are
opened as files. A watched page fails its test if it writes an error or a warning to the console, throws an
exception or requests anything but the files that the test opened.
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
    from playwright.sync_api import Browser, ConsoleMessage, Page, Playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--no-sandbox",  # Chromium's sandbox does not work as root, as in containers
    "--use-angle=swiftshader",  # software rendering: slow, but the same everywhere
    "--enable-unsafe-swiftshader",
)
WINDOW = {"width": 1280, "height": 800}
PATIENCE_MS = 60_000
"""Longest wait for a condition, generous for machines under load."""
PAUSE_MS = 20
_OPEN = ExitStack()
"""Resources open until the tests end: a driver can start only once, however many conftests import
`browser`.
"""


class WatchedPage:
    """A page whose console messages and requests are recorded.

    console : errors, warnings and exceptions so far; a test that provokes one removes it. requests : all
    requested addresses. opened : the addresses of the files that the test opened.
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.console: list[str] = []
        self.requests: list[str] = []
        self.opened: set[str] = set()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", self._hear)
        page.on("pageerror", lambda error: self.console.append(str(error)))
        page.on("request", lambda request: self.requests.append(request.url))

    def _hear(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            self.console.append(message.text)

    def open(self, path: Path) -> None:
        """Open a file and wait until it is loaded."""
        self.opened.add(path.as_uri())
        self.page.goto(path.as_uri())

    def value(self, expression: str, argument: Any = None) -> Any:
        """Return the value of a JavaScript expression, or of a function applied to the argument."""
        return self.page.evaluate(expression, argument)

    def wait(self, condition: str) -> None:
        """Wait until a JavaScript expression is true. Playwright's wait evaluates text, which the pages
        forbid.
        """
        for _ in range(PATIENCE_MS // PAUSE_MS):
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(PAUSE_MS)
        raise AssertionError(f"never came true: {condition}")

    def check(self) -> None:
        """Fail if the page wrote to the console or requested anything that was not opened."""
        assert self.console == []
        foreign = [url for url in self.requests if url.partition("#")[0] not in self.opened]
        assert [url for url in foreign if not url.startswith(("data:", "blob:"))] == []


@contextmanager
def watched(browser: Browser, **options: Any) -> Iterator[WatchedPage]:
    """Yield a watched page in a new browser context; options are those of Playwright's new_context."""
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
    """Yield the Chromium on the path, started with further options; skip the test if there is none.

    The test must also use the fixture `browser`, which stops the driver.
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
    """One browser for all tests; each test opens its page in a new context."""
    yield _browser()
    _OPEN.close()


@pytest.fixture
def watched_page(browser: Browser) -> Iterator[WatchedPage]:
    """A watched page of WINDOW's size."""
    with watched(browser) as page:
        yield page
