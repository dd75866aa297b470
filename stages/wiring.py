"""What the Snakefile asks of a study: which files a job reads, and the words of its command line."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from schemas.config_files import read_config
from schemas.errors import InputError
from schemas.model import read_model
from schemas.results import HAND_TABLES, STUDY_TABLES, Results
from schemas.study import Hand, Recording, Study, path_token, read_participants, read_study

Wildcards = Any
"""Snakemake's wildcards: attributes subject, hand, recording, model, as they stand in paths."""


class Wiring:
    """One study, asked by the wildcards of a job."""

    def __init__(self, study_file: Path) -> None:
        self.file = _relative(study_file)
        self.study: Study = read_study(Path(self.file))
        self.results = Results.of(self.study.name)
        self.models = {name: _relative(path) for name, path in self.study.models.items()}
        self._hand_length_mm = {
            row["subject"]: row["hand_length_mm"]
            for row in read_participants(self.study.sheets.get("participants"))
        }
        self._hands = {(path_token(h.subject), h.hand): h for h in self.study.hands}
        self._recordings = {
            (path_token(r.hand.subject), r.hand.hand, r.name): r for r in self.study.recordings
        }

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
        return cls(path)

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
        hand = self._hands[wildcards.subject, wildcards.hand]
        seed = str(self.study.simulation.seed)
        return shlex.join(
            ["--subject", hand.subject, "--hand", hand.hand, "--task", wildcards.task, "--seed", seed]
        )

    # --- capture --------------------------------------------------------------------------------------

    def recording_file(self, wildcards: Wildcards) -> list[str]:
        """The recording, if it is there or can be simulated; a missing one must not stop the others."""
        recording = self._recording(wildcards)
        names = {"subject": wildcards.subject, "hand": wildcards.hand, "task": recording.task}
        file = _relative(recording.file)
        made = [path.format(**names) for path in (self.simulated, self.streamed)]
        return [file] if recording.file.exists() or file in made else []

    def mapping(self, wildcards: Wildcards) -> list[str]:
        """The recording's mapping, if it has one and it is there; a missing one must not stop the others."""
        mapping = self._recording(wildcards).mapping
        return [_relative(mapping)] if mapping is not None and mapping.exists() else []

    def capture(self, wildcards: Wildcards) -> str:
        """Words of capture's command line."""
        r = self._recording(wildcards)
        words = {"in": _relative(r.file), "layout": _relative(r.layout), "format": r.format}
        words |= {} if r.mapping is None else {"mapping": _relative(r.mapping)}
        words |= {"subject": r.hand.subject, "hand": r.hand.hand, "task": r.task, "trial": r.trial}
        repair = ["--repair-hemisphere"] if r.hemisphere == "repair" else []
        return shlex.join([*(f"--{name}={word}" for name, word in words.items()), *repair])

    # --- a hand under a model ---------------------------------------------------------------------------

    def model(self, wildcards: Wildcards) -> str:
        """The skeleton model's file."""
        return self.models[wildcards.model]

    def layout(self, wildcards: Wildcards) -> str:
        """The hand's layout file."""
        return _relative(self.study.layout_of(self._hand(wildcards)))

    def calibration(self, wildcards: Wildcards) -> list[str]:
        """Poses that the hand's joints are solved from under this model."""
        model = read_model(Path(self.models[wildcards.model]).absolute())
        return self._poses(self.study.calibrating(self._hand(wildcards), model.calibration))

    def evaluated(self, wildcards: Wildcards) -> list[str]:
        """Poses that the hand's tips are evaluated on."""
        return self._poses(self.study.evaluated(self._hand(wildcards)))

    def whose(self, wildcards: Wildcards) -> str:
        """Words that say whose hand it is, and how long, where the participants sheet has it."""
        hand = self._hand(wildcards)
        length_mm = self._hand_length_mm.get(hand.subject)
        words = [] if length_mm is None else [f"--hand-length-mm={length_mm:g}"]
        return shlex.join([f"--subject={hand.subject}", f"--hand={hand.hand}", *words])

    def corrections(self, wildcards: Wildcards) -> list[str]:
        """The sheet of corrections, for a model that applies it."""
        model = read_model(Path(self.models[wildcards.model]).absolute())
        sheet = self.study.sheets.get("corrections")
        return [_relative(sheet)] if sheet is not None and model.corrections else []

    # --- the study --------------------------------------------------------------------------------------

    hand_tables = tuple(HAND_TABLES)
    study_tables = STUDY_TABLES

    @property
    def poses(self) -> list[str]:
        """Poses of every recording that is not excluded."""
        return self._poses(recording for recording in self.study.recordings if not recording.exclude)

    def of_every_hand(self, table: str) -> list[str]:
        """One table of every hand under every model."""
        return [
            str(self.results.hand_table(model, hand, table))
            for model in self.models
            for hand in self.study.hands
        ]

    @property
    def configuration(self) -> list[str]:
        """The study file and its sheets."""
        return [self.file, *map(_relative, self.study.sheets.values())]

    def _hand(self, wildcards: Wildcards) -> Hand:
        return self._hands[wildcards.subject, wildcards.hand]

    def _recording(self, wildcards: Wildcards) -> Recording:
        return self._recordings[wildcards.subject, wildcards.hand, wildcards.recording]

    def _poses(self, recordings: Iterable[Recording]) -> list[str]:
        return [str(self.results.poses(recording)) for recording in recordings]


def _as_written(path: Path) -> dict[str, Any]:
    return read_config(path, "study", with_defaults=False)


def _relative(path: str | Path) -> str:
    return os.path.relpath(path)
