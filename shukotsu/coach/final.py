"""What a study makes of the archive afterwards, by the study's own code: the summary that goes into the
archive and the sheets' rows.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from gettext import NullTranslations
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from shukotsu.coach.coach import Coach
from shukotsu.coach.estimate import MarkedTouch
from shukotsu.coach.live_poses import LivePoses
from shukotsu.coach.setup import KIND, LEFT_OUT, CoachSetup, setup_from_json
from shukotsu.coach.wording import summary_sentence
from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import Poses, read_poses
from shukotsu.schemas.sheets import MEASUREMENTS, TOUCHES
from shukotsu.schemas.verdict import BELIEVE, judged_joint
from shukotsu.sentences.translation import ENGLISH, translating
from shukotsu.stages.capture.formats.raw_capture import COACH_SUMMARY


def sheet_rows_of(coach: Coach, poses: Poses) -> dict[str, list[dict[str, Any]]]:
    """Give the rows of the study's sheets, by sheet, of what was marked and measured; poses : as the study
    imports the archive.
    """
    setup = coach.setup
    whose = {"subject": setup.subject, "hand": setup.hand, "session": setup.session}
    rows = (_touch_row(mark, coach.layout, poses) for mark in coach.touches)
    touches = [row for row in rows if row is not None]
    return {
        TOUCHES.name: [whose | {"task": setup.task, "trial": setup.trial} | row for row in touches],
        MEASUREMENTS.name: [
            whose | {"quantity": own.quantity, "value_mm": own.value_mm, "sd_mm": own.sd_mm}
            for own in coach.measured
        ],
    }


def _touch_row(mark: MarkedTouch, layout: Layout, poses: Poses) -> dict[str, Any] | None:
    tips = [layout.digits[digit].tip for digit in (mark.digit, mark.meets) if digit]
    valid = poses.valid[:, [poses.index(tip) for tip in tips]].all(1)
    times = poses.time_s[np.isin(poses.frame, mark.frames) & valid]
    if not len(times):
        return None
    x, y, z = mark.point_mm or (None, None, None)
    own = {
        "digit": mark.digit,
        "part": mark.part,
        "from_s": float(times.min()),
        "to_s": float(times.max()),
        "sd_mm": mark.sd_mm,
    }
    return own | ({"meets": mark.meets} if mark.meets else {"x_mm": x, "y_mm": y, "z_mm": z})


@contextmanager
def imported(archive: Path, setup: CoachSetup) -> Iterator[tuple[Path, Path]]:
    """Import an archive as the study does, into a folder that is removed again; give its poses table and that
    folder.
    """
    from shukotsu.schemas.config_files import yaml_text
    from shukotsu.stages.capture import import_recording

    with TemporaryDirectory() as name:
        folder = Path(name)
        layout, poses = folder / f"{setup.layout['layout']}.yaml", folder / "poses.parquet"
        layout.write_text(yaml_text(dict(setup.layout)), "utf-8")
        argv = [
            f"--in={archive}",
            f"--out={poses}",
            f"--layout={layout}",
            f"--subject={setup.subject}",
            f"--hand={setup.hand}",
        ]
        argv += [f"--task={setup.task}", f"--trial={setup.trial}", f"--session={setup.session}"]
        with redirect_stderr(StringIO()):
            import_recording.import_recording(import_recording.build_parser().parse_args(argv))
        yield poses, folder


def final_summary(archive: Path, coach: Coach) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    """Solve the hand from the archive as the study will; give the summary, and the sheets' rows.

    Raises InputError where the study could make no hand of it.
    """
    from shukotsu.checks.checked_poses import checked_poses
    from shukotsu.coach.study_sheets import add_row
    from shukotsu.schemas.findings import NOTE
    from shukotsu.schemas.plan import plan_of_poses
    from shukotsu.sentences.finding_sentences import in_quotes
    from shukotsu.stages.fit_hand.calibration import calibrated_hand
    from shukotsu.stages.fit_hand.hand_tables import joint_rows

    setup, layout = coach.setup, coach.layout
    with imported(archive, setup) as (table, folder):
        rows = sheet_rows_of(coach, read_poses(table, layout.measured))
        sheets: dict[str, Path | None] = {}
        for sheet in (TOUCHES, MEASUREMENTS):
            known = [*rows[sheet.name], *(_own_measurements(setup) if sheet is MEASUREMENTS else [])]
            for row in {_key(row, sheet.key): row for row in reversed(known)}.values():
                sheets[sheet.name] = folder / f"{sheet.name}.tsv"
                add_row(folder / f"{sheet.name}.tsv", sheet, row)
        sizes = {"hand_length_mm": setup.hand_length_mm, "hand_breadth_mm": setup.hand_breadth_mm}
        plan = plan_of_poses([table], [], layout, [setup.skeleton_model()], sizes_mm=sizes, sheets=sheets)
        try:
            tips, _ = calibrated_hand(plan, plan.part(setup.hand, str(setup.model["model"])))
        except np.linalg.LinAlgError as error:
            raise InputError(f"the recording shows no hand ({error})") from error
        findings = [finding for finding in checked_poses(table, layout).findings if finding.severity != NOTE]
    judged = [
        judged_joint(row, setup.wanted_mm) for row in joint_rows(tips.fit) if row["joint"] in tips.fit.joints
    ]
    left = [_left(row) for row in judged if row["verdict"] != BELIEVE]
    summary = coach.summary() | {
        "left": left,
        "believed": len(judged) - len(left),
        "of": len(judged),
        "joints": {
            row["joint"]: {"sd_mm": round(float(row["sd_mm"]), 4), "verdict": row["verdict"]}
            for row in judged
        },
        "findings": [str(in_quotes(finding.message)) for finding in findings],
    }
    with translating(ENGLISH, NullTranslations()):  # as all sentences in tables are
        summary["sentence"] = summary_sentence(summary)
    return summary, rows


def _own_measurements(setup: CoachSetup) -> list[dict[str, Any]]:
    whose = {"subject": setup.subject, "hand": setup.hand, "session": setup.session}
    return [
        whose | {name: row[name] for name in ("quantity", "value_mm", "sd_mm")} for row in setup.measurements
    ]


def _key(row: Mapping[str, Any], names: tuple[str, ...]) -> str:
    return json.dumps([row.get(name) for name in names])


def _left(row: Mapping[str, Any]) -> dict[str, Any]:
    number = {name: round(float(row[name]), digits) for name, digits in (("sd_mm", 2), ("range_deg", 1))}
    return {"joint": row["joint"], "reason": row["reason"], **number}


def read_setup(archive: Path) -> tuple[CoachSetup | None, set[int], Mapping[str, Any] | None]:
    """Give the coach's setup, the ticks that it left out and its summary, as an archive has them."""
    from shukotsu.trackers.archive import open_archive

    poses, setup = LivePoses.events_of(open_archive(archive).pieces(), archive), None
    skipped, summary = set[int](), None
    for event in poses:
        mark = event.get("kind") if event.get("event") == "mark" else None
        if mark == KIND:
            setup = setup_from_json(event.get("setup"), str(archive))
        elif mark == LEFT_OUT and isinstance(event.get("tick"), int):
            skipped.add(event["tick"])
        elif event.get("event") == COACH_SUMMARY:
            summary = event
    return setup, skipped, summary
