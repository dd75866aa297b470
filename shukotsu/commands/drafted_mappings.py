"""Mappings drafted for a folder of recordings: one for all files that are alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.schemas.config_files import loaded_yaml
from shukotsu.schemas.layout import Layout
from shukotsu.stages.capture.inspect_file import describe
from shukotsu.stages.capture.inspection.description import CHECK


@dataclass(frozen=True)
class Drafts:
    """Mappings to edit: texts by file's name; of recordings, the name, or why one is refused."""

    texts: dict[str, str]
    of: dict[Path, str]
    refused: dict[Path, str]


def draft_mappings(
    recordings: Sequence[Path], layout: Layout, inspected: Callable[[int], None] = lambda _: None
) -> Drafts:
    """Draft a mapping for every recording that needs one; inspected : told how many have been looked at.

    Files are alike where their drafts say the same; what one leaves open may be settled in another.
    """
    groups: list[tuple[str, Any, list[Path]]] = []
    refused = {}
    for count, recording in enumerate(recordings, 1):
        try:
            text = describe(recording, layout).draft
        except InputError as error:
            refused[recording], text = str(error), ""
        inspected(count)
        if text:
            _join(groups, text, recording)
    names = ["mapping.yaml", *(f"mapping-{number}.yaml" for number in range(2, len(groups) + 1))]
    of = {each: name for name, (_, _, own) in zip(names, groups, strict=False) for each in own}
    return Drafts({name: text for name, (text, _, _) in zip(names, groups, strict=False)}, of, refused)


def _join(groups: list[tuple[str, Any, list[Path]]], text: str, recording: Path) -> None:
    """Put a recording into the group of drafts like its own, or begin one."""
    config = loaded_yaml(text, str(recording))
    for place, (first, known, own) in enumerate(groups):
        if _alike(config, known):
            own.append(recording)
            if text.count(CHECK) < first.count(CHECK):
                groups[place] = text, config, own
            return
    groups.append((text, config, [recording]))


def _alike(one: Any, other: Any) -> bool:
    """Whether two drafts say the same, but for what either leaves open."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    return one == other or CHECK in (one, other)
