"""What a study makes of the archive afterwards, by the study's own code: the summary that goes into the
archive and the sheets' rows.
"""

from __future__ import annotations

from contextlib import redirect_stderr
from gettext import NullTranslations
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from shukotsu.coach.coach import Coach, left_row
from shukotsu.coach.estimate import MarkedTouch
from shukotsu.coach.live_poses import marks_in
from shukotsu.coach.setup import KIND, LEFT_OUT, CoachSetup, setup_from_json
from shukotsu.coach.wording import summary_sentence
from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.poses import Poses, read_poses
from shukotsu.schemas.sheets import MEASUREMENTS, TOUCHES
from shukotsu.schemas.verdict import BELIEVE, judged_joint
from shukotsu.sentences.translation import ENGLISH, translating
from shukotsu.trackers.archive import open_archive


def sheet_rows_of(coach: Coach, poses: Poses | None = None) -> dict[str, list[dict[str, Any]]]:
    """Give the rows of the study's sheets, by sheet, of what was measured and marked; poses : as the study
    imports the archive, None where it does not.
    """
    setup = coach.setup
    marks = [] if poses is None else [_touch_row(mark, coach.layout, poses) for mark in coach.touches]
    whose = setup.whose | {"task": setup.task, "trial": setup.trial}
    return {
        TOUCHES.name: [whose | row for row in marks if row is not None],
        MEASUREMENTS.name: [
            setup.whose | {"quantity": own.quantity, "value_mm": own.value_mm, "sd_mm": own.sd_mm}
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


def _imported(archive: Path, setup: CoachSetup, folder: Path) -> Path:
    """Import an archive into a folder as the study does; give its poses table."""
    from shukotsu.schemas.config_files import yaml_text
    from shukotsu.stages.capture import import_recording

    layout, poses = folder / f"{setup.layout['layout']}.yaml", folder / "poses.parquet"
    layout.write_text(yaml_text(dict(setup.layout)), "utf-8")
    whose = setup.whose | {"task": setup.task, "trial": setup.trial}
    argv = [f"--in={archive}", f"--out={poses}", f"--layout={layout}"]
    argv += [f"--{name}={value}" for name, value in whose.items()]
    with redirect_stderr(StringIO()):
        import_recording.import_recording(import_recording.build_parser().parse_args(argv))
    return poses


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
    with TemporaryDirectory() as name:
        folder = Path(name)
        table = _imported(archive, setup, folder)
        rows = sheet_rows_of(coach, read_poses(table, layout.measured))
        sheets: dict[str, Path | None] = {}
        for sheet in (TOUCHES, MEASUREMENTS):
            own = setup.measurements if sheet is MEASUREMENTS else ()
            for row in [*rows[sheet.name], *({**setup.whose, **row} for row in own)]:
                sheets[sheet.name] = folder / f"{sheet.name}.tsv"
                add_row(folder / f"{sheet.name}.tsv", sheet, row)
        sizes = {"hand_length_mm": setup.hand_length_mm, "hand_breadth_mm": setup.hand_breadth_mm}
        plan = plan_of_poses([table], [], layout, [setup.skeleton_model()], sizes_mm=sizes, sheets=sheets)
        try:
            tips, _ = calibrated_hand(plan, plan.part(setup.hand, str(setup.model["model"])))
        except np.linalg.LinAlgError as error:
            raise InputError(f"the recording shows no hand ({error})") from error
        findings = [
            finding
            for finding in checked_poses(table, layout).findings
            if finding.severity != NOTE or finding.kind == "sudden-change"
        ]
    judged = [
        judged_joint(row, setup.wanted_mm) for row in joint_rows(tips.fit) if row["joint"] in tips.fit.joints
    ]
    left = [left_row(row) for row in judged if row["verdict"] != BELIEVE]
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


def read_setup(archive: Path) -> tuple[CoachSetup | None, set[int]]:
    """Give the coach's setup and the ticks that it left out, as an archive has them."""
    setup, skipped = None, set[int]()
    for piece in open_archive(archive).pieces():
        for mark in marks_in(piece, archive):
            if mark.get("kind") == KIND:
                setup = setup_from_json(mark.get("setup"), str(archive))
            elif mark.get("kind") == LEFT_OUT and isinstance(mark.get("tick"), int):
                skipped.add(mark["tick"])
    return setup, skipped
