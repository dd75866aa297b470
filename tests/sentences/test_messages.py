"""Messages keep their kind and values: through tables, failures and errors, into any language."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.schemas.advice import GAP, KINDS, MOVE, advice_text
from shukotsu.schemas.catalogue import JOINT_SOLUTIONS
from shukotsu.schemas.findings import NOTE, same_file, worded
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.schemas.tables import Provenance, rows_of
from shukotsu.sentences.messages import (
    MESSAGES,
    Message,
    joined,
    message_of,
    of_finding,
    read_message,
    values_text,
)
from shukotsu.stages.solve_joints.solution_rows import solution_row

REPOSITORY = Path(__file__).resolve().parents[2]
LOST = message_of("no-valid-pose", segments=["index_distal", "hand"])
VALUES = {
    "wanted_deg": 40.0,
    "gap_mm": 12.34,
    "sd_mm": 353.6,
    "enough_mm": 3.4,
    "parent": "hand",
    "child": "lid",
    "finding": of_finding("same-file", "", same_file("right", "rom").values),
}


def test_a_message_is_its_english_sentence() -> None:
    assert LOST == "no valid pose of index_distal and hand; check that receiver"
    failed = message_of("joint-failed", joint="index_mcp", reason=LOST)
    assert failed == f"index_mcp failed: {LOST}"
    assert joined([LOST, "rain fell", LOST, ""]) == f"{LOST}; rain fell"
    assert joined([]) == ""


@pytest.mark.parametrize(
    "own", [LOST, joined([LOST, message_of("no-calibration", reason=LOST), "rain fell"])]
)
def test_a_message_is_read_back_as_it_was(own: Message) -> None:
    again = read_message(str(own), values_text(own))
    assert isinstance(again, Message)
    assert (again, again.parts) == (own, pickle.loads(pickle.dumps(own)).parts)
    assert read_message("rain fell", values_text("rain fell")) == "rain fell"


def test_a_table_keeps_what_a_message_is_made_of(tmp_path: Path) -> None:
    layout = read_layout(REPOSITORY / "config/layouts/liberty16.yaml")
    path, part, other = tmp_path / "joint_solutions.parquet", Part("right", "rigid"), Part("left", "rigid")
    with parts_writer(path, JOINT_SOLUTIONS, Provenance()) as writer:
        writer.rows(part, [solution_row(layout.solvable[0], LOST)])
        writer.failure(other, InputError(LOST).message)
    (row,) = rows_of(read_part(path, JOINT_SOLUTIONS, part))
    assert row["message"].parts == LOST.parts
    assert "message_values" not in row
    assert part_metadata(path, JOINT_SOLUTIONS)[other]["failure"].parts == LOST.parts
    with pytest.raises(InputError, match="no valid pose of index_distal and hand") as caught:
        read_part(path, JOINT_SOLUTIONS, other)
    assert worded("hand", NOTE, caught.value.message).values == {"message": list(LOST.parts)}


@pytest.mark.parametrize(
    ("joint", "said"),
    [
        ("little_dip", "move the little finger's fingertip joint alone through 40 deg"),
        ("thumb_cmc", "move the thumb's base alone through 40 deg"),
        ("elbow", "move it alone through 40 deg"),
    ],
)
def test_what_to_move_has_the_words_that_people_use(joint: str, said: str) -> None:
    assert advice_text(joint, MOVE, VALUES) == said


@pytest.mark.parametrize("kind", KINDS)
def test_every_advice_has_a_whole_sentence(kind: str) -> None:
    said = advice_text("elbow", kind, VALUES)
    assert kind in MESSAGES
    assert said
    assert "{" not in said


def test_advice_has_its_numbers() -> None:
    assert "by 12.3 mm at best" in advice_text("elbow", GAP, VALUES)
