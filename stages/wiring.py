"""What the Snakefile asks of a study: which files a job reads, and the words of its command line."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

from schemas.config_files import read_config, tell_children
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import STUDY_TABLES, Results
from schemas.study import (
    Hand,
    Recording,
    Study,
    path_token,
    read_corrections,
    read_participants,
    read_study,
)
from stages import warm_process
from stages.draw_figures.names import KINDS, STUDY_FIGURES
from stages.each import ANEW
from stages.units import pack

Wildcards = Any
"""Snakemake's wildcards: attributes subject, hand, recording, model, as they stand in paths."""

_RECORD = "--record-failure"
_FITTED = {
    "--out": "fitted_joints",
    "--out-bones": "fitted_bones",
    "--out-receivers": "receivers",
    "--out-gains": "gains",
    "--out-angles": "joint_angles",
    "--out-bone-poses": "bone_poses",
    "--out-tips": "posed_tips",
}
"""Options of fit_hand, and the tables that they name."""


class Wiring:
    """One study, asked by the wildcards of a job."""

    def __init__(self, study_file: Path) -> None:
        self.file = _relative(study_file)
        self.study: Study = read_study(Path(self.file))
        self.results = Results.of(self.study.name)
        self.models = {name: _relative(path) for name, path in self.study.models.items()}
        self._sizes = {
            row["subject"]: {name: row[name] for name in ("hand_length_mm", "hand_breadth_mm")}
            for row in read_participants(self.study.sheets.get("participants"))
        }
        self._corrections = read_corrections(self.study.sheets.get("corrections"))
        self._tasks = {path_token(r.task): r.task for r in self.study.recordings}
        self._skeleton_models = {
            name: read_model(Path(path).absolute()) for name, path in self.models.items()
        }
        self._fitted = [name for name, model in self._skeleton_models.items() if model.fitting is not None]
        self._hands: dict[str, list[Hand]] = {}
        for hand in self.study.hands:
            self._hands.setdefault(path_token(hand.subject), []).append(hand)
        self._by_subject: dict[str, list[Recording]] = {}
        for recording in self.study.recordings:
            self._by_subject.setdefault(path_token(recording.hand.subject), []).append(recording)
        self._shown = set(self.study.shown)

    @classmethod
    def of(cls, study_files: Sequence[Path], config: Mapping[str, Any], default: Path) -> Wiring:
        """Read the study of Snakemake's --configfile, or the default one.

        Raises InputError where there are several, or where --config would change what the file says: the
        stages read that file, and results that it does not explain would be worse than none.
        """
        if len(study_files) > 1:
            raise InputError("--configfile: names several files; a run is of one study")
        path = Path(study_files[0]) if study_files else default
        if config and dict(config) != _as_written(path):
            raise InputError(f"--config: a study is described by its file alone; write it into {path}")
        made = cls(path)
        for layout in {recording.layout for recording in made.study.recordings}:
            with suppress(InputError):  # those whose hands need it say so
                read_layout(layout)
        tell_children()
        return made

    # --- simulate -------------------------------------------------------------------------------------

    @property
    def simulated(self) -> str:
        """Path of a simulated recording, with wildcards; a path that nothing asks for where none is."""
        folder = self.study.simulation.folder if self.study.simulation else Path(os.devnull, "none")
        return _relative(folder / "sub-{subject}_hand-{hand}_task-{task}.parquet")

    @property
    def streamed(self) -> str:
        """Path of a simulated recording as its tracker's raw capture, with wildcards."""
        return self.simulated.removesuffix(".parquet") + ".arrows"

    def simulate(self, wildcards: Wildcards) -> str:
        """Words of simulate's command line."""
        assert self.study.simulation is not None
        (hand,) = self._hands_of(wildcards)
        seed = str(self.study.simulation.seed)
        return shlex.join(
            ["--subject", hand.subject, "--hand", hand.hand, "--task", wildcards.task, "--seed", seed]
        )

    # --- one job a subject ------------------------------------------------------------------------------

    def made(self, stage: str) -> str:
        """Path, with wildcards, of what a job says it made of a subject; it stands for the tables themselves.

        A fit of a whole hand takes long, so there each hand has a job of its own.
        """
        return str(
            self.results.made / stage / ("sub-{subject}" + ("/{hand}" * (stage == "fit_hand")) + ".json")
        )

    def of_subject(self, *stages: str) -> Callable[[Wildcards], list[str]]:
        """What these stages made of the subject; of both hands, where each is a job."""

        def of(wildcards: Wildcards) -> list[str]:
            return [path for stage in stages for path in self._made_of(stage, wildcards.subject)]

        return of

    def of_study(self, *stages: str) -> list[str]:
        """What these stages made of every subject."""
        return [
            path
            for subject in self.study.subjects
            for stage in stages
            for path in self._made_of(stage, path_token(subject))
        ]

    def gone(self, stage: str) -> Callable[[Wildcards], list[str]]:
        """Tables that a job says it made and that are no longer there: somebody wants them made again."""

        def of(wildcards: Wildcards) -> list[str]:
            made = Path(self.made(stage).format(**wildcards))
            if not made.is_file():
                return []
            files = [file for unit in json.loads(made.read_text("utf-8")) for file in unit["files"]]
            return [file for file in files if not Path(file).exists()]

        return of

    last_stages = ("capture", "check_calibration", "evaluate_skeletons")
    """Stages that, with all that they wait for, make every table of a subject."""

    @staticmethod
    def prepare(workflow: Any) -> None:
        """Ready Snakemake to run jobs.

        Let jobs do again what is up to date where it was told so, by --forceall or --forcerun. Let it not
        count jobs a second: 9.27 looks through all jobs once more each second for every job that has ended,
        until most of a study of hundreds is spent on that. And let jobs of this machine start fast.
        """
        if workflow.dag_settings.forceall or workflow.dag_settings.forcerun:
            os.environ[ANEW] = "1"
        workflow.scheduler.job_rate_limiter = None
        if workflow.local_exec:
            warm_process.start()

    def layouts(self, wildcards: Wildcards) -> list[str]:
        """Layouts of the subject's hands."""
        return list(
            dict.fromkeys(_relative(self.study.layout_of(hand)) for hand in self._hands_of(wildcards))
        )

    def _made_of(self, stage: str, subject: str) -> list[str]:
        if stage != "fit_hand":
            return [self.made(stage).format(subject=subject)]
        hands = self._hands[subject] if self._fitted else []
        return [self.made(stage).format(subject=subject, hand=hand.hand) for hand in hands]

    def _hands_of(self, wildcards: Wildcards) -> list[Hand]:
        """The job's hands: of its subject, or the one that it is of."""
        only = getattr(wildcards, "hand", None)
        return [hand for hand in self._hands[wildcards.subject] if only in (None, hand.hand)]

    def _each_skeleton(self, wildcards: Wildcards, models: Iterable[str]) -> Iterator[tuple[Hand, str, str]]:
        """The job's skeletons: hand, model and the task that it is made without, empty for none."""
        for hand in self._hands_of(wildcards):
            for model in models:
                for without in self._without(hand, model):
                    yield hand, model, without

    # --- capture ----------------------------------------------------------------------------------------

    def recording_files(self, wildcards: Wildcards) -> list[str]:
        """The subject's recordings and their mappings that are there, or can be simulated.

        A missing one must not stop the others.
        """
        files = []
        for recording in self._recordings_of(wildcards):
            names = {"subject": wildcards.subject, "hand": recording.hand.hand, "task": recording.task}
            file = _relative(recording.file)
            made = [path.format(**names) for path in (self.simulated, self.streamed)]
            files += [file] if recording.file.exists() or file in made else []
            mapping = recording.mapping
            files += [_relative(mapping)] if mapping is not None and mapping.exists() else []
        return list(dict.fromkeys(files))

    def capture(self, wildcards: Wildcards) -> str:
        """Bring in each of the subject's recordings."""
        units = []
        for r in self._recordings_of(wildcards):
            words = {"in": _relative(r.file), "layout": _relative(r.layout), "format": r.format}
            words |= {} if r.mapping is None else {"mapping": _relative(r.mapping)}
            words |= {"subject": r.hand.subject, "hand": r.hand.hand, "task": r.task, "trial": r.trial}
            repair = ["--repair-hemisphere"] if r.hemisphere == "repair" else []
            options = [f"--{name}={word}" for name, word in words.items()]
            units.append([_RECORD, *options, *repair, f"--out={self.results.poses(r)}"])
        return pack(units)

    def check_calibration(self, wildcards: Wildcards) -> str:
        """Look at what calibrates each of the subject's hands."""
        return pack(
            [
                _RECORD,
                *self._whose(hand),
                *_many("--poses", self._calibrating(hand)),
                f"--layout={_relative(self.study.layout_of(hand))}",
                f"--out={self.results.score_table(hand, 'calibration_advice')}",
            ]
            for hand in self._hands_of(wildcards)
        )

    # --- a hand under a model ---------------------------------------------------------------------------

    def solve_joints(self, wildcards: Wildcards) -> str:
        """Solve each of the subject's hands under each model."""
        return pack(
            [
                _RECORD,
                *self._whose(hand),
                *_many("--poses", self._calibration(hand, model, without)),
                *self._named(hand, model),
                f"--out={self._table(hand, model, without, 'joint_solutions')}",
            ]
            for hand, model, without in self._each_skeleton(wildcards, self.models)
        )

    def project_planes(self, wildcards: Wildcards) -> str:
        """Project, and correct where the model says so, each of these hands' joints."""
        return pack(
            [
                _RECORD,
                f"--joints={self._table(hand, model, without, 'joint_solutions')}",
                *(self._sheet("corrections") if self._skeleton_models[model].corrections else ()),
                *self._named(hand, model),
                f"--out={self._table(hand, model, without, 'projected_joints')}",
            ]
            for hand, model, without in self._each_skeleton(wildcards, self.models)
        )

    def corrections(self, wildcards: Wildcards) -> list[str]:
        """What the sheet of corrections says of the subject; the rest of it may change without its joints."""
        return [
            "\t".join(map(str, row.values.values()))
            for row in self._corrections
            if path_token(row["subject"]) == wildcards.subject
        ]

    def fit_hand(self, wildcards: Wildcards) -> str:
        """Fit the hand under each model that fits whole hands."""
        return pack(
            [
                _RECORD,
                *self._size_words(hand, "hand_length_mm", "hand_breadth_mm"),
                *_many("--poses", self._calibration(hand, model, without)),
                f"--joints={self._table(hand, model, without, 'projected_joints')}",
                *_many("--other-poses", self._other_calibration(hand, model, without)),
                *_many("--replay", self._evaluated(hand, without)),
                *self._sheet("measurements"),
                *self._sheet("touches"),
                *self._named(hand, model),
                *(
                    f"{option}={self._table(hand, model, without, table)}"
                    for option, table in _FITTED.items()
                ),
            ]
            for hand, model, without in self._each_skeleton(wildcards, self._fitted)
        )

    @property
    def sheets_of_fit(self) -> list[str]:
        """Sheets that a fit of the whole hand reads."""
        return [
            _relative(self.study.sheets[name])
            for name in ("measurements", "touches")
            if name in self.study.sheets
        ]

    def estimate_metacarpals(self, wildcards: Wildcards) -> str:
        """Build and pose each of the subject's hands under each model."""
        units = []
        for hand, model, without in self._each_skeleton(wildcards, self.models):
            table = partial(self._table, hand, model, without)
            fitted = model in self._fitted
            units.append(
                [
                    _RECORD,
                    f"--joints={table('fitted_joints' if fitted else 'projected_joints')}",
                    *_many("--calibration", self._calibration(hand, model, without)),
                    *_many("--poses", self._evaluated(hand, without)),
                    *(
                        (f"--fitted-bones={table('fitted_bones')}", f"--bone-poses={table('bone_poses')}")
                        if fitted
                        else ()
                    ),
                    *self._named(hand, model),
                    f"--out-joints={table('joint_centres')}",
                    f"--out-bones={table('bone_lengths')}",
                    f"--out={table('metacarpals')}",
                ]
            )
        return pack(units)

    def evaluate_tips(self, wildcards: Wildcards) -> str:
        """Replay each of the subject's skeletons."""
        units = []
        for hand, model, without in self._each_skeleton(wildcards, self.models):
            table = partial(self._table, hand, model, without)
            units.append(
                [
                    _RECORD,
                    *_many("--poses", self._evaluated(hand, without)),
                    *_many("--calibration", self._calibration(hand, model, without)),
                    f"--joints={table('joint_centres')}",
                    f"--bones={table('bone_lengths')}",
                    f"--metacarpals={table('metacarpals')}",
                    *self._named(hand, model),
                    f"--out={table('tips')}",
                    f"--out-errors={table('tip_errors')}",
                ]
            )
        return pack(units)

    def evaluate_skeletons(self, wildcards: Wildcards) -> str:
        """Score each of the subject's hands under all models together."""
        return pack(
            [
                _RECORD,
                *self._whose(hand),
                *_many("--poses", self._evaluated(hand)),
                *_many("--calibration", self._calibrating(hand)),
                *_many("--skeletons", self._skeletons(hand)),
                *_many("--truth", self._truth(hand)),
                f"--layout={_relative(self.study.layout_of(hand))}",
                f"--out={self.results.score_table(hand, 'skeleton_scores')}",
                f"--out-joints={self.results.score_table(hand, 'joint_errors')}",
            ]
            for hand in self._hands_of(wildcards)
        )

    # --- exports --------------------------------------------------------------------------------------

    def export(self, wildcards: Wildcards) -> str:
        """Export each of the subject's recordings under each model."""
        formats = ",".join(name for name in self.study.exports if name != "bids")
        return pack(
            [
                _RECORD,
                f"--study={self.file}",
                f"--results={self.results.folder}",
                f"--subject={recording.hand.subject}",
                f"--hand={recording.hand.hand}",
                f"--recording={recording.name}",
                f"--model={model}",
                f"--formats={formats}",
                *self._export_settings(),
                f"--out={self.results.exports(model, recording)}",
            ]
            for model in self.study.export_settings["models"]
            for recording in self._by_subject[wildcards.subject]
            if recording in self._shown
        )

    def export_dataset(self, _: Wildcards) -> str:
        """Words of the command line that exports the whole study as one dataset."""
        models = ",".join(self.study.export_settings["models"])
        return shlex.join([f"--models={models}", *self._export_settings()])

    def _export_settings(self) -> list[str]:
        """Options of both command lines, those that the study says."""
        settings = {name: value for name, value in self.study.export_settings.items() if name != "models"}
        return [
            f"--{name.replace('_', '-')}={value}"
            for name, value in settings.items()
            if value not in ("", None)
        ]

    @property
    def exports(self) -> list[str]:
        """Everything that the study exports: of each subject, and the dataset of all."""
        each, dataset = {*self.study.exports} - {"bids"}, "bids" in self.study.exports
        return [
            *(self.of_study("export") if each else ()),
            *([str(self.results.dataset)] if dataset else ()),
        ]

    # --- the study --------------------------------------------------------------------------------------

    study_tables = STUDY_TABLES
    figure_names = STUDY_FIGURES

    @property
    def figures(self) -> list[str]:
        """The study's figures for print, and their captions."""
        return [str(self.results.figures / f"{name}.{kind}") for name in STUDY_FIGURES for kind in KINDS]

    def subject(self, wildcards: Wildcards) -> str:
        """Words that say whose pages they are."""
        return shlex.join([f"--subject={self._subject(wildcards)}"])

    def rows_of_subject(self, wildcards: Wildcards) -> list[str]:
        """What a subject's pages show of the recordings sheet; the rest of it may change without them."""
        return [
            "\t".join((r.hand.hand, r.task, r.trial, r.role, r.file_as_written, r.exclude))
            for r in self.study.of_subject(self._subject(wildcards)).recordings
        ]

    @property
    def subject_pages(self) -> list[str]:
        """Folders of the subjects' pages of the report."""
        return [str(self.results.subject_pages(subject)) for subject in self.study.subjects]

    @property
    def configuration(self) -> list[str]:
        """The study file and its sheets."""
        return [self.file, *map(_relative, self.study.sheets.values())]

    def _subject(self, wildcards: Wildcards) -> str:
        return self._hands[wildcards.subject][0].subject

    # --- words of command lines -------------------------------------------------------------------------

    def _named(self, hand: Hand, model: str) -> list[str]:
        """The layout, and the model."""
        return [f"--layout={_relative(self.study.layout_of(hand))}", f"--model={self.models[model]}"]

    def _whose(self, hand: Hand) -> list[str]:
        """Whose hand it is, and how long, where the participants sheet has it."""
        return [
            f"--subject={hand.subject}",
            f"--hand={hand.hand}",
            *self._size_words(hand, "hand_length_mm"),
        ]

    def _size_words(self, hand: Hand, *names: str) -> list[str]:
        sizes = self._sizes.get(hand.subject, {})
        return [
            f"--{name.replace('_', '-')}={sizes[name]:g}" for name in names if sizes.get(name) is not None
        ]

    def _sheet(self, name: str) -> list[str]:
        """A sheet of the study, if it has one."""
        path = self.study.sheets.get(name)
        return [] if path is None else [f"--{name}={_relative(path)}"]

    def _table(self, hand: Hand, model: str, without: str, table: str) -> str:
        return f"{self._skeleton(hand, model, without)}/{table}.parquet"

    @cache  # noqa: B019 - there is one study a process, and its paths are asked for by the thousand
    def _skeleton(self, hand: Hand, model: str, without: str) -> str:
        return self.results.skeleton(model, hand, without).as_posix()

    def _without(self, hand: Hand, model: str) -> list[str]:
        """Tasks, as in paths, that the hand's skeleton is also made without, after the whole one: ''."""
        calibration = self._skeleton_models[model].calibration
        return ["", *map(path_token, self.study.left_out(hand, calibration))]

    def _skeletons(self, hand: Hand) -> list[str]:
        """Folders of the hand's skeletons: every model's, and made without each task that it is scored on."""
        return [
            self._skeleton(hand, model, without)
            for model in self.models
            for without in self._without(hand, model)
        ]

    # --- poses that a job reads -------------------------------------------------------------------------

    def _calibration(self, hand: Hand, model: str, without: str) -> list[str]:
        """Poses that the hand's joints are solved from under this model."""
        calibration = self._skeleton_models[model].calibration
        return self._poses(self.study.calibrating(hand, calibration, self._tasks.get(without, "")))

    def _other_calibration(self, hand: Hand, model: str, without: str) -> list[str]:
        """Poses that calibrate the same person's other hand, where the model shares what they have alike."""
        fitting = self._skeleton_models[model].fitting
        others = [other for other in self._hands[path_token(hand.subject)] if other != hand]
        if fitting is None or not fitting.share_lengths or not others:
            return []
        if self.study.layout_of(others[0]) != self.study.layout_of(hand):
            return []
        return self._calibration(others[0], model, without)

    def _calibrating(self, hand: Hand) -> list[str]:
        """Poses of every recording that may calibrate the hand."""
        return self._poses(self.study.calibrating(hand, "all"))

    def _evaluated(self, hand: Hand, without: str = "") -> list[str]:
        """Poses that the hand's tips are evaluated on; of a task that was left out, that task's."""
        recordings = self.study.evaluated(hand)
        return self._poses(r for r in recordings if not without or path_token(r.task) == without)

    def _truth(self, hand: Hand) -> list[str]:
        """Folders of the truth beside the hand's simulated recordings."""
        if self.study.simulation is None:
            return []
        names = [
            self.simulated.format(subject=path_token(hand.subject), hand=hand.hand, task=recording.task)
            for recording in self.study.of(hand, ("calibration", "evaluation", "both"))
        ]
        return [name.removesuffix(".parquet") + "_truth" for name in dict.fromkeys(names)]

    def _recordings_of(self, wildcards: Wildcards) -> list[Recording]:
        """The subject's recordings that are not excluded."""
        return [recording for recording in self._by_subject[wildcards.subject] if not recording.exclude]

    def _poses(self, recordings: Iterable[Recording]) -> list[str]:
        return [str(self.results.poses(recording)) for recording in recordings]


def _many(option: str, values: Sequence[str]) -> list[str]:
    return [option, *values]


def _as_written(path: Path) -> dict[str, Any]:
    return read_config(path, "study", with_defaults=False)


def _relative(path: str | Path) -> str:
    return os.path.relpath(path)
