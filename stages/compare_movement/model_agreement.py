"""Say whether the same question has another answer under another skeleton model, and which two part most."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations
from typing import Any

from shukotsu.sentences.messages import joined, message_of
from shukotsu.statistics.verdicts import NOT_SHOWN, SHOWN

Row = dict[str, Any]

DIFFERENCE, RELIABILITY = "difference", "reliability"
_PLACE = ("hand", "task", "quantity", "of")


def dependence_rows(differences: Iterable[Row], reliabilities: Iterable[Row]) -> Iterator[Row]:
    """Rows of model_dependence: one for each question that several models were asked.

    A reliability's factor is what it is across.
    """
    named = ("factor", "level", "other_level")
    for key, rows in _by_question(differences, named).items():
        where = dict(zip((*named, *_PLACE), key, strict=True))
        yield _row(DIFFERENCE, where, rows, "difference", *_same_conclusion(rows))
    for key, rows in _by_question(reliabilities, ("across",)).items():
        where = dict(zip(("factor", *_PLACE), key, strict=True)) | {"level": "", "other_level": ""}
        yield _row(RELIABILITY, where, rows, "sem", *_same_reliability(rows))


def _by_question(rows: Iterable[Row], named: Sequence[str]) -> dict[tuple[str, ...], list[Row]]:
    questions: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        questions.setdefault(tuple(row[name] for name in (*named, *_PLACE)), []).append(row)
    return questions


def _row(question: str, where: Row, rows: list[Row], of: str, agree: bool | None, why: str) -> Row:
    known = [row for row in rows if row.get(of) is not None]
    widest, which = None, ""
    if len(known) >= 2:
        one, other = max(combinations(known, 2), key=lambda pair: abs(pair[0][of] - pair[1][of]))
        widest, which = abs(one[of] - other[of]), f"{one['model']};{other['model']}"
    return where | {
        "question": question,
        "models": ";".join(row["model"] for row in rows),
        "agree": agree,
        "widest_difference": widest,
        "which": which,
        "unit": rows[0]["unit"],
        "message": why,
    }


def _same_conclusion(rows: Sequence[Row]) -> tuple[bool | None, str]:
    """Say whether all models have one verdict and, where they show a difference, one sign."""
    tested = [row for row in rows if row["verdict"] in (SHOWN, NOT_SHOWN)]
    if len(tested) < 2:
        return None, message_of("untested")
    up = [row["model"] for row in tested if row["verdict"] == SHOWN and row["difference"] > 0]
    down = [row["model"] for row in tested if row["verdict"] == SHOWN and row["difference"] <= 0]
    none = [row["model"] for row in tested if row["verdict"] == NOT_SHOWN]
    groups = {"more-at": up, "less-at": down, "no-difference": none}
    level = tested[0]["level"]
    found = [message_of(kind, level=level, models=", ".join(own)) for kind, own in groups.items() if own]
    return len(found) == 1, "" if len(found) == 1 else joined(found)


def _same_reliability(rows: Sequence[Row]) -> tuple[bool | None, str]:
    """Say whether the intervals of ICC(2,1) of all models overlap."""
    known = [row for row in rows if row.get("icc_2_1") is not None and row["icc_2_1"] == row["icc_2_1"]]
    if len(known) < 2:
        return None, message_of("no-icc")
    highest_low = max(known, key=lambda row: row["icc_2_1_low"])
    lowest_high = min(known, key=lambda row: row["icc_2_1_high"])
    if highest_low["icc_2_1_low"] <= lowest_high["icc_2_1_high"]:
        return True, ""
    return False, message_of("icc-higher", model=highest_low["model"], other=lowest_high["model"])
