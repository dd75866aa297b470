"""Targets, each in a process of its own: so many inputs, guided by coverage where atheris is installed.

All is imported once, and a target is a fork. Each input and what came of it so far stands in a file that both
processes map, so that it is known which input a process died of.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import mmap
import os
import random
import re
import resource
import signal
import struct
import sys
import time
import traceback
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

try:
    import atheris
except ImportError:  # no wheel for this Python
    atheris = None

if TYPE_CHECKING:
    from fuzzing.targets import Target

INSTRUMENTED = (
    "schemas",
    "skeleton",
    "stages",
    "trackers",
    "checks",
    "anatomy",
    "pyxdf",
    "yaml",
    "jsonschema",
)
LONGEST_S = 10.0
"""Of a processor, for one input."""
MEMORY_BYTES, MEMORY_PER_BYTE = 300 * 10**6, 4
STALLED_S = 300.0
"""Of the clock without a finished input: what its own limit of processor time does not stop either."""
MOST_RESTARTS = 20
ROUND_INPUTS = 20_000
LEFT_BYTES = 3 << 30
"""Address space beyond what is there at the start: what asks for more gets a MemoryError."""
MOST_LETTERS = 1 << 20
"""Of an input."""
_ROOT = Path(__file__).parents[2]


class Hang(BaseException):
    """An input took longer than LONGEST_S."""


class Progress:
    """What a worker says of itself, in a file in memory: counts, and the input that it works on."""

    _FORM = struct.Struct("<8q")
    NAMES = ("done", "failures", "crashed", "hangs", "memory_kb", "start_kb", "edges", "size")

    def __init__(self, path: Path) -> None:
        size = self._FORM.size + MOST_LETTERS
        with path.open("a+b") as file:
            file.truncate(size)
            self._mapped = mmap.mmap(file.fileno(), size)

    def get(self) -> dict[str, int]:
        """All counts by name."""
        return dict(zip(self.NAMES, self._FORM.unpack_from(self._mapped), strict=True))

    def set(self, **counts: int) -> None:
        """Change some counts."""
        self._FORM.pack_into(self._mapped, 0, *(self.get() | counts).values())

    def begin(self, data: bytes) -> None:
        """Keep the input that is next."""
        at = self._FORM.size
        self._mapped[at - 8 : at] = len(data).to_bytes(8, "little")
        self._mapped[at : at + len(data)] = data

    def finish(self) -> int:
        """Count the input; give how many there are."""
        done = int.from_bytes(self._mapped[:8], "little") + 1
        self._mapped[:8] = done.to_bytes(8, "little")
        return done

    @property
    def data(self) -> bytes:
        """The input that was begun last."""
        at = self._FORM.size
        return bytes(self._mapped[at : at + self.get()["size"]])


def peak_kb() -> int:
    """The most memory that this process held at a time."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


class Fuzzer:
    """Feeds inputs to a target, and keeps those that fail in a folder."""

    def __init__(self, name: str, target: Target, folder: Path, progress: Progress) -> None:
        self._name, self._target, self._folder, self._progress = name, target, folder, progress
        self._peak_kb = peak_kb()
        self._failed: set[str] = set()
        progress.set(start_kb=progress.get()["start_kb"] or self._peak_kb)

    def take(self, data: bytes) -> int:
        """Check an input; give how many there were."""
        data = data[:MOST_LETTERS]
        self._progress.begin(data)
        signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
        try:
            self._target.check(data)
        except Hang:
            self._fail(data, "hang", f"more than {LONGEST_S:g} s")
        except (KeyboardInterrupt, GeneratorExit):
            raise
        except BaseException as error:
            place = "".join(traceback.format_exception(error))
            self._fail(data, _where(error), place)
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0)
        peak = peak_kb()
        if peak > self._peak_kb:
            if (peak - self._peak_kb) * 1024 > MEMORY_BYTES + MEMORY_PER_BYTE * len(data):
                self._fail(data, "memory", f"{(peak - self._peak_kb) / 1024:.0f} MB")
            self._peak_kb = peak
            self._progress.set(memory_kb=max(self._progress.get()["memory_kb"], peak))
        return self._progress.finish()

    def _fail(self, data: bytes, kind: str, said: str) -> None:
        """Count a failure; keep the first input of each kind, and print its file's name."""
        count = "hangs" if kind == "hang" else "failures"
        self._progress.set(**{count: self._progress.get()[count] + 1})
        if kind not in self._failed:
            self._failed.add(kind)
            path = keep(self._folder, self._name, data, f"{kind}\n{said}")
            os.write(1, f"{path} {kind}\n".encode())


def keep(folder: Path, name: str, data: bytes, said: str) -> Path:
    """Write an input that failed, and why beside it; give its file."""
    path = folder / name.replace(" ", "_") / sha256(data).hexdigest()[:12]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    path.with_suffix(".txt").write_text(said, "utf-8", "backslashreplace")
    return path


def _where(error: BaseException) -> str:
    """Kind of an exception and the innermost line of this project that it passed: one defect, one name."""
    own = [f for f in traceback.extract_tb(error.__traceback__) if f.filename.startswith(str(_ROOT))]
    frames = [f for f in own if "/.venv" not in f.filename and "/tests/" not in f.filename] or own
    place = f"{Path(frames[-1].filename).relative_to(_ROOT)}:{frames[-1].lineno}" if frames else ""
    return f"{type(error).__name__} {place}"


def _raise_hang(*_: Any) -> None:
    raise Hang


def _limit_memory() -> None:
    used = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + LEFT_BYTES, most))


@dataclass(frozen=True)
class Job:
    """A target and how it is to be run; folder : for inputs that fail, scratch : for counts."""

    name: str
    inputs: int
    seed: int
    folder: Path
    scratch: Path

    @property
    def progress(self) -> Progress:
        """The target's counts."""
        return Progress(self.scratch / "progress")


def main(argv: list[str]) -> int:
    """Run targets in turn; print a JSON object for each."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing.worker", description=__doc__)
    parser.add_argument("--inputs", type=int, default=1000, help="of all targets together (1000)")
    parser.add_argument("--targets", nargs="*", default=[], help="these alone")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="by the clock, at most")
    parser.add_argument("--folder", type=Path, default=Path("failed-inputs"), help="for inputs that fail")
    arguments = parser.parse_args(argv)
    deadline = time.monotonic() + 60 * arguments.minutes
    with atheris.instrument_imports(include=[*INSTRUMENTED]) if atheris else contextlib.nullcontext():
        from fuzzing import targets

        names = arguments.targets or list(targets.TARGETS)
        shares = {name: targets.target(name).share for name in names}
        for name in names:  # imports what readers import when they are called
            with contextlib.suppress(Exception):
                targets.target(name).check(targets.target(name).seeds[0])
    counts = inputs_of(shares, arguments.inputs)
    outcomes: dict[str, dict[str, int]] = {}
    rounds = max(1, arguments.inputs // ROUND_INPUTS)
    for number in range(1, rounds + 1):  # so that every target has its share wherever the time ends
        for name, count in counts.items():
            scratch = targets.scratch() / "work" / name.replace(" ", "_")
            scratch.mkdir(parents=True, exist_ok=True)
            job = Job(name, -(-count * number // rounds), arguments.seed, arguments.folder, scratch)
            outcomes[name] = supervised(job, deadline)
            print(f"{name}: {outcomes[name]}", file=sys.stderr, flush=True)
    print(json.dumps({"guided": atheris is not None, "outcomes": outcomes}))
    return 0


def inputs_of(shares: Mapping[str, float], inputs: int) -> dict[str, int]:
    """How many inputs each target gets by its share, at least 1."""
    total = sum(shares.values())
    counts = {name: max(1, int(inputs * share / total)) for name, share in shares.items()}
    first = max(shares, key=lambda name: shares[name])
    counts[first] += max(0, inputs - sum(counts.values()))
    return counts


def supervised(job: Job, deadline: float) -> dict[str, int]:
    """Feed a target in a fork, in a new one after each crash; what one died of is kept."""
    progress = job.progress
    while progress.get()["done"] < job.inputs and time.monotonic() < deadline:
        counts = progress.get()
        if counts["crashed"] + counts["hangs"] >= MOST_RESTARTS:
            break
        child = os.fork()
        if not child:
            _be_target(job)
        stalled, code = _waited(child, progress, deadline)
        counts = progress.get()
        if code == 0 or (code is None and not stalled):
            break
        what = "hangs" if stalled else "crashed"
        log = (job.scratch / "log").read_text("utf-8", "replace")[-4000:]
        print(keep(job.folder, job.name, progress.data, log), what, code, file=sys.stderr, flush=True)
        progress.set(**{what: counts[what] + 1, "done": counts["done"] + 1})
    text = (job.scratch / "log").read_text("utf-8", "replace") if (job.scratch / "log").is_file() else ""
    edges = [int(count) for count in re.findall(r"cov: (\d+)", text)]
    progress.set(edges=max([progress.get()["edges"], *edges]))
    return progress.get()


def _waited(child: int, progress: Progress, deadline: float) -> tuple[bool, int | None]:
    """Wait for a fork's end; whether it was killed because it stalled, and its exit code, None if killed."""
    last, since = -1, time.monotonic()
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return False, os.waitstatus_to_exitcode(status)
        now, done = time.monotonic(), progress.get()["done"]
        if done != last:
            last, since = done, now
        if now > deadline or now - since > STALLED_S:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return now - since > STALLED_S, None
        time.sleep(0.05)


def _be_target(job: Job) -> None:
    """Feed the target, and end this process."""
    code = 1
    try:
        os.dup2(os.open(job.scratch / "log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        from fuzzing.targets import target

        own = target(job.name)
        fuzzer = Fuzzer(job.name, own, job.folder, job.progress)
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ResourceWarning)
        signal.signal(signal.SIGPROF, _raise_hang)
        _limit_memory()
        if not job.progress.get()["done"]:
            for seed in own.seeds[: job.inputs]:
                fuzzer.take(seed)
        (_guided if atheris else _random)(job, own, fuzzer)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _random(job: Job, _: Target, fuzzer: Fuzzer) -> None:
    """Feed damaged seeds."""
    from fuzzing.targets import random_input

    number = job.progress.get()["done"]
    while number < job.inputs:
        number = fuzzer.take(random_input(job.name, job.seed, number))


def _guided(job: Job, target: Target, fuzzer: Fuzzer) -> None:
    """Let libFuzzer choose the inputs to change: those that reached new code. It ends the process."""

    def change(data: bytes, most: int, seed: int) -> bytes:
        chance = random.Random(seed)
        kind = chance.randrange(4)
        if kind == 0:
            return atheris.Mutate(data, most)
        return target.damage(chance.choice(target.seeds) if kind == 1 else data, chance)[:most]

    def take(data: bytes) -> None:
        if fuzzer.take(data) >= job.inputs:
            os._exit(0)

    counts = job.progress.get()
    if counts["done"] >= job.inputs:
        return
    corpus = job.scratch / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, seed in enumerate(target.seeds):
        (corpus / f"seed{number}").write_bytes(seed)
    options = {
        "runs": job.inputs,
        "seed": job.seed + counts["done"] + counts["crashed"] + counts["hangs"],
        "max_len": max(4096, 2 * max(map(len, target.seeds))),
        "mutate_depth": 1,
        "timeout": 10_000,  # of the clock; see LONGEST_S
        "rss_limit_mb": 0,
        "reload": 0,
        "report_slow_units": 10_000,
        "artifact_prefix": f"{job.scratch}/",
    }
    argv = [sys.argv[0], *(f"-{key}={value}" for key, value in options.items()), str(corpus)]
    atheris.Setup(argv, take, custom_mutator=change)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
