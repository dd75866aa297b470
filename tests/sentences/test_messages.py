"""Messages keep their kind and values: through tables, failures and errors, into any language."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from shukotsu.errors import InputError
from shukotsu.schemas.catalogue import JOINT_SOLUTIONS
from shukotsu.schemas.findings import NOTE, worded
from shukotsu.schemas.layout import read_layout
from shukotsu.schemas.parts import Part, part_metadata, parts_writer, read_part
from shukotsu.schemas.tables import Provenance, rows_of
from shukotsu.sentences.messages import (
    Message,
    joined,
    message_of,
    read_message,
    values_text,
)
from shukotsu.stages.solve_joints.solution_rows import solution_row

REPOSITORY = Path(__file__).resolve().parents[2]
LOST = message_of("no-valid-pose", segments=["index_distal", "hand"])


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
