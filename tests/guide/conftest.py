"""A browser for tests of the pictures and of the site."""

from browser import browser, watched_page  # noqa: F401
