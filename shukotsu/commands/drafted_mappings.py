"""Mappings drafted for a folder of recordings: one for all files that are alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shukotsu.commands.inspect_file import describe
from shukotsu.errors import InputError
from shukotsu.readers.inspection.description import CHECK
from shukotsu.study.config_files import loaded_yaml
from shukotsu.study.layout import Layout


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
        if not text:
            continue
        config = loaded_yaml(text, str(recording))
        number = next((n for n, (_, other, _) in enumerate(groups) if _alike(config, other)), len(groups))
        if number == len(groups):
            groups.append((text, config, []))
        first, _, alike = groups[number]
        alike.append(recording)
        if text.count(CHECK) < first.count(CHECK):
            groups[number] = text, config, alike
    names = ["mapping.yaml", *(f"mapping-{number}.yaml" for number in range(2, len(groups) + 1))]
    of = {each: name for name, (_, _, alike) in zip(names, groups, strict=False) for each in alike}
    return Drafts({name: text for name, (text, _, _) in zip(names, groups, strict=False)}, of, refused)


def _alike(first: Any, second: Any) -> bool:
    """Whether two drafts say the same, but for what either leaves open."""
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return first.keys() == second.keys() and all(_alike(first[key], second[key]) for key in first)
    return first == second or CHECK in (first, second)
