"""Inputs and outputs of the Snakefile's jobs, and the parts of the plan that they depend on."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from shukotsu.command_line import option_of
from shukotsu.errors import InputError, list_names
from shukotsu.hand.known_digits import known_digits, refusal
from shukotsu.study import plan_file, results
from shukotsu.study.config_files import CONFIG_FOLDER, REFERENCE
from shukotsu.study.plan_file import fit_part, plan_digest, plan_from_content, plan_text, recordings_part
from shukotsu.study.study import Recording, Study, read_study, truth_folder
from shukotsu.tables.subjects import SubjectSession, path_token
from shukotsu.workflow.file_digests import CHANGED, FileDigests, program_digest

Wildcards = Any
"""Snakemake's wildcards: attributes subject (with session), hand, recording and model, as in paths."""
PROGRAM = "the program"
"""Name of the program among the inputs of a run."""


class StudyFiles:
    """Paths, options and digests of a study, looked up by the wildcards of a job.

    Attributes
    ----------
    options
        Command-line options that name the study and its results folder.
    subjects
        Plans of every subject in every session, in the sheet's order.
    plans_digest
        Digest of the plans of all subjects.
    export_options, participants
        Options of the export command that the study file sets, and the one that names the participants sheet;
        an empty string if the study has none.
    simulated, streamed, simulated_truth
        Patterns, with wildcards, of the paths of a simulated recording, of the same recording as the
        tracker's raw capture, and of its truth tables; paths that do not exist if nothing is simulated.
    kept
        File with the copy of Snakemake's records of the results.
    whole_tables
        All paths in study_tables, model_comparisons and movement_comparisons.
    figures
        Figures for print, with their captions.
    exports
        The folder in which all exports are collected; an empty list if the study exports nothing.
    export_formats
        Formats of the exports of single recordings; another job exports the Motion-BIDS dataset.
    export_folders
        Folders in which exports are made: each subject's, the dataset's, and that of the study's tables.

    """

    def __init__(self, study_file: Path) -> None:
        self.file = _relative(study_file)
        self.study: Study = read_study(Path(self.file))
        self.results = results.Results(Path("results", self.study.name))
        self.options = shlex.join(["--study", self.file, "--results", self.results.folder.as_posix()])
        self._digests = FileDigests()
        plans = plan_file.StudyPlans(self.study, self.results.folder)
        self._contents = {who.token: plans.content(*who) for who in self.study.sessions}
        self._plans = {
            subject: plan_from_content(content, self.file) for subject, content in self._contents.items()
        }
        self.subjects = list(self._plans.values())
        reasons = [
            refusal(layout, name, model)
            for plan in self.subjects
            for layout in plan.layouts.values()
            for name, model in plan.models.items()
        ]
        if reasons and all(reasons):  # a model that applies to no hand is an error in the study
            raise InputError(f"{self.file}: models: {reasons[0]}")
        self.plans_digest = plan_digest(self._contents)
        settings, participants = self.study.export_settings, self.study.sheets.get("participants")
        self.export_options = _options(settings | {"models": ",".join(settings["models"])})
        self.participants = _options({"participants": participants and _relative(participants)})
        self._models = {path_token(name): name for name in (*self.study.models, REFERENCE)}
        simulation, folder = self.study.simulation, Path(os.devnull, "none")
        self.seed = 0 if simulation is None else simulation.seed
        if simulation is not None:
            folder, around = simulation.folder, (Path(self.file).parent, Path())
            if not any(folder.resolve().is_relative_to(above.resolve()) for above in around):
                raise InputError(
                    f"{self.file}: simulation.folder: {folder} is neither below the study file's folder nor "
                    "below the working directory; expected a folder there"
                )
        recording = _relative(folder / "sub-{subject}_hand-{hand}_task-{task}")
        self.simulated, self.streamed = f"{recording}.parquet", f"{recording}.arrows"
        truth = truth_folder(Path(self.simulated))
        self.simulated_truth = [(truth / f"{name}.parquet").as_posix() for name in results.TRUTH_TABLES]
        layouts = dict.fromkeys(recording.source.layout for recording in self.study.recordings)
        files = [*self.study.sheets.values(), *layouts, *self.study.models.values()]
        self._configuration = [self.file, *map(_relative, files)]
        mappings = dict.fromkeys(r.source.mapping for r in self.study.recordings if r.source.mapping)
        self._mappings = [_relative(path) for path in mappings]
        for path in (*self._configuration, *([] if simulation is None else [_relative(folder)])):
            if not _can_be_declared(path):
                raise InputError(
                    f"{path}: its path contains {{...}} or <...>, which mean something else to Snakemake; "
                    "rename it, or run from a folder from which its path does not contain them"
                )
        self._name_results()

    def _name_results(self) -> None:
        """Set the paths of the results that belong to the whole study."""
        paths, study, whose = self.results, self.study, self.study.sessions
        self.kept = paths.folder / "logs" / "made_from.json"
        self.plans = [str(paths.plan(*who)) for who in whose]
        kinds = results.STUDY_TABLES, results.MODEL_COMPARISONS, results.MOVEMENT_COMPARISONS
        tables = [[str(paths.study_table(table)) for table in kind] for kind in kinds]
        self.study_tables, self.model_comparisons, self.movement_comparisons = tables
        self.whole_tables = [path for kind in tables for path in kind]
        printed = product(results.STUDY_FIGURES, results.FIGURE_KINDS)
        self.figures = [str(paths.figures / f"{name}.{kind}") for name, kind in printed]
        self.subject_pages = [str(paths.subject_pages(*who)) for who in whose]
        self.export_formats = [name for name in study.exports if name != "bids"]
        self.exports = [str(paths.exports)] if study.exports else []
        self.export_folders = [str(paths.subject_exports(*who)) for who in whose if self.export_formats]
        self.export_folders += [str(paths.new_dataset)] if "bids" in study.exports else []
        self.export_folders += [str(paths.tidy_tables)] if "csv" in study.exports else []

    def what_changed(self) -> str:
        """Return a sentence on the inputs that changed since the last run, or none; store their state."""
        files = {
            token: [*self._event_files(token), *(p for r in plan.recordings for p in self._files_of(r))]
            for token, plan in self._plans.items()
        }
        paths = {*self._configuration, *(path for of_subject in files.values() for path in of_subject)}
        contents = {path: self._digests.sha256(path) for path in sorted(paths)}
        contents |= {f"plan of {token}": plan_digest(plan) for token, plan in self._contents.items()}
        changed = self._digests.changes(self.study.name, contents | {PROGRAM: program_digest()})
        if not changed:
            return ""
        program = [PROGRAM] if changed.pop(PROGRAM, "") else []
        named = {CHANGED: [*program]}
        for name, how in changed.items():
            if not name.startswith("plan of "):
                named.setdefault(how, []).append(name)
        said = [f"{how}: {list_names(names)}" for how, names in named.items() if names]
        again = [token for token in files if {f"plan of {token}", *files[token]} & {*changed}]
        whose = f"those of {list_names([f'sub-{token}' for token in again])} and " if again else ""
        which = "all" if program else f"{whose}the study's"
        return "; ".join([*said, f"results made again: {which}"])

    def remove_former(self) -> str:
        """Remove results that no longer belong to the study; return a sentence on them, if any."""
        from shukotsu.workflow.former_results import remove_former_results

        present = {*self.plans, *self.tables, *self.subject_pages, *self.export_folders, *self.exports}
        former = remove_former_results(self.results, present)
        return f"removed results that no longer belong to the study: {list_names(former)}" if former else ""

    def changed_results(self) -> list[str]:
        """Return sentences on the results that were changed after a run, and on those left unfinished by one.

        Those results are made again; Snakemake's lost records of all others are restored. An outdated plan is
        rewritten when a run starts, and a run starts only if there is a job to do; so the job that writes the
        study's tables is made to run.
        """
        from shukotsu.workflow.former_results import recall  # imports Snakemake, often not needed

        tables = [self.results.resolved.as_posix()] if self.changed_plans() else []
        simulated = [path for plan in self.subjects for r in plan.recordings for path in self._made_for(r)]
        found: tuple[list[str], list[str]] = ([], [])
        with suppress(OSError):  # Snakemake reports that the folder is not writable
            outputs = [path for path in self.outputs if path not in self.plans]
            found = recall(self.kept, [*outputs, *simulated], tables, self._digests)
        folder = f"{self.results.folder.as_posix()}/"
        named = [[path.removeprefix(folder) for path in paths if path not in tables] for paths in found]
        how = "changed after their run", "left unfinished by an interrupted run"
        pairs = zip(how, named, strict=True)
        return [f"results {what}, now made again: {list_names(paths)}" for what, paths in pairs if paths]

    def changed_plans(self) -> dict[Path, str]:
        """Return the new texts, by path, of plan files that no longer match the study."""
        texts = {plan.folder / "plan.json": plan_text(self._contents[t]) for t, plan in self._plans.items()}
        return {path: t for path, t in texts.items() if path.is_file() and path.read_bytes() != t.encode()}

    # --- of one subject -----------------------------------------------------------------------------------

    def subject(self, wildcards: Wildcards) -> SubjectSession:
        """Return the subject and session that the wildcard `subject` stands for."""
        return self._plans[wildcards.subject].who

    def subject_options(self, wildcards: Wildcards) -> str:
        """Return the options that name a job's subject and session."""
        return _options(self.subject(wildcards)._asdict())

    def font_note(self) -> str:
        """Return a note if figures for print cannot be in the study's language, or an empty string."""
        if self.study.language == "en":  # avoid loading matplotlib
            return ""
        from shukotsu.report.figures.style import font_note

        return font_note(self.study.language)

    def resources(
        self, minutes: int, minutes_a_gb: int, most_mb: int = 1200
    ) -> dict[str, Callable[[Wildcards], int]]:
        """Return Snakemake's resources of a subject's job by the size of the subject's recordings.

        minutes, minutes_a_gb : run time without data, and more per GB. most_mb : upper limit of memory, MB.
        """

        def gb(wildcards: Wildcards) -> float:
            recordings = self._plans[wildcards.subject].recordings
            files = {Path(path) for recording in recordings for path in self._files_of(recording)}
            return sum(file.stat().st_size for file in files if file.is_file()) / 1e9

        return {
            "mem_mb": lambda wildcards: round(500 + min(1.0, 2 * gb(wildcards)) * (most_mb - 500)),
            "runtime": lambda wildcards: round(minutes + minutes_a_gb * gb(wildcards)),
        }

    def plan(self, wildcards: Wildcards) -> str:
        """Return a digest of the subject's whole plan."""
        return plan_digest(self._contents[wildcards.subject])

    def recordings_plan(self, wildcards: Wildcards) -> str:
        """Return a digest of the parts of the subject's plan that describe recordings."""
        return plan_digest(recordings_part(self._contents[wildcards.subject]))

    def simulated_recording(self, wildcards: Wildcards) -> list[str]:
        """Return the file of a recording if the workflow simulates it, else an empty list."""
        recording = self._recording(wildcards)
        return [_relative(recording.source.file)] if self.is_simulated(recording) else []

    def is_simulated(self, recording: Recording) -> bool:
        """Return whether the workflow makes the recording's file."""
        return _relative(recording.source.file) in self._made_for(recording)

    def recording_files(self, wildcards: Wildcards) -> list[str]:
        """Return the existing user files that a recording is read from, if Snakemake accepts their names."""
        return _declarable(self._files_of(self._recording(wildcards)))

    def recording_digest(self, wildcards: Wildcards) -> str:
        """Return a digest of the contents of all user files that a recording is read from."""
        return self._digests.of(self._files_of(self._recording(wildcards)))

    def event_files(self, wildcards: Wildcards) -> list[str]:
        """Return the user files that the subject's events are read from, selected as in `recording_files`."""
        return _declarable(self._event_files(wildcards.subject))

    def event_digest(self, wildcards: Wildcards) -> str:
        """Return a digest of the contents of all user files that the subject's events are read from."""
        return self._digests.of(self._event_files(wildcards.subject))

    def _made_for(self, recording: Recording) -> list[str]:
        """Return the paths that the files of a recording have if the workflow simulates it."""
        hand = recording.hand
        token = SubjectSession(hand.subject, hand.session).token
        names = {"subject": token, "hand": hand.hand, "task": recording.task}
        return [pattern.format(**names) for pattern in (self.simulated, self.streamed)]

    def _files_of(self, recording: Recording) -> list[str]:
        """Return the user files that a recording is read from: its data and its mapping."""
        paths = [_relative(path) for path in (recording.source.file, recording.source.mapping) if path]
        return [path for path in dict.fromkeys(paths) if path not in self._made_for(recording)]

    def _event_files(self, subject: str) -> list[str]:
        """Return the user files that a subject's events are read from.

        They include the recordings themselves, which may contain synchronisation pulses.
        """
        recordings = [r for r in self._plans[subject].recordings if r.events is not None]
        paths = [(r, _relative(path)) for r in recordings for path in (r.source.file, r.events) if path]
        return list(dict.fromkeys(path for r, path in paths if path not in self._made_for(r)))

    def import_options(self, wildcards: Wildcards) -> str:
        """Return the options that describe a recording to the command that imports it."""
        return shlex.join(import_options(self._recording(wildcards)))

    def layout_digest(self, wildcards: Wildcards) -> str:
        """Return a digest of a hand's layout."""
        return plan_digest(self._contents[wildcards.subject]["layouts"][wildcards.hand])

    def poses(self, wildcards: Wildcards) -> list[str]:
        """Return the poses files of the subject's recordings, without excluded ones."""
        plan = self._plans[wildcards.subject]
        return [str(plan.poses(recording)) for recording in plan.recordings if not recording.exclude]

    def subject_tables(self, wildcards: Wildcards) -> list[str]:
        """Return the subject's tables: those with both hands and all models, and those of each fit."""
        plan = self._plans[wildcards.subject]
        return [*map(str, map(plan.table, results.SUBJECT_TABLES)), *self.fit_tables(wildcards)]

    def poses_of_fit(self, wildcards: Wildcards) -> list[str]:
        """Return the poses files that a fit reads; those of both hands if the model shares bone lengths."""
        plan, hand = self._plans[wildcards.subject], getattr(wildcards, "hand", "")
        model = plan.models.get(self.model(wildcards))
        both = not hand or (model is not None and model.fitting is not None and model.fitting.share_lengths)
        recordings = [r for r in plan.recordings if not r.exclude and (both or r.hand.hand == hand)]
        return [str(plan.poses(recording)) for recording in recordings]

    def model(self, wildcards: Wildcards) -> str:
        """Return the name of the model that the wildcard `model` stands for."""
        return self._models[wildcards.model]

    def layout(self, wildcards: Wildcards) -> str:
        """Return the path of a hand's layout."""
        return _relative(self.study.layout_of(self._plans[wildcards.subject].hand(wildcards.hand)))

    def inputs(self, *names: str) -> dict[str, Any]:
        """Return a rule's inputs by name: `plan`, `poses`, or tables with both hands and all models."""
        from snakemake.io import ancient  # reading a study does not need Snakemake

        folder = f"{self.results.folder.as_posix()}/sub-{{subject}}"
        files = {"plan": ancient(f"{folder}/plan.json"), "poses": self.poses}
        return {name: files.get(name, f"{folder}/{name}.parquet") for name in names}

    def fits(self, *names: str, references: bool = False) -> dict[str, Callable[[Wildcards], list[str]]]:
        """Return, by table name, a function that lists the tables of the subject's whole-hand fits.

        references : include those of the average hand, if it has any of the layout's digits.
        """

        def files(wildcards: Wildcards, name: str) -> list[str]:
            plan = self._plans[wildcards.subject]
            hands = [hand for hand, layout in plan.layouts.items() if references and known_digits(layout)]
            fits = [*plan.fits_of_hands(), *((hand, REFERENCE) for hand in hands)]
            return [str(plan.table(name, *fit)) for fit in fits]

        return {name: partial(files, name=name) for name in names}

    def fit_tables(self, wildcards: Wildcards) -> list[str]:
        """Return every table of the subject's whole-hand fits, including those of the average hand."""
        kinds = self.fits(*results.FIT_TABLES, references=True).values()
        return [path for files in kinds for path in files(wildcards)]

    @property
    def fitted_together(self) -> dict[str, str]:
        """Wildcard patterns of the subjects and models for which one job fits both hands.

        They are the subjects whose hands have the same layout, and the models that share bone lengths between
        hands or are the reference, which takes hardly any time.
        """
        fittings = {name: model.fitting for plan in self.subjects for name, model in plan.models.items()}
        layouts = {token: [*plan.layouts.values()] for token, plan in self._plans.items()}
        subjects = [token for token, of_hands in layouts.items() if of_hands[1:] == of_hands[:1]]
        models = [path_token(name) for name, fit in fittings.items() if fit and fit.share_lengths]
        tokens = {"subject": subjects, "model": [*models, REFERENCE]}
        return {name: "|".join(map(re.escape, of_name)) or "(?!)" for name, of_name in tokens.items()}

    def fit_plan(self, wildcards: Wildcards) -> str:
        """Return a digest of the part of the plan that a whole-hand fit depends on."""
        model, hand = self.model(wildcards), getattr(wildcards, "hand", "")
        return plan_digest(fit_part(self._contents[wildcards.subject], hand, model))

    def truth(self, wildcards: Wildcards) -> list[str]:
        """Return the truth tables of the subject's simulated recordings."""
        plan = self._plans[wildcards.subject]
        folders = [recording.truth for recording in plan.recordings if not recording.exclude]
        paths = [folder / f"{name}.parquet" for folder in folders if folder for name in results.TRUTH_TABLES]
        return [_relative(path) for path in paths]

    def _recording(self, wildcards: Wildcards) -> Recording:
        hand, name = wildcards.hand, wildcards.recording
        every = (r for r in self._plans[wildcards.subject].recordings if not r.exclude)
        return next(r for r in every if (r.hand.hand, r.name) == (hand, name))

    # --- the whole study ----------------------------------------------------------------------------------

    @property
    def tables(self) -> list[str]:
        """Every table of every subject."""
        return [*self._of_all(self.poses), *self._of_all(self.subject_tables)]

    @property
    def exported(self) -> list[str]:
        """Tables of all subjects from which exports are made."""
        names = ("findings", *results.SKELETON_TABLES)
        tables = [str(plan.table(name)) for plan in self.subjects for name in names]
        return [*self._of_all(self.poses), *tables, *self._of_all(self.fit_tables)]

    def _of_all(self, files: Callable[[Wildcards], list[str]]) -> list[str]:
        return [path for token in self._plans for path in files(SimpleNamespace(subject=token))]

    @property
    def configuration(self) -> list[str]:
        """The study file, its sheets, layouts and models, and the mappings whose paths Snakemake accepts."""
        return [*self._configuration, *_declarable(self._mappings)]

    @property
    def configuration_digest(self) -> str:
        """Digest of the contents of these files and of the other mappings."""
        return plan_digest([self._digests.sha256(path) for path in (*self._configuration, *self._mappings)])

    @property
    def outputs(self) -> list[str]:
        """All final outputs of the study."""
        files = [str(self.results.report), str(self.results.resolved), *self.whole_tables]
        files += [*self.tables, *self.subject_pages]
        return [*files, *self.figures, *self.exports, *self.export_folders, *self.plans]


def _options(values: Mapping[str, Any]) -> str:
    """Return values by name as options in a shell command, without those that are empty."""
    options = [f"{option_of(name)}={value}" for name, value in values.items() if value not in ("", None)]
    return shlex.join(options)


def import_options(recording: Recording) -> list[str]:
    """Return the options that describe a recording of a plan to the command that imports it."""
    source = recording.source
    values = {
        "in": _relative(source.file),
        "layout": str(source.layout),
        "format": source.format,
        "mapping": None if source.mapping is None else _relative(source.mapping),
        **recording.key,
    }
    repair = ["--repair-hemisphere"] if source.hemisphere == "repair" else []
    return [f"--{name}={value}" for name, value in values.items() if value] + repair


def _declarable(paths: Sequence[str]) -> list[str]:
    """Return those of the files that exist and whose paths Snakemake accepts."""
    return [path for path in paths if _can_be_declared(path) and Path(path).is_file()]


def _can_be_declared(path: str) -> bool:
    """Return whether Snakemake takes a path literally; it cannot escape wildcards and variables in one."""
    return not re.search(r"\{.*\}|<[a-z][a-z0-9_]*>", path)


def _relative(path: str | Path) -> str:
    """Return a path relative to the working directory; files of an installed program keep absolute paths."""
    if Path(path).is_relative_to(CONFIG_FOLDER) and not CONFIG_FOLDER.is_relative_to(Path.cwd()):
        return Path(path).as_posix()
    return Path(os.path.relpath(path)).as_posix()
