"""One stream of random numbers per purpose, so that no switch and no length shifts another's numbers."""

from __future__ import annotations

import hashlib

import numpy as np


def generator(seed: int, purpose: str, *names: str) -> np.random.Generator:
    """The generator of a purpose for those names (subject, hand, task); same names, same numbers."""
    digest = hashlib.sha256("\x1f".join((purpose, *names)).encode()).digest()
    entropy = np.frombuffer(digest, "<u4")
    return np.random.default_rng(np.random.SeedSequence([seed, *(int(number) for number in entropy)]))
