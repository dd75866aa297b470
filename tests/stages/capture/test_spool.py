"""What waits in a spool comes back as it was, from memory and from its files, which nobody sees."""

from pathlib import Path

import numpy as np
import pytest

from schemas.errors import InputError
from stages.capture.spool import Spool


@pytest.mark.parametrize("memory_bytes", [0, 100, 1 << 20])
def test_chunks_come_back_in_order(tmp_path: Path, memory_bytes: int) -> None:
    random = np.random.default_rng(0)
    added = {
        key: [(random.normal(size=(7, n)), random.integers(0, 9, n, np.uint32)) for n in (5, 2, 0, 3)]
        for key in ("a", "b")
    }
    with Spool(tmp_path, memory_bytes) as spool:
        for index in range(4):
            for key, chunks in added.items():
                spool.add(key, chunks[index])
                next(spool.chunks(key))  # what is read in between moves no place
        for key, chunks in added.items():
            for (first,), (wanted, _) in zip(spool.chunks(key, [0]), chunks, strict=True):
                np.testing.assert_array_equal(first, wanted)
        for got, wanted in zip(spool.take("a"), added["a"], strict=True):
            for one, other in zip(got, wanted, strict=True):
                np.testing.assert_array_equal(one, other)
                assert one.dtype == other.dtype
        assert list(spool.chunks("a")) == []
        assert len(list(spool.chunks("b"))) == 4
        assert list(tmp_path.iterdir()) == []


def test_memory_that_is_taken_back_serves_again(tmp_path: Path) -> None:
    """A second queue as long as the first needs no file once the first is taken."""
    ones = np.ones(10)
    with Spool(tmp_path / "none", ones.nbytes) as spool:
        spool.add("a", (ones,))
        list(spool.take("a"))
        spool.add("b", (ones,))
        assert not (tmp_path / "none").exists()
        spool.add("c", (ones,))
        assert (tmp_path / "none").exists()


def test_a_folder_that_cannot_be_written_to_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", "utf-8")
    with Spool(tmp_path / "file", 0) as spool, pytest.raises(InputError, match="file: cannot be written"):
        spool.add("a", (np.ones(1),))
