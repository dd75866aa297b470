"""Columns that several tables of the contract have."""

from __future__ import annotations

import pyarrow as pa

from shukotsu.schemas.tables import Column

TEXT, REAL, WHOLE, YES_NO = pa.string(), pa.float64(), pa.int64(), pa.bool_()

SUBJECT = Column("subject", TEXT, "", "the subject's name, as in the recordings sheet")
SESSION = Column("session", TEXT, "", "when receivers were put on; empty where the sheet names none")
HAND = Column("hand", TEXT, "", "right or left")
TASK = Column("task", TEXT, "", "what was done, as in the recordings sheet")
TRIAL = Column("trial", TEXT, "", "which repetition; empty where the sheet names none")
MODEL = Column("model", TEXT, "", "the skeleton model")
MADE_WITHOUT = Column(
    "made_without", TEXT, "", "task whose recordings the skeleton was made without; empty: of all"
)
DIGIT = Column("digit", TEXT, "", "the digit, as the layout names it")
JOINT = Column("joint", TEXT, "", "the joint, as the layout names it")
FRAME = Column("frame", WHOLE, "", "the tracker's own frame number, kept as it came")
MESSAGE = Column("message", TEXT, "", "in words, why a result is weak or missing")
STATUS = Column("status", TEXT, "", "ok, weak (read the message) or failed (no usable number)")
REASON_VALUES = Column(
    "reason_values",
    TEXT,
    "",
    "every doubt with its numbers, JSON: an object by kind, the weightiest first; empty: none",
)
JUDGEMENT = (
    Column("verdict", TEXT, "", "believe, care or no (docs/reading-a-report.md); empty: not judged here"),
    Column("reason", TEXT, "", "kind of the weightiest doubt, such as moved-too-little; empty: believed"),
    REASON_VALUES,
)
"""Whether to believe a joint or a bone, see `shukotsu.schemas.verdict`."""
JOINT_STATUS = Column("status", TEXT, "", "ok, weak (verdict no) or failed (no usable number)")


OF_RECORDING = (SUBJECT, SESSION, HAND, TASK, TRIAL)
OF_SKELETON = (SUBJECT, SESSION, HAND, MODEL, MADE_WITHOUT)
OF_SKELETON_IN_RECORDING = (*OF_RECORDING, MODEL, MADE_WITHOUT)
"""Columns that say what a row is of."""

_UNITS = {
    "_mm": "mm",
    "_deg": "deg",
    "_deg2": "deg^2",
    "_s": "s",
    "_percent": "%",
    "_ms": "ms",
    "_ppm": "ppm",
    "_mm_s": "mm/s",
    "_deg_s": "deg/s",
}
"""Units by how a column's name ends; of two endings that fit, the longer."""


def real(name: str, description: str) -> Column:
    """A number, or null, in the unit that its name ends with."""
    fitting = [ending for ending in _UNITS if name.endswith(ending)]
    unit = _UNITS[max(fitting, key=len)] if fitting else ""
    return Column(name, REAL, unit, description, nullable=True)


def xyz(prefix: str, unit: str, description: str) -> tuple[Column, ...]:
    """Three numbers, one for each axis."""
    suffix = f"_{unit}" if unit else ""
    return tuple(
        Column(f"{prefix}{axis}{suffix}", REAL, unit, f"{description}, {axis}", nullable=True)
        for axis in "xyz"
    )


def quaternion(description: str) -> tuple[Column, ...]:
    """The four numbers of a quaternion, scalar first."""
    return tuple(Column(f"q{part}", REAL, "", f"{description}, {part}", nullable=True) for part in "wxyz")
