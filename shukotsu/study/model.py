"""A skeleton model: one YAML file that states how each stage treats the joints and the metacarpals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.study.config_files import config_path, read_config
from shukotsu.tables.digests import file_state


@dataclass(frozen=True)
class JointSolving:
    """The group `joints` of a model file: how joints are solved and from which recordings."""

    solver: str
    singular_values: int
    calibration: str


@dataclass(frozen=True)
class Planes:
    """The group `planes`: whether and how planes cut the joints' axes."""

    cut: bool
    parallel_limit_deg: float
    corrections: bool


@dataclass(frozen=True)
class HandFitting:
    """The group `fit` of a model that fits the whole hand at once."""

    share_lengths: bool
    contacts: tuple[str, ...]
    frames: int
    steps: int


@dataclass(frozen=True)
class MetacarpalPosing:
    """The group `metacarpals`: how the metacarpals are posed."""

    unmeasured: str
    measured: str
    twist_factor: float
    rest_direction: tuple[float, float, float]


@dataclass(frozen=True)
class SkeletonModel:
    """The content of a model file, in the groups and keys of `json/model.schema.json`.

    A stage is passed its whole group, so that it cannot miss a key. fitting : None for a model that solves
    joints one by one.
    """

    name: str
    description: str
    paper_table: int | None
    joints: JointSolving
    planes: Planes
    fitting: HandFitting | None
    wrist: str
    own_cmc: tuple[str, ...]
    metacarpals: MetacarpalPosing

    @property
    def solving(self) -> JointSolving:
        """How to solve the joints one by one.

        For a model that fits the whole hand: the closed form with all six singular values. Its solutions only
        provide each joint's gap and number of frames.
        """
        free = replace(self.joints, solver="closed", singular_values=6)
        return self.joints if self.fitting is None else free

    @property
    def is_reference(self) -> bool:
        """Whether the model is the average hand, fitted in no steps and so independent of the data."""
        return self.fitting is not None and not self.fitting.steps


def paper_skeleton(models: Iterable[SkeletonModel]) -> str:
    """Return the name of the paper's skeleton, or an empty string if the models do not include it.

    It is the model of the paper's last table that uses no manual corrections. The model of the first table
    leaves the metacarpals at rest and is centimetres worse than all others, so it is not a useful baseline.
    """
    of_table = {
        model.paper_table: model.name
        for model in models
        if model.paper_table is not None and not model.planes.corrections
    }
    return of_table[max(of_table)] if of_table else ""


def read_model(name: str | Path, folder: Path = Path()) -> SkeletonModel:
    """Read a model by name or path (relative to `folder`). Raises InputError if it is missing or invalid."""
    path = config_path(str(name), "model", folder)
    return _read(path, *file_state(path))


@lru_cache(maxsize=32)
def _read(path: Path, *_: int) -> SkeletonModel:
    config = read_config(path, "model")
    if config["model"] != path.stem:
        raise InputError(
            f"{path}: model: is {config['model']!r}; expected the name of the file, {path.stem!r}"
        )
    return model_from_config(config, str(path))


def model_from_config(config: dict[str, Any], where: str) -> SkeletonModel:
    """Build a model from the content of a file that matches its schema.

    where : name of the file for messages. Raises InputError if the settings contradict each other.
    """
    joints, planes, metacarpals = config["joints"], config["planes"], config["metacarpals"]
    if planes["corrections"] and not planes["cut"]:
        raise InputError(f"{where}: planes.corrections: is true, but planes.cut: false makes centres final")
    fit = dict(config["fit"])
    whole_hand = fit.pop("whole_hand")
    _check_fit(where, config, whole_hand=whole_hand)
    if not any(metacarpals["rest_direction"]):
        raise InputError(f"{where}: metacarpals.rest_direction: has no length")
    return SkeletonModel(
        name=config["model"],
        description=config["description"],
        paper_table=config.get("paper_table"),
        joints=JointSolving(**joints),
        planes=Planes(**planes),
        fitting=HandFitting(**_with_tuples(fit)) if whole_hand else None,
        wrist=config["wrist"],
        own_cmc=tuple(config["own_cmc"]),
        metacarpals=MetacarpalPosing(**_with_tuples(metacarpals)),
    )


def _with_tuples(group: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in group.items()}


def _check_fit(where: str, config: dict[str, Any], *, whole_hand: bool) -> None:
    """Raise InputError if planes or metacarpals are incompatible with the model's `fit.whole_hand`."""
    fitted = [key for key in ("unmeasured", "measured") if config["metacarpals"][key] == "fitted"]
    if fitted and not whole_hand:
        raise InputError(
            f"{where}: metacarpals.{fitted[0]}: is fitted, but no whole hand is fitted; write fit: "
            "{whole_hand: true}"
        )
    if whole_hand and config["planes"]["cut"]:
        raise InputError(
            f"{where}: planes.cut: is true; a fit of the whole hand places its joints itself, so write "
            "planes: {cut: false}"
        )
    if whole_hand and len(fitted) < 2:
        raise InputError(
            f"{where}: metacarpals: a fit of the whole hand poses them all; write metacarpals: "
            "{unmeasured: fitted, measured: fitted}"
        )
