"""A synthetic study with results: every subject's tables as the stages write them, then gathered.

Hands are simulated with receivers that never slip, so joints, bones and tips of every model are the true
ones. Right hands have three cycles of the event "tap", one with a gap in its middle. On the spoiled hand the
little DIP joint is weak and 300 mm off, the ring DIP joint failed and one receiver came loose. If there are
several subjects, the last one's left recording failed. A simulated study has a truth and a second task, rom,
for calibration only.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from simulated_poses import write_poses

from report_samples.pages import rows_where
from shukotsu.paper.skeleton import is_whole
from shukotsu.report.hand_motion import HandMotion
from shukotsu.report.recording_results import RecordingResults, read_recording
from shukotsu.report.study_page import render_study
from shukotsu.report.study_results import StudyResults, read_results, read_subject
from shukotsu.report.subject_page import render_subject
from shukotsu.scores.comparisons import compare_models, compare_study
from shukotsu.scores.observations import ScoredStudy
from shukotsu.simulate.random_hand import BONES, DIGITS
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_truth
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.study.layout import read_layout
from shukotsu.study.model import SkeletonModel
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import StudyPlans, plan_text, read_plan
from shukotsu.study.results import FIT_TABLES, GATHERED_TABLES, MODEL_COMPARISONS, STUDY_TABLES, Results
from shukotsu.study.study import Recording, Study, read_study
from shukotsu.study.verdict import AXIS_IN_PLANE, judged_bone, judged_joint, note_doubts
from shukotsu.tables import typed_table
from shukotsu.tables.catalogue import DISTAL_RECEIVER, FINDINGS, JOINT_CENTRES, POSES, TABLES
from shukotsu.tables.parts import Part, parts_writer
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.subjects import path_token
from shukotsu.tables.typed_table import Provenance, Table
from shukotsu.tables.whole_files import write_text
from shukotsu.workflow.study_tables import gather_study

HOSTILE = 'A & <b>"x"'
PAPERS = ("paper-fig3-rest", "paper-fig3", "paper-fig4", "paper-fig4-corrected")
FITTED_MODELS = ("paper-fig4", "whole-hand")
SECOND_FIT = "whole-hand-b"
"""A copy of the model whole-hand, written beside the study file."""
UNSEEN, PEAK_FRAME = slice(100, 160), 217
"""Frames without the index finger's distal receiver, and a frame with an error of 40 mm in fitted hands."""
NO_SOURCE = Provenance((("recording.csv", "0" * 64),), {})
LAYOUT = read_layout("liberty16")
ANGLES = ("flexion_deg", "abduction_deg", "rotation_deg")
LEVELS_MM = {"thumb": 3.0, "index": 5.0, "middle": 6.5, "ring": 6.8, "little": 9.0}

Row = dict[str, Any]


@dataclass(frozen=True)
class MadeStudy:
    """A study file and the folder of its results."""

    file: Path
    folder: Path

    @cached_property
    def study(self) -> Study:
        """The study read from its file."""
        return read_study(self.file)

    @cached_property
    def paths(self) -> Results:
        """Paths of the study's results."""
        return Results(self.folder)

    @cached_property
    def results(self) -> StudyResults:
        """The study-wide tables, read."""
        return read_results(self.study, self.folder)

    @cached_property
    def pages(self) -> dict[Path, str]:
        """The study's page and its subjects' pages, by path."""
        of_subjects = {
            self.paths.subject_page(s): render_subject(self.subject(s)) for s in self.study.subjects
        }
        return {self.paths.report: render_study(self.results, self.study), **of_subjects}

    def subject(self, subject: str = "S01", *models: str) -> StudyResults:
        """Return a subject's results under the given models, by default all."""
        results = read_subject(read_plan(self.paths.plan(subject)))
        return replace(results, models={name: results.models[name] for name in models or results.models})

    def recording(self, subject: str = "S01", hand: str = "right") -> Recording:
        """Return a hand's evaluated recording."""
        return next(r for r in self.study.shown if (r.hand.subject, r.hand.hand) == (subject, hand))

    def recording_results(self, subject: str = "S01", hand: str = "right", *models: str) -> RecordingResults:
        """Return the results from which a recording's page is made."""
        return read_recording(self.subject(subject, *models), self.recording(subject, hand))

    def motion(self, hand: str, *models: str) -> HandMotion:
        """Return the motion of a hand of S01 under the given models."""
        results = self.recording_results("S01", hand, *models)
        assert results.motion is not None, (results.trouble, results.left_out)
        return results.motion

    def rows(self, table: Table, model: str, **wanted: Any) -> list[Row]:
        """Return the rows of S01's right hand under a model whose columns have the wanted values."""
        wanted |= {"hand": "right", "model": model}
        plan = read_plan(self.paths.plan("S01"))
        read = typed_table.read_table(plan.table(table.name, "right", model), table)
        return rows_where(typed_table.rows_of(read), **wanted)


@cache
def exact_hand(hand: str, n_frames: int) -> tuple[Simulated, dict[str, list[Row]]]:
    """Return an exact recording of opposition, and the rows of its tables of truth by name."""
    simulated = simulate(RecordingName("", hand, "opposition"), 7, Realism.exact(), n_frames)
    with TemporaryDirectory() as folder:
        write_truth(Path(folder), simulated, NO_SOURCE)
        files = {name: Path(folder, f"{name}.parquet") for name in ("joint_centres", "bone_lengths")}
        tables = {name: typed_table.read_table(file, TABLES[name]) for name, file in files.items()}
    return simulated, {name: list(typed_table.rows_of(table)) for name, table in tables.items()}


def make_study(
    folder: Path,
    *,
    subjects: Sequence[str] = ("S01", HOSTILE),
    models: Sequence[str] = PAPERS,
    n_frames: int = 20,
    simulated: bool = False,
    spoiled: tuple[str, str] = ("S01", "left"),
) -> MadeStudy:
    """Write a study and its results; tables of model comparisons stay empty until `compare_study` is
    called.
    """
    sample = MadeStudy(folder / "study.yaml", folder / "results" / "made")
    second = folder / f"{SECOND_FIT}.yaml"
    if SECOND_FIT in models:
        shipped = Path("config/models/whole-hand.yaml").read_text("utf-8")
        write_text(second, shipped.replace("model: whole-hand", f"model: {SECOND_FIT}"))
    roles = {"opposition": "both", **({"rom": "calibration"} if simulated else {})}
    lines = [
        f"{subject}\t{hand}\t{task}\t{role}\t{task}-{path_token(subject)}-{hand}.csv"
        for subject in subjects
        for hand in ("right", "left")
        for task, role in roles.items()
    ]
    write_text(folder / "sheet.tsv", "\n".join(["subject\thand\ttask\trole\tfile", *lines]) + "\n")
    names = ", ".join(str(second) if name == SECOND_FIT else name for name in models)
    more = "simulation: {folder: ., seed: 1}\n" if simulated else ""
    text = f"study: made\nrecordings: sheet.tsv\nlayout: liberty16\nmodels: [{names}]\nexports: [bvh]\n{more}"
    write_text(sample.file, text)
    plans = StudyPlans(sample.study, sample.folder)
    for subject in subjects:
        write_text(sample.paths.plan(subject), plan_text(plans.content(subject)))
        failed = "left" if len(subjects) > 1 and subject == subjects[-1] else ""
        _write_subject(read_plan(sample.paths.plan(subject)), n_frames, simulated, failed, spoiled)
    gather_study(sample.study, sample.paths)
    for name in MODEL_COMPARISONS:
        write(sample.paths.study_table(name), TABLES[name], [])
    return sample


def write(path: Path, table: Table, rows: Sequence[Row]) -> None:
    """Write rows as a table of the study; text columns that a row lacks are empty."""
    columns = typed_table.columns_from_rows(table, [lacking_text(table) | row for row in rows])
    typed_table.write_table(path, table, columns, NO_SOURCE)


def lacking_text(table: Table) -> dict[str, str]:
    """Return an empty string for every text column, by name."""
    return {column.name: "" for column in table.columns if column.type == pa.string()}


def _write_subject(
    plan: SubjectPlan, n_frames: int, simulated: bool, failed: str, spoiled: tuple[str, str]
) -> None:
    """Write a subject's tables. failed : the hand whose recordings could not be read, or empty."""
    names = (*GATHERED_TABLES, "joint_solutions", "length_pulls")
    rows: dict[str, dict[Part, list[Row]]] = {name: {} for name in names}
    with parts_writer(plan.table("tips"), TABLES["tips"], NO_SOURCE) as tips:
        for recording in plan.recordings:
            hand, key = recording.hand.hand, recording.key
            if hand == failed:
                message = f"{recording.source.file_as_written}: row 7, column x_mm: 'n/a' is <not> a number"
                typed_table.write_failure(plan.poses(recording), POSES, message, Provenance((), key))
                continue
            recorded = exact_hand(hand, n_frames)[0].take(np.arange(n_frames))
            recorded.valid[UNSEEN, recorded.index("index_distal")] = False
            write_poses(plan.poses(recording), recorded, hand, recording.task, plan.who.subject)
            if recording.role == "calibration":
                continue
            bad = (plan.who.subject, hand) == spoiled
            scores = score_rows(key, [*plan.models.values()], simulated=simulated, spoiled=bad)
            rows["skeleton_scores"][plan.part(hand)] = scores
            rows["movement_cycles"][plan.part(hand)] = [
                key | {"event": "tap", "cycle": n, "onset_s": 0.3 * n, "duration_s": 0.3, "used": True}
                for n in range(3 if hand == "right" else 0)
            ]
            errors = joint_error_rows([*plan.models], spoiled=bad) if simulated else []
            rows["joint_errors"][plan.part(hand)] = errors
            for part in (part for part in plan.whole_parts if part.hand == hand):
                model = plan.models[part.model]
                joints, bones = _skeleton_rows(part, model, n_frames, spoiled=bad)
                rows["joint_centres"][part], rows["bone_lengths"][part] = joints, bones
                rows["joint_solutions"][part] = [
                    {name: row[name] for name in ("joint", "parent_segment", "child_segment", "status")}
                    | {"n_frames": 300, "singular_values": [1.41, 1.40, 1.39, 0.15 + n / 100, 0.14, 0.0321]}
                    for n, row in enumerate(joints)
                    if row["parent_segment"] and row["status"] != "failed"
                ]
                error_mm = _tip_errors_mm(model, n_frames, spoiled=bad)
                rows["tip_errors"][part] = list(_tip_error_rows(key, error_mm, spoiled=bad))
                _write_long(tips, part, key, DIGITS, n_frames, error_mm=error_mm)
                if model.fitting is not None:
                    rows["receivers"][part] = receiver_rows(spoiled=bad)
                    rows["gains"][part] = gain_rows()
                    rows["length_pulls"][part] = pull_rows(part.hand)
                    rows["cycle_curves"][part] = cycle_rows(key, part)
                    _write_fit(plan, part, key, n_frames, error_mm)
    columns = typed_table.columns_from_rows(FINDINGS, [])
    typed_table.write_table(plan.table("findings"), FINDINGS, columns, Provenance((), {"digests": {}}))
    for name, of_parts in rows.items():
        table = TABLES[name]
        for path in plan.files_of(name):
            with parts_writer(path, table, NO_SOURCE) as writer:
                for part, part_rows in of_parts.items():
                    if name not in FIT_TABLES or path == plan.table(name, part.hand, part.model):
                        texts = {k: v for k, v in lacking_text(table).items() if k not in vars(part)}
                        writer.rows(part, [texts | row for row in part_rows])


def cycle_rows(key: dict[str, str], part: Part) -> list[Row]:
    """Return rows of cycle_curves of a right hand's fingers: three cycles, but two from 40 to 50 %."""
    joints = [name for name in LAYOUT.joints if name.endswith(("_mcp", "_pip")) and part.hand == "right"]
    return [
        key
        | {"event": "tap", "joint": joint, "angle": angle.removesuffix("_deg"), "cycle_percent": percent}
        | {"mean_deg": 10.0 * n + 20 * np.sin(percent / 16 + level), "sd_deg": 2.0 + n}
        | {"n_cycles": 2 if 40 <= percent < 50 else 3}
        for level, joint in enumerate(joints)
        for n, angle in enumerate(ANGLES)
        for percent in range(101)
    ]


def _skeleton_rows(
    part: Part, model: SkeletonModel, n_frames: int, *, spoiled: bool
) -> tuple[list[Row], list[Row]]:
    """Return rows of joint_centres and bone_lengths: the true values with stated errors."""
    truth = exact_hand(part.hand, n_frames)[1]
    of_model = vars(part) | {"source": "fit", "message": ""}
    of_model |= {"sd_mm": 1.234, "range_deg": 41.23, "gap_rms_mm": 0.715, "axis_plane_deg": 78.9}
    numbers = [c.name for c in JOINT_CENTRES.columns if c.nullable and c.type == pa.float64()]
    unseen, joints = dict.fromkeys(numbers), list[Row]()
    rows = {row["joint"]: row for row in truth["joint_centres"]}
    for name in (*rows, *(name for name in model.own_cmc if name not in rows)):
        if name not in rows:  # the CMC joint of a finger, which no receiver measures
            base = rows[name.replace("cmc", "mcp")]
            on_hand = {column: 0.2 * base[column] for column in numbers if column.startswith("parent_")}
            row = base | of_model | unseen | on_hand
            joints.append(
                judged_joint(
                    row | {"joint": name, "child_segment": LAYOUT.joints[name].child}, LAYOUT.wanted_mm
                )
            )
            continue
        row = rows[name] | of_model
        if spoiled and name == "ring_dip":
            row |= unseen | {"status": "failed", "message": "too few frames (3)"}
        if spoiled and name == "little_dip":
            moved = (0.0, 0.0, 0.0) if model.planes.corrections else (40.0, -300.0, 60.0)
            for column in (f"{side}_{axis}_mm" for side in ("parent", "child") for axis in "xyz"):
                row[column] += moved["xyz".index(column[-4])]
            row |= note_doubts({AXIS_IN_PLANE: {"axis_plane_deg": 4.0, "slide_mm": 59.0}})
            row |= {"status": "weak", "axis_plane_deg": 4.0, "sd_mm": 9.876}
        joints.append(judged_joint(row, LAYOUT.wanted_mm))
    by_name, bones = {row["joint"]: row for row in joints}, []
    for row in truth["bone_lengths"]:
        row = row | vars(part) | {"sd_mm": 0.456}
        if model.fitting is None and row["bone"].endswith("_distal"):
            row["ends_at"] = DISTAL_RECEIVER
        bones.append(judged_bone(row, by_name, LAYOUT.wanted_mm, is_whole=is_whole(row, LAYOUT)))
    return joints, bones


def _tip_errors_mm(model: SkeletonModel, n_frames: int, *, spoiled: bool) -> np.ndarray:
    """Return errors (T, 5) of the replay in mm: smooth and small, but gross if the little DIP joint is
    off.
    """
    level = np.array([*LEVELS_MM.values()])
    level[4] *= 15.0 if spoiled and not model.planes.corrections else 1.0
    level[1:] *= 20.0 if model.metacarpals.unmeasured == "rest" else 1.0
    time_s = np.arange(n_frames)[:, None] / 240
    error = level * np.abs(1 + 0.4 * np.sin(1.7 * time_s + np.arange(5)) + 0.1 * np.sin(9 * time_s))
    error[UNSEEN, 1] = np.nan
    error[:, 3] *= np.nan if spoiled else 1.0
    if model.fitting is not None:
        error[PEAK_FRAME:][:1] += 40.0
    return np.asarray(error + 0.5 * (model.name == SECOND_FIT))


def _tip_error_rows(key: dict[str, str], error_mm: np.ndarray, *, spoiled: bool) -> Iterator[Row]:
    for digit, errors in zip(DIGITS, error_mm.T, strict=True):
        for binding, values in (("first-frame", np.abs(errors - errors[0])), ("least-squares", errors)):
            row = key | {"digit": digit, "binding": binding, "held_out": False, "n_frames_total": len(errors)}
            if spoiled and digit == "ring":
                yield row | {"n_frames": 0, "message": "joint ring_dip failed"}
                continue
            finite = values[np.isfinite(values)]
            row |= {f"{name}_mm": getattr(finite, name)() for name in ("max", "min", "mean")}
            row |= {
                "sd_mm": finite.std(),
                "p95_mm": np.quantile(finite, 0.95),
                "median_mm": np.median(finite),
            }
            yield row | {"n_frames": len(finite)}


def _write_fit(
    plan: SubjectPlan, part: Part, key: dict[str, str], n_frames: int, error_mm: np.ndarray
) -> None:
    """Write the fit's tables of all frames: true bones and tips, and joint angles, with the index finger's
    gap.
    """
    truth = exact_hand(part.hand, n_frames)[0].truth
    bone_mm = truth.bone_position_mm.copy()
    bone_mm[UNSEEN, BONES.index("index_middle")] = np.nan
    joints = [name for name in LAYOUT.joints if name != "wrist"]
    frame, joint = np.ogrid[:n_frames, : len(joints)]
    shift_deg = 3.0 * (part.model == SECOND_FIT)
    turns = (20 + joint + 30 * np.sin(frame / 25 + joint), shift_deg - 3 + joint / 7 * np.cos(frame / 9))
    angle_deg = np.stack(np.broadcast_arrays(*turns, -frame / 31), -1)
    angle_deg[UNSEEN, [name.startswith("index") for name in joints]] = np.nan
    sds = {f"{name[:-4]}_sd_deg": 2.0 + n + 0.0 * angle_deg[..., n] for n, name in enumerate(ANGLES)}
    for name, of, numbers in (
        ("bone_poses", BONES, _by_axis("{}_mm", bone_mm)),
        ("posed_tips", DIGITS, _by_axis("tip_{}_mm", truth.tip_mm) | {"error_mm": error_mm - 0.25}),
        ("joint_angles", joints, dict(zip(ANGLES, np.moveaxis(angle_deg, -1, 0), strict=True)) | sds),
    ):
        with parts_writer(plan.table(name, part.hand, part.model), TABLES[name], NO_SOURCE) as writer:
            elsewhere = {column: values + 1000.0 for column, values in numbers.items()}
            _write_long(writer, part, key | {"task": "rom"}, of, n_frames, **elsewhere)
            _write_long(writer, part, key, of, n_frames, **numbers)


def _by_axis(name: str, position_mm: np.ndarray) -> dict[str, np.ndarray]:
    return {name.format(axis): position_mm[..., i] for i, axis in enumerate("xyz")}


def _write_long(
    writer: Any, part: Part, key: dict[str, str], of: Sequence[str], n_frames: int, **numbers: np.ndarray
) -> None:
    """Write numbers (T, N) of a recording, a row per frame and joint, segment or digit `of`; the rest is
    null.
    """
    table: Table = writer._table
    recorded = exact_hand(part.hand, n_frames)[0]
    columns: dict[str, Any] = {c.name: np.full(n_frames * len(of), np.nan) for c in table.columns}
    columns |= lacking_text(table) | vars(part) | {"task": key["task"]}
    columns |= {name: np.tile(getattr(recorded, name), len(of)) for name in ("frame", "time_s")}
    columns[next(name for name in ("digit", "segment", "joint") if name in columns)] = np.repeat(of, n_frames)
    columns |= {name: values.T.ravel() for name, values in numbers.items()}
    writer.columns(part, {column.name: columns[column.name] for column in table.columns})


SCORES = ("replay_mean_mm", "posed_mean_mm", "left_out_mean_mm", "wrist_mcp_sd_mm")
TRUE_SCORES = ("metacarpal_deg", "true_tip_mean_mm")


def score_rows(
    key: dict[str, str], models: Sequence[SkeletonModel], *, simulated: bool, spoiled: bool
) -> list[Row]:
    """Return rows of skeleton_scores: in-sample skeletons, held-out ones if there is a truth, and
    references.
    """
    skeletons: list[tuple[str, str, bool, bool, list[float | None]]] = []
    for rank, model in enumerate(models):
        base = 0.7 + 0.1 * rank
        means = [base, 0.3, 0.5, 0.9, 2.0, 1.5] if model.fitting else [base, None, base, 0.9, 9.0, 10.0]
        skeletons.append((model.name, "opposition", False, False, means))
        if simulated:
            worse = [None if value is None else value + 0.25 for value in means[:4]] + means[4:]
            skeletons.append((model.name, "rom", True, False, worse))
    skeletons.append(("prior-only", "", True, True, [None, 3.2, 5.6, 1.0, 8.7, 3.9]))
    skeletons.append(("distal-receiver", "", True, True, [0.0, None, None, None, None, 10.3]))
    if simulated:
        skeletons.append(("true-skeleton", "", True, True, [1.17, None, 1.17, 0.9, 0.0, 0.4]))
    rows = []
    for *who, means in skeletons:
        for index, digit in enumerate(DIGITS):
            row = {**key, "digit": digit, "n_frames": 300, "message": ""}
            row |= dict(zip(("model", "calibrated_on", "held_out", "reference"), who, strict=True))
            rows.append(row)
            if spoiled and digit == "ring" and not who[3]:
                row |= {"n_frames": 0, "message": "joint ring_dip failed"}
                continue
            for name, value in zip((*SCORES, *(TRUE_SCORES if simulated else ())), means, strict=False):
                row[name] = None if value is None else value * (1 + 0.1 * index)
                if name.endswith("_mean_mm") and name != "posed_mean_mm":
                    row[name.replace("mean", "p95")] = None if value is None else 2 * row[name]
    return rows


def joint_error_rows(models: Sequence[str], *, spoiled: bool) -> list[Row]:
    """Return rows of joint_errors: each model made from each task, and prior-only without stated errors."""
    rows: list[Row] = []
    optional = {name for name, segment in LAYOUT.segments.items() if segment.optional}
    seen = [each.name for each in LAYOUT.solvable if not {each.parent_receiver, each.child} & optional]
    skeletons = [(model, tasks) for model in models for tasks in ("opposition", "rom")]
    for name, tasks in [*skeletons, ("prior-only", "")]:
        for index, joint in enumerate(seen):
            row = {"model": name, "calibrated_on": tasks, "joint": joint, "bone": ""}
            error = (0.12 if name == "whole-hand" else 0.6) * (index + 1)
            if not (spoiled and joint == "ring_dip"):
                row |= {"error_mm": error, "along_mm": 0.8 * error, "across_mm": -0.6 * error}
                row |= {"parent_error_mm": error, "bone": joint, "bone_error_percent": -error}
                row |= {"axis_deg": 2 * error if LAYOUT.joints[joint].dof == 1 else None}
                row |= {} if name == "prior-only" else {"within_95": error < 5, "parent_within_95": error < 2}
                row |= {} if name == "prior-only" else {"sd_mm": 1.0}
            rows.append(row)
    return rows


def receiver_rows(*, spoiled: bool) -> list[Row]:
    """Return rows of receivers, one loose on the spoiled hand."""
    rows: list[Row] = []
    for segment in LAYOUT.measured:
        row = {"segment": segment, "status": "ok", "residual_mm": 0.3, "residual_deg": 0.4}
        row |= {f"{name}_mm": 12.34 for name in ("along", "lateral", "height")}
        row |= {f"{name}_sd_mm": 0.56 for name in ("along", "lateral", "height")}
        if segment.endswith("_distal"):
            row |= {"soft_tip_sd_mm": 2.57, "bone_tip_sd_mm": 2.5}
        if spoiled and segment == "ring_middle":
            row |= {"loose_from_frame": 123, "loose_task": "opposition", "loose_shift_mm": 3.21}
            row |= {
                "loose_kind": "step",
                "loose_turn_deg": 4.32,
                "status": "weak",
                "message": "it came loose",
            }
        rows.append(row)
    return rows


def gain_rows() -> list[Row]:
    """Return rows of gains, best first; the sixth and last must not be reported."""
    quantities = ("middle_proximal.lateral", "ring.touch", "ring_middle.along", "index_distal")
    rows: list[Row] = []
    for index, quantity in enumerate((*quantities, "thumb_proximal.height", "little_middle.distal")):
        digit = quantity.replace(".", "_").split("_")[0]
        joint = {"joint": f"{digit}_mcp", "joint_sd_before_mm": 1.94, "joint_sd_after_mm": 1.03}
        means = {"mean_sd_before_mm": 1.26, "mean_sd_after_mm": 1.21 + 0.01 * index}
        rows.append({"quantity": quantity, "sd_mm": 0.4, **means, **joint})
    return rows


def pull_rows(hand: str) -> list[Row]:
    """Return rows of length_pulls of two bones that are 1.5 and 3 mm longer on the left hand."""
    length = {"index_middle": 24.0, "index_proximal": 42.0}
    more = {"index_middle": 1.5, "index_proximal": 3.0}
    return [
        {
            "bone": bone,
            "unknown": f"{bone} length",
            "group": "length",
            "pull_mm": 0.6,
            "alone_mm": mm + (more[bone] if hand == "left" else 0.0),
            "alone_sd_mm": 1.0,
        }
        for bone, mm in length.items()
    ]


FIRST = "S001"
SCALED = ("skeleton_scores", "joint_errors", "bone_lengths")


def many_subjects(
    folder: Path, n_subjects: int, models: Sequence[str] = FITTED_MODELS, *, simulated: bool = True
) -> MadeStudy:
    """Write a study whose subjects are scaled copies of one; only the first has tables of its own."""
    sample = make_study(folder, models=models, subjects=(FIRST,), simulated=simulated)
    rng = np.random.default_rng(3)
    names = [f"S{index + 1:03}" for index in range(n_subjects)]
    header, *lines = (folder / "sheet.tsv").read_text("utf-8").splitlines()
    sheet = [header, *(line.replace(FIRST, name) for name in names for line in lines)]
    write_text(folder / "sheet.tsv", "\n".join(sheet) + "\n")
    factors = {(name, model): rng.lognormal(0.0, 0.2) for name in names for model in models}
    for name in STUDY_TABLES:
        table, path = TABLES[name], sample.paths.study_table(name)
        scaled = [
            column.name
            for column in table.columns
            if name in SCALED and column.name.endswith("_mm") and pa.types.is_floating(column.type)
        ]
        repeated = []
        rows = typed_table.read_table(path, table).to_pylist()
        for subject in names:
            for row in rows:
                factor = factors.get((subject, row.get("model", "")), 1.0)
                numbers = {column: factor * row[column] for column in scaled if row[column] is not None}
                repeated.append(row | {"subject": subject} | numbers)
        write(path, table, repeated)
    many = MadeStudy(sample.file, sample.folder)
    compare_study(many.study, many.paths)
    return many


def compared(results: StudyResults) -> StudyResults:
    """Return the results with their models compared again, with all columns of the tables."""
    models = compare_models(scored_study(results))
    empty = dict.fromkeys(("interval_95_low", "interval_95_high", "effect_size", "p"))
    differences = [empty | row for row in models.differences]
    return results.with_rows(model_values=models.values, model_differences=differences)


def scored_study(results: StudyResults) -> ScoredStudy:
    """Return the tables of these results that the comparison stage reads."""
    tables = {
        "skeleton_scores": results.counted(results.rows.skeleton_scores),
        "joint_errors": results.counted(results.rows.joint_errors),
        "recordings": results.rows.recordings,
    }
    frames = [
        pd.DataFrame.from_records(rows, columns=[column.name for column in TABLES[name].columns])
        for name, rows in tables.items()
    ]
    return ScoredStudy(tuple(results.subjects), results.models, results.layouts, *frames)
