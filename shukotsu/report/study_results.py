"""Read the report's input: a study, or one subject of it, with the short tables of its hands."""

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
from shukotsu.study.study import OfRecordings, Recording, Study
from shukotsu.tables.catalogue import RECORDINGS, TABLES, TIP_ERRORS
from shukotsu.tables.parts import Opened, Part, open_parts
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.typed_table import Table, key_of, read_metadata, read_table, rows_of
from shukotsu.translation import tr

if TYPE_CHECKING:
    from shukotsu.tables.rows import (
        AgreementRow,
        BoneLengthsRow,
        GainsRow,
        JointCentresRow,
        JointErrorsRow,
        ModelDifferencesRow,
        ModelValuesRow,
        ProblemsRow,
        ReceiversRow,
        RecordingsRow,
        SkeletonScoresRow,
        TipErrorsRow,
    )

HandModel = tuple[Hand, str]
RowType = TypeVar("RowType", bound=Mapping[str, Any])

FIRST_FRAME, LEAST_SQUARES = "first-frame", "least-squares"
HANDS = ("right", "left")


@dataclass(frozen=True)
class StudyRows:
    """Rows of the study's tables that pages read, by table; null is None.

    Those of tables that are keyed so are of whole skeletons, made without leaving out a task.
    """

    recordings: list[RecordingsRow]
    problems: list[ProblemsRow]
    joint_centres: list[JointCentresRow]
    bone_lengths: list[BoneLengthsRow]
    tip_errors: list[TipErrorsRow]
    skeleton_scores: list[SkeletonScoresRow]
    joint_errors: list[JointErrorsRow]
    receivers: list[ReceiversRow]
    gains: list[GainsRow]
    agreement: list[AgreementRow]
    model_values: list[ModelValuesRow]
    model_differences: list[ModelDifferencesRow]


TABLES_READ = [field.name for field in fields(StudyRows)]


@dataclass(frozen=True)
class Trial:
    """One subject's evaluated task: the recordings of it by hand, right first as the paper prints them."""

    who: SubjectSession
    task: str
    trial: str
    recordings: dict[str, Recording]

    @property
    def title(self) -> str:
        """Task and trial in words."""
        return task_title(self.task, self.trial)


def by_hand_and_model(rows: Iterable[RowType]) -> dict[HandModel, list[RowType]]:
    """The rows of each hand and model, in the table's order."""
    groups: dict[HandModel, list[RowType]] = defaultdict(list)
    for row in rows:
        groups[hand_of(row), row["model"]].append(row)
    return dict(groups)


@dataclass(frozen=True)
class StudyResults(OfRecordings):
    """A study, or the part of it that is one subject's, with its results."""

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
        """Return whether the sheet names any session."""
        return any(who.session for who in self.sessions)

    @cached_property
    def shown(self) -> list[Recording]:
        """Every recording that is not excluded, and so has a page."""
        return [r for r in self.recordings if not r.exclude]

    def poses(self, recording: Recording) -> Path:
        """A recording's poses table."""
        return self.paths.folder / recording.hand.folder / recording.name / "poses.parquet"

    def subject_table(self, hand: Hand, table: str, model: str = "") -> Path:
        """A table of a hand's subject; of a fit of the whole hand that of this hand under a model."""
        return table_in(self.paths.subject(*hand.who), table, hand.hand, model)

    @cached_property
    def suspect(self) -> frozenset[Hand]:
        """Hands with a finding that makes them suspect: they are shown, and are in no statistic."""
        return frozenset(hand_of(row) for row in self.rows.problems if row["severity"] == SUSPECT)

    def counted(self, rows: list[RowType]) -> list[RowType]:
        """The rows that count in statistics: those of hands that are not suspect."""
        return [row for row in rows if hand_of(row) not in self.suspect]

    def with_rows(self, **rows: list[Any]) -> StudyResults:
        """The same with other rows of these tables."""
        return replace(self, rows=replace(self.rows, **rows))

    @cached_property
    def judging(self) -> StudyResults:
        """The same without the rows of suspect hands."""
        tables = ("joint_centres", "bone_lengths", "tip_errors", "skeleton_scores", "joint_errors")
        counted: dict[str, Any] = {name: self.counted(getattr(self.rows, name)) for name in tables}
        return self.with_rows(**counted)

    @cached_property
    def findings(self) -> list[ProblemsRow]:
        """Problems of recordings: faults, losses and omissions, without notes."""
        stages = (STAGE, "capture")
        return [
            row
            for row in self.rows.problems
            if row["severity"] == SUSPECT or (row["severity"] == REFUSED and row["stage"] in stages)
        ]

    @property
    def of_hands(self) -> bool:
        """Return whether all layouts are of hands; otherwise a hand in the tables is a side of a body."""
        return all(layout.is_hand for layout in self.layouts.values())

    @cached_property
    def accepted(self) -> list[ProblemsRow]:
        """Findings that the recordings sheet gives a reason for."""
        return [row for row in self.rows.problems if row["accepted"]]

    def hand_rows(self, table: Table, hand: Hand, model: str = "") -> list[Any]:
        """Rows of a hand, under a model, of a subject's short table; none where there are none to read."""
        path = self.subject_table(hand, table.name)
        try:
            with self.opened(path, table) as parts:
                return parts.rows(Part(hand.hand, model, "", *hand.who))
        except InputError:
            return []

    def add_problem(self, stage: str, message: str, task: str = "") -> None:
        """Add what went wrong while the page is made, before its problems are asked for."""
        self.rows.problems.append(_problem(SubjectSession(""), stage, message, task=task))

    @cached_property
    def joints_of(self) -> dict[HandModel, list[JointCentresRow]]:
        """Rows of joints by hand and model."""
        return by_hand_and_model(self.rows.joint_centres)

    @cached_property
    def bones_of(self) -> dict[HandModel, list[BoneLengthsRow]]:
        """Rows of bones by hand and model."""
        return by_hand_and_model(self.rows.bone_lengths)

    @cached_property
    def receivers_of(self) -> dict[HandModel, list[ReceiversRow]]:
        """Rows of receivers by hand and model."""
        return by_hand_and_model(self.rows.receivers)

    @cached_property
    def gains_of(self) -> dict[HandModel, list[GainsRow]]:
        """Rows of gains by hand and model."""
        return by_hand_and_model(self.rows.gains)

    @property
    def fitted(self) -> list[str]:
        """The models that fit the whole hand, in the study's order."""
        return [name for name, model in self.models.items() if model.fitting is not None]

    @property
    def leading(self) -> str:
        """The model that pages show first."""
        return leading_model(self.models, self.layouts.values())

    @cached_property
    def _tip_error_of(self) -> dict[tuple[str, ...], TipErrorsRow]:
        key = [name for name in TIP_ERRORS.key if name != "made_without"]
        return {key_of(row, key): row for row in self.rows.tip_errors}

    @cached_property
    def recording_row_of(self) -> dict[tuple[str, ...], RecordingsRow]:
        """Rows of the recordings table by subject, session, hand, task and trial."""
        return {row_key(row): row for row in self.rows.recordings}

    def tip_error(self, recording: Recording, model: str, digit: str, binding: str) -> TipErrorsRow | None:
        """The row of tip_errors for one cell group; None where the table has none."""
        return self._tip_error_of.get((*recording_key(recording), model, digit, binding))

    def status_of(self, recording: Recording) -> tuple[str, str]:
        """The recording's status (used, excluded, failed or missing) and the reason, if any."""
        row = self.recording_row_of.get(recording_key(recording))
        if row is not None:
            return row["status"], row["message"] or recording.exclude
        if recording.exclude:
            return "excluded", recording.exclude
        return "missing", "the results do not name this recording"

    def trials(self, subject: str, session: str = "") -> Iterator[Trial]:
        """The subject's evaluated tasks, excluded and failed recordings among them, in the sheet's order."""
        groups: dict[tuple[str, str], dict[str, Recording]] = defaultdict(dict)
        for recording in self.recordings:
            if recording.hand.who == (subject, session) and recording.role in ("evaluation", "both"):
                groups[recording.task, recording.trial][recording.hand.hand] = recording
        for (task, trial), by_hand in groups.items():
            recordings = {hand: by_hand[hand] for hand in HANDS if hand in by_hand}
            yield Trial(SubjectSession(subject, session), task, trial, recordings)

    def hands_of(self, subject: str, session: str = "") -> list[Hand]:
        """The subject's hands, right first."""
        mine = [hand for hand in self.hands if hand.who == (subject, session)]
        return sorted(mine, key=lambda hand: hand.hand != "right")


def task_title(task: str, trial: str = "", *, calibrates: bool = False) -> str:
    """Write task and trial in words. calibrates : whether the recording only calibrates."""
    words = [task, tr("trial {trial}", trial=trial) if trial else "", tr("calibration") if calibrates else ""]
    return ", ".join(filter(None, words))


def recording_key(recording: Recording) -> tuple[str, ...]:
    """Subject, session, hand, task and trial: what the tables call the recording."""
    return tuple(recording.key.values())


def row_key(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Subject, session, hand, task and trial of a row of a table."""
    return key_of(row, RECORDINGS.key)


def hand_of(row: Mapping[str, Any]) -> Hand:
    """The hand that a row of a table is of."""
    return Hand(row["subject"], row["hand"], row["session"])


def read_results(study: Study, folder: Path) -> StudyResults:
    """Read the study-wide tables from `folder`.

    Raises InputError where a table is absent or is another one. A table that records that its own making
    failed counts as empty, and the reason joins the problems.
    """
    paths = Results(folder)
    failures: list[ProblemsRow] = []
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
    """Read one subject's tables: the same results, for a study of that subject alone.

    Raises InputError where a table is absent or another one; a part that failed is among the problems.
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


def _failed_files(study: Study, paths: Results) -> Iterator[ProblemsRow]:
    """Report exports, then pages of subjects, that could not be made, and why."""
    for file in sorted(paths.exports.glob("*.failed.txt")) if study.exports else ():
        for message in file.read_text("utf-8").splitlines():
            task = file.name.removesuffix(".failed.txt")
            yield _problem(SubjectSession(""), "export", message, task=task)
    for who in study.sessions:
        file = paths.subject_pages(*who) / FAILED_PAGES
        for line in file.read_text("utf-8").splitlines() if file.is_file() else ():
            page, _, message = line.partition(": ")
            yield _problem(who, "subject_pages", message, task=page)


def _problem(who: SubjectSession, stage: str, message: str, **where: str) -> ProblemsRow:
    return problem_row(stage, finding_of_text("", REFUSED, message), **who._asdict(), **where)


def _study_rows(path: Path, table: Table, failures: list[ProblemsRow]) -> list[Any]:
    if not path.is_file():
        raise InputError(f"{path}: no such file; expected a {table.name} table")
    failure = read_metadata(path).get("failure")
    if failure is not None:
        failures.append(_problem(SubjectSession(""), "report", f"{path.name}: {failure}"))
        return []
    return list(rows_of(read_table(path, table, _columns_shown(table))))


def _columns_shown(table: Table) -> list[str]:
    """Columns that pages show: all but lists, which are never shown and take longest to read."""
    return [column.name for column in table.columns if not pa.types.is_fixed_size_list(column.type)]
