"""A subject's plan as a file, written from the study by the workflow: `results/<study>/sub-S/plan.json`.

It contains the subject's recordings with their roles, the layout of each hand, the models, the hand's sizes
and the subject's rows of the sheets. Each session named in the recordings sheet has a separate plan,
`sub-S_ses-X/plan.json`. Paths in a plan are relative to the working directory.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.study.config_files import CONFIG_FOLDER, REFERENCE, config_path, read_config
from shukotsu.study.layout import layout_from_config
from shukotsu.study.model import model_from_config
from shukotsu.study.plan import SubjectPlan, rows_of_session
from shukotsu.study.sheets import HAND_SHEETS, SHEETS, Row, read_sheet
from shukotsu.study.study import SIZES, Recording, Source, Study
from shukotsu.tables.catalogue import FINDINGS
from shukotsu.tables.subjects import Hand, SubjectSession
from shukotsu.tables.text_files import read_text
from shukotsu.tables.whole_files import remedy_of

VERSION = 4


class StudyPlans:
    """Makes the plans of a study's subjects. results : the study's results folder."""

    def __init__(self, study: Study, results: Path) -> None:
        self._study, self._results = study, results
        self._models = [read_config(path, "model") for path in study.models.values()]
        layouts = {study.layout_of(hand) for hand in study.hands}
        self._layouts = {path: read_config(path, "layout") for path in layouts}
        names = ("participants", *HAND_SHEETS)
        self._rows: dict[str, dict[str, list[dict[str, Any]]]] = {name: {} for name in names}
        for name in names:
            for row in read_sheet(study.sheets.get(name), SHEETS[name]):
                self._rows[name].setdefault(row["subject"], []).append(dict(row.values))

    def content(self, subject: str, session: str = "") -> dict[str, Any]:
        """Return a subject's plan in JSON types."""
        study = self._study.of_session(subject, session)
        wanted_mm = study.config["wanted_mm"]
        sizes = next(iter(self._rows["participants"].get(subject, [])), {})
        return {
            "plan": VERSION,
            "study": study.name,
            "subject": subject,
            "session": session,
            "folder": (self._results / f"sub-{SubjectSession(subject, session).token}").as_posix(),
            "sizes_mm": {name: sizes.get(name) for name in SIZES},
            "factors": {name: sizes[name] for name in study.factors if name in sizes},
            "recordings": [_recording(recording, study) for recording in study.recordings],
            "layouts": {
                hand.hand: self._layouts[path := study.layout_of(hand)]
                | {"wanted_mm": wanted_mm or self._layouts[path]["wanted_mm"]}
                for hand in study.hands
            },
            "models": self._models,
            **{
                name: rows_of_session(self._rows[name].get(subject, []), SHEETS[name], session)
                for name in HAND_SHEETS
            },
            "sheets": {name: _relative(study.sheets[name]) for name in HAND_SHEETS if name in study.sheets},
        }


def recordings_part(plan: Mapping[str, Any]) -> dict[str, Any]:
    """Return only the entries of a plan that describe recordings: no models, sizes, factors, measurements."""
    names = ("plan", "subject", "session", "folder", "events")
    recordings = [entry | {"factors": {}} for entry in plan["recordings"]]
    layouts = {hand: layout | {"wanted_mm": None} for hand, layout in plan["layouts"].items()}
    return {name: plan[name] for name in names} | {"recordings": recordings, "layouts": layouts}


def fit_part(plan: Mapping[str, Any], hand: str, model: str) -> dict[str, Any]:
    """Return the part of a plan that a whole-hand fit depends on.

    hand : the hand that is fitted, or empty if one job fits both. Entries of the other hand are left out
    unless the model shares bone lengths between the hands.
    """
    part = recordings_part(plan)
    for entry in part["recordings"]:
        entry |= {"events": None, "pulses": ""}
    part |= {name: plan[name] for name in ("sizes_mm", "measurements", "touches")} | {"events": []}
    reference = read_config(config_path(REFERENCE, "model", Path()), "model")
    config = next(config for config in [*plan["models"], reference] if config["model"] == model)
    if hand and not config["fit"]["share_lengths"]:
        for name in ("recordings", "measurements", "touches"):
            part[name] = [row for row in part[name] if row["hand"] == hand]
        part["layouts"] = {hand: part["layouts"][hand]}
    return part | {"models": [config]}


def _recording(recording: Recording, study: Study) -> dict[str, Any]:
    ships = recording.source.layout.parent == CONFIG_FOLDER / "layouts"
    entry = {
        name: _relative(value) if isinstance(value, Path) else value
        for name, value in {**vars(recording), **vars(recording.source)}.items()
        if name not in ("source", "more")
    }
    return entry | {
        "hand": recording.hand.hand,
        "layout": recording.source.layout.stem if ships else entry["layout"],
        "factors": {name: level for name, level in recording.factors if name in study.factors},
    }


def plan_text(plan: Mapping[str, Any]) -> str:
    """Return the text of a plan's file; equal plans give equal texts."""
    return json.dumps(plan, ensure_ascii=False, indent=1) + "\n"  # in the order of layouts and models


def plan_digest(*contents: Any) -> str:
    """Return a digest of parts of a plan, by which the workflow detects changes."""
    return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()[:16]


def read_plan(path: Path) -> SubjectPlan:
    """Read a subject's plan. Raises InputError if the file is missing, damaged or of another version."""
    try:
        remedy = "run the study to write the subject's plan"
        content = json.loads(read_text(path, "a subject's plan", remedy=remedy))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not a subject's plan ({error}); {remedy_of(path)}") from error
    if not isinstance(content, dict) or content.get("plan") != VERSION:
        raise InputError(f"{path}: not a subject's plan of version {VERSION}; {remedy_of(path)}")
    try:
        return plan_from_content(content, str(path))
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise InputError(f"{path}: a damaged plan; {remedy_of(path)}") from error


def plan_of_results(path: Path) -> SubjectPlan:
    """Read the plan in a subject's results, which may have been moved, and apply the findings beside it."""
    plan = replace(read_plan(path), folder=path.parent)
    findings = plan.table(FINDINGS.name)
    return plan.checked(findings) if findings.is_file() else plan


def plan_from_content(content: Mapping[str, Any], where: str) -> SubjectPlan:
    """Build a plan from the content of its file; `where` names the file in errors."""
    _check_texts(content)
    who = SubjectSession(content["subject"], content["session"])
    models = [model_from_config(config, where) for config in content["models"]]
    return SubjectPlan(
        study=content["study"],
        who=who,
        folder=Path(content["folder"]),
        sizes_mm=content["sizes_mm"],
        factors=content["factors"],
        recordings=tuple(_read_recording(entry, who) for entry in content["recordings"]),
        layouts={hand: layout_from_config(config, where) for hand, config in content["layouts"].items()},
        models={model.name: model for model in models},
        # without line numbers, which change when another subject's row is inserted above
        rows={name: tuple(Row(0, entry) for entry in content[name]) for name in HAND_SHEETS},
        sheets={name: Path(file) for name, file in content["sheets"].items()},
    )


def _check_texts(content: Mapping[str, Any]) -> None:
    """Raise TypeError, AttributeError or ValueError if names or paths are not text, or sizes not numbers."""
    named = [content[name] for name in ("study", "subject", "session", "folder")]
    named += [config["model"] for config in content["models"]]
    named += [*content["layouts"], *(config["layout"] for config in content["layouts"].values())]
    for entry in content["recordings"]:
        paths = {name: entry[name] or "" for name in ("mapping", "truth", "events")}
        named += {**entry, **paths, "factors": ""}.values()
        named += entry["factors"].values()
    for text in named:
        if "\0" in text.encode().decode():  # a lone surrogate cannot be encoded
            raise ValueError(f"{text!r} is not a valid name")
    for name in SIZES:
        float(content["sizes_mm"][name] or 0)


def _read_recording(entry: Mapping[str, Any], who: SubjectSession) -> Recording:
    paths = ("file", "layout", "mapping", "events", "truth")
    values = dict(entry) | {name: Path(entry[name]) for name in paths if entry[name] is not None}
    source = Source(**{part.name: values.pop(part.name) for part in fields(Source)})
    hand, factors = Hand(who.subject, values.pop("hand"), who.session), tuple(values.pop("factors").items())
    return Recording(hand=hand, source=source, factors=factors, **values)


def _relative(path: str | Path) -> str:
    return Path(os.path.relpath(path)).as_posix()
