"""What most tests of the fit begin with."""

import pytest

from shukotsu.study.layout import Layout, read_layout


@pytest.fixture(scope="session")
def layout() -> Layout:
    return read_layout("liberty16")
