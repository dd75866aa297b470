"""Identifiers of rows: subject, session and hand, and their names in paths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from shukotsu.tables.limits import NAMES_BYTES
from shukotsu.translation import tr

REPETITIONS = 20
"""Number of repetitions at the end of a name from which Snakemake assumes a rule that depends on itself."""


def path_token(text: str) -> str:
    """Convert a name to one component of a path: letters (of any script), digits, '-' and '_' are kept.

    All other characters become %XX (UTF-8 bytes), so that different names have different paths. In a name
    that ends in REPETITIONS of a sequence the last character becomes %%XX.
    """
    coded = ["".join(f"%{byte:02X}" for byte in letter.encode()) for letter in text]
    safe = [c if c.isalnum() or c in "-_" else code for c, code in zip(text, coded, strict=True)]
    token = "".join(safe)
    lengths = range(1, NAMES_BYTES // REPETITIONS + 1)
    if any(len(token) >= n * REPETITIONS and token.endswith(token[-n:] * REPETITIONS) for n in lengths):
        safe[-1] = f"%{coded[-1]}"
    return "".join(safe)


class SubjectSession(NamedTuple):
    """Subject and session of a skeleton; the session is "" if the study has no sessions."""

    subject: str
    session: str = ""

    @property
    def token(self) -> str:
        """Name in paths, after `sub-`."""
        return path_token(self.subject) + (f"_ses-{path_token(self.session)}" if self.session else "")

    @property
    def label(self) -> str:
        """Subject, and session if there is one."""
        return f"{self.subject}, session {self.session}" if self.session else self.subject

    def __str__(self) -> str:
        named = tr("subject {subject}", subject=self.subject)
        return named + (tr(", session {session}", session=self.session) if self.session else "")


@dataclass(frozen=True)
class Hand:
    """One hand of a subject, in one session if the study has sessions."""

    subject: str
    hand: str
    session: str = ""

    @property
    def who(self) -> SubjectSession:
        """Subject and session."""
        return SubjectSession(self.subject, self.session)

    @property
    def folder(self) -> str:
        """Folder below the results of the study."""
        return f"sub-{self.who.token}/{self.hand}"

    def __str__(self) -> str:
        return tr("{who}, {hand} hand", who=str(self.who), hand=self.hand)
