"""Names for the receivers of a drafted mapping, made of what the file calls them."""

from __future__ import annotations

import re
from collections.abc import Iterable

UNKNOWN = "CHECK"
"""Stands in a draft where the file does not say; no mapping with it in is read."""


def draft_receivers(names: Iterable[str], key: str) -> dict[str, dict[str, str]]:
    """Put every name under `key` of a receiver whose own name a segment may have; none is lost."""
    found: dict[str, dict[str, str]] = {}
    for name in names:
        bare = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        stem = bare if bare[:1].isalpha() else f"receiver_{bare}".rstrip("_")
        segment, count = stem, 1
        while segment in found:
            count += 1
            segment = f"{stem}_{count}"
        found[segment] = {key: name}
    return found
