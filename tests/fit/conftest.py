"""Fixtures for the tests of the whole-hand fit."""

import pytest

from shukotsu.study.layout import Layout, read_layout


@pytest.fixture(scope="session")
def layout() -> Layout:
    return read_layout("liberty16")
