"""Feed a target damaged input within bounds of time and memory: `-m fuzzing.feed NAME INPUTS SEED FOLDER`.

A process of its own, so that what ends it ends no test; the input that it works on lies in FOLDER.
"""

from __future__ import annotations

import resource
import signal
import sys
import warnings
from pathlib import Path

from fuzzing.targets import random_input, target

LONGEST_S = 10.0
"""Of a processor, for one input."""
MEMORY_BYTES, MEMORY_PER_BYTE = 300 * 10**6, 4
LEFT_BYTES = 3 << 30
"""Address space beyond what is there at the start: what asks for more gets a MemoryError."""


def feed(name: str, inputs: int, seed: int, folder: Path) -> None:
    """Feed so many inputs; raises what the target raises, AssertionError for too much memory."""
    own, kept = target(name), folder / name.replace(" ", "_")
    own.check(own.seeds[0])  # imports what readers import when they are called
    _limit_memory()
    peak = _peak_bytes()
    for number in range(inputs):
        data = random_input(name, seed, number)
        kept.write_bytes(data)
        signal.setitimer(signal.ITIMER_PROF, LONGEST_S)  # its signal ends the process
        own.check(data)
        signal.setitimer(signal.ITIMER_PROF, 0)
        before, peak = peak, _peak_bytes()
        assert peak - before <= MEMORY_BYTES + MEMORY_PER_BYTE * len(data), f"{peak - before} bytes"
    kept.unlink(missing_ok=True)


def _peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _limit_memory() -> None:
    used = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + LEFT_BYTES, most))


if __name__ == "__main__":
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ResourceWarning)
    feed(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
