"""A browser for the coach's page."""

from browser import browser, watched_page  # noqa: F401
