"""Limits of what is read: memory is asked for before it is taken."""

from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.files import limits


def test_what_takes_more_memory_than_is_free_is_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "available_memory_bytes", lambda: 2 * 10**9)
    limits.check_memory(Path("a.csv"), 2e9, "a recording")
    with pytest.raises(
        InputError, match=r"a.csv: a recording takes about 2.1 GB of memory .* 2.0 GB are free"
    ):
        limits.check_memory(Path("a.csv"), 2.1e9, "a recording")
    monkeypatch.setattr(limits, "available_memory_bytes", lambda: None)
    limits.check_memory(Path("a.csv"), 1e18, "a recording")
