"""A refusal is one short line that can be printed, whatever it quotes."""

from shukotsu.errors import MOST_LETTERS, InputError


def test_whatever_a_sentence_quotes_it_is_one_short_printable_line() -> None:
    """It may be a line of a stranger's file, with codes for a terminal in it."""
    sentence = str(
        InputError("a.csv: is \x1b]0;x\x07\x9b31m\ud800\n\tb " + "x" * 5000 + "; expected a number")
    )
    assert len(sentence) <= MOST_LETTERS
    assert sentence.isprintable()
    assert sentence.startswith("a.csv: is ?]0;x??31m? b xxx")
    assert sentence.endswith("xxx; expected a number")
