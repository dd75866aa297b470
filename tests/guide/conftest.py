"""Fixtures for the tests of the guide: a browser."""

from browser import browser, watched_page  # noqa: F401
