"""What became of a fault that was tried so often."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from typing import NamedTuple

KILLS = "SIGKILL"
SAME_BYTES = "nothing lost or half written; the same command completes, same bytes"
REFUSED = "one sentence and exit 2, or complete; then as above"


class Limit(NamedTuple):
    """How often to kill: so many times, and not after a time of the system's monotonic clock."""

    kills: int
    end_s: float = math.inf

    def reached(self, killed: int) -> bool:
        """Whether that many are enough, or the time is up."""
        return killed >= self.kills or self.is_over

    @property
    def is_over(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.end_s


class Row(NamedTuple):
    """A row of the table; failed is None where the fault could not be tried, and promised then says why."""

    fault: str
    tried: int
    failed: int | None
    promised: str


@dataclass
class Tries:
    """Counts tries; each failure is printed as it happens."""

    fault: str
    promised: str = SAME_BYTES
    tried: int = 0
    failed: int = 0

    def add(self, problem: str) -> None:
        """Count a try; problem : what was not as promised, empty where all was."""
        self.tried += 1
        if problem:
            self.failed += 1
            print(f"FAILED: {self.fault}: {problem[-1500:]}", file=sys.stderr, flush=True)

    def row(self) -> Row:
        """The row of all tries."""
        return Row(self.fault, self.tried, self.failed, self.promised)


def not_tried(fault: str, why: str) -> Row:
    """The row of a fault that could not be tried on this machine."""
    return Row(fault, 0, None, f"not tried: {why}")
