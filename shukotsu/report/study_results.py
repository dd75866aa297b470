"""Input of the report: a study or one of its subjects, with the rows of its short tables."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import pyarrow as pa

from shukotsu.errors import InputError
from shukotsu.hand.known_digits import leading_model
from shukotsu.study.findings import REFUSED, STAGE, SUSPECT, finding_of_text, problem_row
from shukotsu.study.layout import Layout
from shukotsu.study.model import SkeletonModel, read_model
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.recording_summary import subject_tables
from shukotsu.study.results import FAILED_PAGES, Results, table_in
from shukotsu.study.study import HasRecordings, Recording, Study
from shukotsu.tables.catalogue import RECORDINGS, TABLES, TIP_ERRORS
from shukotsu.tables.parts import Opened, Part, open_parts
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.typed_table import Table, key_of, read_metadata, read_table, rows_of
from shukotsu.translation import tr

if TYPE_CHECKING:
    from shukotsu.tables import rows as row_types

HandModel = tuple[Hand, str]
RowType = TypeVar("RowType", bound=Mapping[str, Any])

FIRST_FRAME, LEAST_SQUARES = "first-frame", "least-squares"
HANDS = ("right", "left")


@dataclass(frozen=True)
class StudyRows:
    """Rows of the study's tables that pages use, by table; null values are None.

    In tables with the key `made_without`, only rows of skeletons made from all tasks are included.
    """

    recordings: list[row_types.RecordingsRow]
    problems: list[row_types.ProblemsRow]
    joint_centres: list[row_types.JointCentresRow]
    bone_lengths: list[row_types.BoneLengthsRow]
    tip_errors: list[row_types.TipErrorsRow]
    skeleton_scores: list[row_types.SkeletonScoresRow]
    joint_errors: list[row_types.JointErrorsRow]
    receivers: list[row_types.ReceiversRow]
    gains: list[row_types.GainsRow]
    agreement: list[row_types.AgreementRow]
    model_values: list[row_types.ModelValuesRow]
    model_differences: list[row_types.ModelDifferencesRow]


TABLES_READ = [field.name for field in fields(StudyRows)]


@dataclass(frozen=True)
class Trial:
    """One subject's evaluated task, with its recordings by hand, the right one first as in the paper."""

    who: SubjectSession
    task: str
    trial: str
    recordings: dict[str, Recording]

    @property
    def title(self) -> str:
        """Task and trial in words."""
        return task_title(self.task, self.trial)


def by_hand_and_model(rows: Iterable[RowType]) -> dict[HandModel, list[RowType]]:
    """Group rows by hand and model, in the table's order."""
    groups: dict[HandModel, list[RowType]] = defaultdict(list)
    for row in rows:
        groups[hand_of(row), row["model"]].append(row)
    return dict(groups)


@dataclass(frozen=True)
class StudyResults(HasRecordings):
    """A study, or one subject's part of it, with its results."""

    name: str
    recordings: tuple[Recording, ...]
    simulated: bool
    paths: Results
    models: Mapping[str, SkeletonModel]
    layouts: Mapping[Hand, Layout]
    rows: StudyRows
    opened: Opened = open_parts

    @property
    def has_sessions(self) -> bool:
        """Whether the recordings sheet names any session."""
        return any(who.session for who in self.sessions)

    @cached_property
    def shown(self) -> list[Recording]:
        """All recordings that are not excluded; each has a page."""
        return [r for r in self.recordings if not r.exclude]

    def poses(self, recording: Recording) -> Path:
        """Return the file of a recording's poses table."""
        return self.paths.folder / recording.hand.folder / recording.name / "poses.parquet"

    def subject_table(self, hand: Hand, table: str, model: str = "") -> Path:
        """Return the file of a subject's table, or, for FIT_TABLES, of the hand and model."""
        return table_in(self.paths.subject(*hand.who), table, hand.hand, model)

    @cached_property
    def suspect(self) -> frozenset[Hand]:
        """Hands with a suspect finding; they are shown but excluded from all statistics."""
        return frozenset(map(hand_of, self.suspect_rows))

    @cached_property
    def suspect_rows(self) -> list[row_types.ProblemsRow]:
        """Findings that make a hand suspect."""
        return [row for row in self.rows.problems if row["severity"] == SUSPECT]

    def counted(self, rows: list[RowType]) -> list[RowType]:
        """Return the rows of hands that are not suspect, which statistics include."""
        return [row for row in rows if hand_of(row) not in self.suspect]

    def with_rows(self, **rows: list[Any]) -> StudyResults:
        """Return these results with the rows of the named tables replaced."""
        return replace(self, rows=replace(self.rows, **rows))

    @cached_property
    def judging(self) -> StudyResults:
        """These results without the rows of suspect hands."""
        tables = ("joint_centres", "bone_lengths", "tip_errors", "skeleton_scores", "joint_errors")
        counted: dict[str, Any] = {name: self.counted(getattr(self.rows, name)) for name in tables}
        return self.with_rows(**counted)

    @cached_property
    def findings(self) -> list[row_types.ProblemsRow]:
        """Problems that make recordings suspect, or for which recordings are refused, without notes."""
        stages = (STAGE, "capture")
        return [
            row
            for row in self.rows.problems
            if row["severity"] == SUSPECT or (row["severity"] == REFUSED and row["stage"] in stages)
        ]

    @cached_property
    def accepted(self) -> list[row_types.ProblemsRow]:
        """Findings that the recordings sheet accepts with a reason."""
        return [row for row in self.rows.problems if row["accepted"]]

    def hand_rows(self, table: Table, hand: Hand, model: str = "") -> list[Any]:
        """Return a hand's rows, under a model, of a subject's short table; none if it cannot be read."""
        path = self.subject_table(hand, table.name)
        try:
            with self.opened(path, table) as parts:
                return parts.rows(Part(hand.hand, model, "", *hand.who))
        except InputError:
            return []

    def recording_rows(self, table: Table, recording: Recording, model: str = "") -> list[Any]:
        """Return a recording's rows, under a model, of a subject's short table; none if it cannot be read."""
        key = recording_key(recording)
        return [row for row in self.hand_rows(table, recording.hand, model) if row_key(row) == key]

    def add_problem(self, message: str) -> None:
        """Add a problem that occurred while the page is made; call it before problems are listed."""
        self.rows.problems.append(_problem(SubjectSession(""), "report", message))

    @cached_property
    def joints_of(self) -> dict[HandModel, list[row_types.JointCentresRow]]:
        """Rows of joints by hand and model."""
        return by_hand_and_model(self.rows.joint_centres)

    @cached_property
    def bones_of(self) -> dict[HandModel, list[row_types.BoneLengthsRow]]:
        """Rows of bones by hand and model."""
        return by_hand_and_model(self.rows.bone_lengths)

    @cached_property
    def receivers_of(self) -> dict[HandModel, list[row_types.ReceiversRow]]:
        """Rows of receivers by hand and model."""
        return by_hand_and_model(self.rows.receivers)

    @cached_property
    def gains_of(self) -> dict[HandModel, list[row_types.GainsRow]]:
        """Rows of gains by hand and model."""
        return by_hand_and_model(self.rows.gains)

    @property
    def fitted(self) -> list[str]:
        """Models that fit the whole hand, in the study's order."""
        return [name for name, model in self.models.items() if model.fitting is not None]

    @property
    def leading(self) -> str:
        """The model that pages show first."""
        return leading_model(self.models, self.layouts.values())

    @cached_property
    def _tip_error_of(self) -> dict[tuple[str, ...], row_types.TipErrorsRow]:
        key = [name for name in TIP_ERRORS.key if name != "made_without"]
        return {key_of(row, key): row for row in self.rows.tip_errors}

    @cached_property
    def recording_row_of(self) -> dict[tuple[str, ...], row_types.RecordingsRow]:
        """Rows of the recordings table by subject, session, hand, task and trial."""
        return {row_key(row): row for row in self.rows.recordings}

    def tip_error(
        self, recording: Recording, model: str, digit: str, binding: str
    ) -> row_types.TipErrorsRow | None:
        """Return the row of tip_errors for a recording, model, digit and binding, or None."""
        return self._tip_error_of.get((*recording_key(recording), model, digit, binding))

    def status_of(self, recording: Recording) -> tuple[str, str]:
        """Return a recording's status (used, excluded, refused, failed or missing) and the reason, if any."""
        row = self.recording_row_of.get(recording_key(recording))
        if row is not None:
            return row["status"], row["message"] or recording.exclude
        if recording.exclude:
            return "excluded", recording.exclude
        return "missing", "the results do not name this recording"

    def trials(self, subject: str, session: str = "") -> Iterator[Trial]:
        """Yield the subject's evaluated tasks, with excluded and failed recordings, in the sheet's order."""
        groups: dict[tuple[str, str], dict[str, Recording]] = defaultdict(dict)
        for recording in self.recordings:
            if recording.hand.who == (subject, session) and recording.role in ("evaluation", "both"):
                groups[recording.task, recording.trial][recording.hand.hand] = recording
        for (task, trial), by_hand in groups.items():
            recordings = {hand: by_hand[hand] for hand in HANDS if hand in by_hand}
            yield Trial(SubjectSession(subject, session), task, trial, recordings)

    def hands_of(self, subject: str, session: str = "") -> list[Hand]:
        """Return the subject's hands, the right one first."""
        mine = [hand for hand in self.hands if hand.who == (subject, session)]
        return sorted(mine, key=lambda hand: hand.hand != "right")


def task_title(task: str, trial: str = "", *, calibrates: bool = False) -> str:
    """Return task and trial in words; calibrates : whether the recording is used for calibration only."""
    words = [task, tr("trial {trial}", trial=trial) if trial else "", tr("calibration") if calibrates else ""]
    return ", ".join(filter(None, words))


def recording_key(recording: Recording) -> tuple[str, ...]:
    """Return a recording's key in tables: subject, session, hand, task and trial."""
    return tuple(recording.key.values())


def row_key(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the subject, session, hand, task and trial of a table's row."""
    return key_of(row, RECORDINGS.key)


def hand_of(row: Mapping[str, Any]) -> Hand:
    """Return the hand that a table's row is about."""
    return Hand(row["subject"], row["hand"], row["session"])


def read_results(study: Study, folder: Path) -> StudyResults:
    """Read the study's tables from `folder`.

    A table whose stage failed is treated as empty, and the reason is added to the problems. Raises InputError
    if a table is missing or a file is not the expected table.
    """
    paths = Results(folder)
    failures: list[row_types.ProblemsRow] = []
    rows: dict[str, Any] = {
        name: _study_rows(paths.study_table(name), TABLES[name], failures) for name in TABLES_READ
    }
    rows["problems"] += [*failures, *_failed_files(study, paths)]
    return StudyResults(
        name=study.name,
        recordings=study.recordings,
        simulated=study.simulation is not None,
        paths=paths,
        models={name: read_model(path.absolute()) for name, path in study.models.items()},
        layouts={hand: study.judged_layout(hand) for hand in study.hands},
        rows=StudyRows(**rows),
    )


def read_subject(plan: SubjectPlan, opened: Opened = open_parts) -> StudyResults:
    """Read one subject's tables as the results of a study of this subject only.

    A part that failed is added to the problems. Raises InputError if a table is missing or a file is not the
    expected table.
    """
    gathered = subject_tables(plan)
    rows: dict[str, Any] = {name: [] for name in TABLES_READ}
    rows |= {"recordings": gathered.recordings, "problems": gathered.problems}
    for name in rows.keys() & gathered.tables.keys():
        rows[name] = list(rows_of(gathered.tables[name].select(_columns_shown(TABLES[name]))))
    return StudyResults(
        name=plan.study,
        recordings=plan.recordings,
        simulated=any(recording.truth is not None for recording in plan.recordings),
        paths=Results(plan.folder.parent),
        models=plan.models,
        layouts={plan.hand(hand): layout for hand, layout in plan.layouts.items()},
        rows=StudyRows(**rows),
        opened=opened,
    )


def _failed_files(study: Study, paths: Results) -> Iterator[row_types.ProblemsRow]:
    """Yield a problem for each export and then for each subject's page that could not be made."""
    for file in sorted(paths.exports.glob("*.failed.txt")) if study.exports else ():
        for message in file.read_text("utf-8").splitlines():
            task = file.name.removesuffix(".failed.txt")
            yield _problem(SubjectSession(""), "export", message, task=task)
    for who in study.sessions:
        file = paths.subject_pages(*who) / FAILED_PAGES
        for line in file.read_text("utf-8").splitlines() if file.is_file() else ():
            page, _, message = line.partition(": ")
            yield _problem(who, "subject_pages", message, task=page)


def _problem(who: SubjectSession, stage: str, message: str, **where: str) -> row_types.ProblemsRow:
    return problem_row(stage, finding_of_text("", REFUSED, message), **who._asdict(), **where)


def _study_rows(path: Path, table: Table, failures: list[row_types.ProblemsRow]) -> list[Any]:
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a {table.name} table")
    failure = read_metadata(path).get("failure")
    if failure is not None:
        failures.append(_problem(SubjectSession(""), "report", f"{path.name}: {failure}"))
        return []
    return list(rows_of(read_table(path, table, _columns_shown(table))))


def _columns_shown(table: Table) -> list[str]:
    """Return the columns to read: all except lists, which pages never show and which are slow to read."""
    return [column.name for column in table.columns if not pa.types.is_fixed_size_list(column.type)]
