"""How a stage fails: one sentence and 2, or the reason in its tables and 0; a bug stays a bug."""

import argparse

import pytest

from schemas.errors import InputError
from stages.command_line import parser, run


def given(*words: str) -> argparse.Namespace:
    return parser("stages.any", "Any.", "any --record-failure").parse_args(words)


def failing(error: Exception):
    def work(_: argparse.Namespace) -> None:
        raise error

    return work


def test_bad_input_is_a_sentence_and_2(capsys: pytest.CaptureFixture[str]) -> None:
    recorded: list[str] = []
    code = run(given(), failing(InputError("f.csv: row 3")), lambda _, message: recorded.append(message))
    assert (code, recorded, capsys.readouterr().err) == (2, [], "error: f.csv: row 3\n")


def test_a_recorded_failure_is_0_and_still_said(capsys: pytest.CaptureFixture[str]) -> None:
    recorded: list[str] = []
    work = failing(InputError("f.csv: row 3"))
    code = run(given("--record-failure"), work, lambda _, message: recorded.append(message))
    assert (code, recorded, capsys.readouterr().err) == (0, ["f.csv: row 3"], "error: f.csv: row 3\n")


def test_a_bug_is_raised_or_recorded_with_its_traceback_in_the_log(
    capsys: pytest.CaptureFixture[str],
) -> None:
    recorded: list[str] = []
    with pytest.raises(ZeroDivisionError):
        run(given(), failing(ZeroDivisionError("oh")), lambda _, message: recorded.append(message))
    assert recorded == []
    work = failing(ZeroDivisionError("oh"))
    assert run(given("--record-failure"), work, lambda _, message: recorded.append(message)) == 0
    assert recorded == ["internal error (ZeroDivisionError: oh); please report it with the log"]
    assert "Traceback" in capsys.readouterr().err


def test_a_failure_that_cannot_be_recorded_is_2() -> None:
    def record(_: argparse.Namespace, __: str) -> None:
        raise InputError("t.parquet: cannot be written")

    assert run(given("--record-failure"), failing(InputError("bad")), record) == 2
