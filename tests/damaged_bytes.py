"""Random damage to the bytes of a file, and the check that a reader refuses it properly or reads it."""

from collections.abc import Callable

from hypothesis import strategies as st

from shukotsu.errors import MOST_LETTERS, InputError

TOKENS = (
    b'- , " [ {} nan 1e999 99999999999999999999 null &a *a !!python/name:os \xc3\xa9 \xed\xa0\x80'.split()
)
TOKENS += [b"\r\n", b"\0", b"\t", b": ", b"- ", b"\xff" * 4, b"\x7f\xff\xff\xff"]


def damaged(data: bytes) -> st.SearchStrategy[bytes]:
    """Return a strategy for the bytes with up to five deletions, replacements or insertions."""
    gone, put = st.sampled_from([0, 1, 4, 200]), st.sampled_from(TOKENS) | st.binary(max_size=8)

    def apply(edits: list[tuple[int, int, bytes]]) -> bytes:
        spoilt = bytearray(data)
        for offset, length, instead in edits:
            spoilt[offset : offset + length] = instead
        return bytes(spoilt)

    return st.lists(st.tuples(st.integers(0, len(data)), gone, put), min_size=1, max_size=5).map(apply)


def assert_read_or_refused(read: Callable[[], object]) -> None:
    """Check that a reader returns, or raises InputError with one printable sentence."""
    try:
        read()
    except InputError as error:
        text = str(error)
    else:
        return
    assert text.isprintable()
    assert 0 < len(text) <= MOST_LETTERS
