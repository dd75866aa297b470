"""Command line: poses of a hand's calibration recordings -> which joints need more motion."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.stages import command_line, subject_stage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from shukotsu.schemas.plan import SubjectPlan
    from shukotsu.stages.solve_joints.calibration_advice import Advice

ENDINGS = (".csv", ".parquet")
_HEADINGS = ("joint", "turned deg", "sd now mm", "sd with more motion mm", "advice")


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu stage solve_joints.check_calibration",
        "Say which joints the calibration recordings move too little, and how they would gain from more.",
        "shukotsu stage solve_joints.check_calibration --poses results/demo/sub-01/right/rom/poses.parquet "
        "--layout liberty16",
    )
    subject_stage.add_plan_options(parser, calibration="--poses", sizes=("hand_length_mm",))
    parser.add_argument("--out", type=Path, help="write the table there too, as .csv or .parquet")
    return parser


def check(arguments: argparse.Namespace) -> None:
    """Weigh every joint of every hand against anatomy; print what to move, and write it where asked to."""
    from shukotsu.errors import InputError
    from shukotsu.schemas.catalogue import CALIBRATION_ADVICE
    from shukotsu.schemas.parts import parts_writer
    from shukotsu.schemas.tables import Provenance

    out: Path | None = arguments.out
    if out is not None and out.suffix not in ENDINGS:
        raise InputError(f"{out}: the ending says the format; expected {' or '.join(ENDINGS)}")
    plan = subject_stage.plan_of(arguments)
    if out is None or out.suffix == ".csv":
        rows = [row for hand in plan.hands for row in _printed_rows(arguments, plan, hand)]
        if out is not None:
            _write_csv(out, rows)
        return
    provenance = Provenance.of(subject_stage.poses_files(plan), plan.folder)
    with parts_writer(out, CALIBRATION_ADVICE, provenance) as write:
        for hand in plan.hands:
            part = plan.part(hand)
            with subject_stage.recording_failure(arguments, part, write):
                write.rows(part, _printed_rows(arguments, plan, hand))


def _printed_rows(arguments: argparse.Namespace, plan: SubjectPlan, hand: str) -> list[dict[str, Any]]:
    """Print the advice on a hand; give its rows."""
    advice, stands = hand_advice(plan, hand, allow_none=arguments.record_failure)
    if len(plan.hands) > 1:
        print(f"{hand} hand")
    print("\n".join(filter(None, (stands, as_text(advice)))))
    return [{**vars(plan.hand(hand)), **row.columns} for row in advice]


def hand_advice(plan: SubjectPlan, hand: str, *, allow_none: bool) -> tuple[list[Advice], str]:
    """Give the advice on a hand's joints from every recording that may calibrate it; then a line on the
    finding that stands against them, empty where none does.

    Raises InputError where no recording holds poses, unless `allow_none`: then there is no advice.
    """
    from dataclasses import replace

    from shukotsu.errors import InputError
    from shukotsu.schemas.advice import UNSETTLED
    from shukotsu.schemas.finding_groups import row_message
    from shukotsu.schemas.poses import usable_poses
    from shukotsu.sentences.finding_sentences import in_quotes
    from shukotsu.sentences.messages import joined, message_of
    from shukotsu.stages.solve_joints.calibration_advice import advise
    from shukotsu.stages.solve_joints.solve import HandDescription, stream_recordings

    layout = plan.layouts[hand]
    usable, reasons = usable_poses([plan.poses(recording) for recording in plan.all_calibrating(hand)])
    if not usable and allow_none:  # what became of the recordings stands with them
        return [], ""
    if not usable:
        raise InputError(message_of("no-calibration", reason=joined(reasons) or message_of("none-given")))
    recordings = stream_recordings(usable, layout, sample_frames=True)
    advice = advise(recordings.weigh(HandDescription(hand, plan.hand_length_mm)), layout)
    stands = _suspicion(plan, hand, usable)
    if stands is None:
        return advice, ""
    line = f"{stands['severity']}: {stands['kind']}: {in_quotes(stands['message'])}"
    values = {"finding": row_message(stands).parts}
    return [replace(row, kind=UNSETTLED, values=values) for row in advice], line


def _suspicion(plan: SubjectPlan, hand: str, usable: Sequence[Path]) -> dict[str, Any] | None:
    """Give the first finding that stands against a hand's calibration recordings, as a row.

    It is that of the subject's findings table, or of a hand alone what its poses say now.
    """
    from shukotsu.checks.checked_poses import checked_poses
    from shukotsu.schemas.catalogue import FINDINGS
    from shukotsu.schemas.findings import NOTE
    from shukotsu.schemas.tables import read_table, rows_of

    if not plan.is_study:
        layout = plan.layouts[hand]
        found = [one for path in usable for one in checked_poses(path, layout).findings]
        return next((one.columns for one in found if one.severity != NOTE), None)
    if not plan.table(FINDINGS.name).is_file():
        return None
    names = {(hand, own.task, own.trial) for own in plan.all_calibrating(hand)}
    rows = rows_of(read_table(plan.table(FINDINGS.name), FINDINGS))
    standing = (row for row in rows
                if row["severity"] != NOTE and (row["hand"], row["task"], row["trial"]) in names)  # fmt: skip
    return next(standing, None)


def as_text(advice: Sequence[Advice]) -> str:
    """Give the table as lines of text with aligned columns."""
    rows = [_HEADINGS, *(_cells(row) for row in advice)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEADINGS) - 1)]
    return "\n".join(
        "  ".join(
            [row[0].ljust(widths[0]), *(row[i].rjust(widths[i]) for i in range(1, len(widths))), row[-1]]
        )
        for row in rows
    )


def _cells(row: Advice) -> tuple[str, ...]:
    numbers = (
        "-" if value is None else format(value, form)
        for value, form in ((row.range_deg, ".0f"), (row.sd_now_mm, ".1f"), (row.sd_moved_mm, ".1f"))
    )
    return (row.joint, *numbers, row.columns["advice"])


def _write_csv(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    import pyarrow as pa
    import pyarrow.csv

    from shukotsu.files.whole_files import replacing
    from shukotsu.schemas.catalogue import CALIBRATION_ADVICE
    from shukotsu.schemas.tables import columns_from_rows

    with replacing(path) as temporary:
        pa.csv.write_csv(pa.table(columns_from_rows(CALIBRATION_ADVICE, rows)), temporary)


def record_bug(arguments: argparse.Namespace, message: str) -> None:
    """Write why there is no advice, of every hand."""
    from shukotsu.errors import InputError
    from shukotsu.schemas.catalogue import CALIBRATION_ADVICE

    if arguments.out is None or arguments.out.suffix == ".csv":
        raise InputError(message)
    plan = subject_stage.plan_of(arguments)
    tables = {arguments.out: CALIBRATION_ADVICE}
    subject_stage.record_failed_parts(message, tables, map(plan.part, plan.hands))


def main(argv: list[str] | None = None) -> int:
    """Run the command; give its exit code."""
    return command_line.run(build_parser, argv, check, record_bug=record_bug)


if __name__ == "__main__":
    sys.exit(main())
