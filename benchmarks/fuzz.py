"""Damaged byte streams and files: whether every decoder and reader takes them.

A decoder must give every byte of any stream to one record, reply or skip, the same however the stream is cut.
A reader must give samples, or InputError. Nothing may raise anything else, hang, crash or keep memory.
"""

from __future__ import annotations

import argparse
import copy
import json
import multiprocessing
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from benchmarks.benchmark_table import Cell, TextTable
from benchmarks.fuzz_decoding import check_decoder, check_settings
from benchmarks.fuzz_files import RECORDINGS, capture_bytes
from benchmarks.tracker_streams import streams
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.mapping import mapping_from_config
from stages.capture.formats.readers import find_reader
from stages.capture.samples import ReadingOptions
from trackers.archive import open_archive

Files = Mapping[str, bytes]

SHARES = {"file": 0.1, "file c3d": 0.05}
"""Of the runs, for files: they are slow, and every C3D file is read in a process of its own."""

PATIENCE_S = 60.0
WARM_UP = 200
"""Runs before memory is first looked at: modules are loaded by then, and caches filled."""
KEPT_FAILURES = 5

_TOKENS = (
    *(b"LY", b"PA", b"VPRP", b"VPRC", b"01", b"02  ", b"\r\n", b"nan", b"inf", b"1e999", b"-", b".", b","),
    *(bytes(4), b"\xff" * 4, b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\t", b'"', b"\xef\xbb\xbf", b"{}"),
)
_VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 2, 7, 16, 77, 10**400, 1e308, float("nan"), "", "viper", "ascii", "inch", "7"),
    *([], [1], {}, {"1": [2, 4]}),
)


def damage(data: bytes, chance: random.Random) -> bytes:
    """Change bytes in up to 8 places: other bits, other bytes, less, more, the same again, cut off."""
    out = bytearray(data)
    for _ in range(chance.randint(0, 8)):
        place = chance.randint(0, len(out))
        length = chance.choice((1, 1, 1, 2, 4, 8, chance.randint(0, 200)))
        kind = chance.randrange(8)
        if kind == 0 and place < len(out):
            out[place] ^= 1 << chance.randrange(8)
        elif kind == 1:
            out[place : place + length] = chance.randbytes(length)
        elif kind == 2:
            del out[place : place + length]
        elif kind == 3:
            out[place:place] = chance.randbytes(length)
        elif kind == 4:
            out[place:place] = out[place : place + length]
        elif kind == 5:
            out[place : place + length] = chance.choice(_TOKENS)
        elif kind == 6:
            first = chance.randint(0, len(out))
            out[place : place + length] = out[first : first + length]
        elif chance.randrange(8) == 0:
            del out[place:]
    return bytes(out)


def _damage_json(loaded: Any, chance: random.Random) -> None:
    """Change one value somewhere in lists and objects to one of another kind or size."""
    inside = loaded
    while True:
        keys = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
        if not keys:
            return
        key = chance.choice(keys)
        if isinstance(inside[key], dict | list) and chance.randrange(6):
            inside = inside[key]
            continue
        inside[key] = copy.deepcopy(chance.choice(_VALUES))
        return


@dataclass(frozen=True)
class Target:
    """What is fuzzed: `damaged` gives a case, `run` the name of its outcome or raises."""

    damaged: Callable[[random.Random], Files]
    run: Callable[[Files, random.Random], str]


def _decoder(name: str) -> Target:
    stream = streams()[name]
    return Target(
        lambda chance: {"stream": damage(stream.data, chance)},
        lambda files, chance: check_decoder(stream.settings, files["stream"], chance),
    )


def _settings() -> Target:
    clean = list(streams().values())

    def damaged(chance: random.Random) -> Files:
        stream = chance.choice(clean)
        settings = json.loads(json.dumps(stream.settings.to_json()))
        for _ in range(chance.randint(1, 3)):
            _damage_json(settings, chance)
        return {"settings.json": json.dumps(settings).encode(), "stream": stream.data[:400]}

    return Target(
        damaged, lambda files, chance: check_settings(files["settings.json"], files["stream"], chance)
    )


def _archive() -> Target:
    data = capture_bytes()
    folder = tempfile.TemporaryDirectory()

    def run(files: Files, _: random.Random) -> str:
        path = Path(folder.name, "a.arrows")
        path.write_bytes(files["a.arrows"])
        try:
            for piece in open_archive(path).pieces():
                assert len(piece.host_ns) == len(piece.kind) == len(piece.data)
        except InputError:
            return "refused"
        return "read"

    return Target(lambda chance: {"a.arrows": damage(data, chance)}, run)


def _reader(name: str) -> Target:
    recording = RECORDINGS[name]()
    layout = read_layout("liberty16")
    mapping = mapping_from_config(recording.mapping, "mapping.yaml") if recording.mapping else None
    folder = tempfile.TemporaryDirectory()

    def damaged(chance: random.Random) -> Files:
        chosen = chance.choice(sorted(recording.files))
        return {**recording.files, chosen: damage(recording.files[chosen], chance)}

    def run(files: Files, _: random.Random) -> str:
        for file, data in files.items():
            Path(folder.name, file).write_bytes(data)
        path = Path(folder.name, recording.path)
        try:
            samples = find_reader(path, "auto", mapping)(path, layout, ReadingOptions(mapping))
        except InputError as error:
            if "\n" in str(error):
                raise AssertionError("the sentence has several lines") from error
            return "refused"
        assert samples.numbers.shape == (len(samples.frame), 7)
        return "read"

    return Target(damaged, run)


TARGETS = (*streams(1), "settings", "archive", *(f"file {name}" for name in RECORDINGS))
"""Everything that is fuzzed, by name."""


@cache
def target(name: str) -> Target:
    """What a name of TARGETS stands for."""
    if name.startswith("file "):
        return _reader(name.removeprefix("file "))
    return {"settings": _settings, "archive": _archive}.get(name, lambda: _decoder(name))()


@dataclass(frozen=True)
class Run:
    """One case: what came of it, or how it failed, and the process's peak memory in MB after it."""

    outcome: str
    failure: str = ""
    peak_mb: float = 0.0


@dataclass
class Outcome:
    """What came of a target's runs; failures : run -> what happened."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[int, str] = field(default_factory=dict)
    seconds: float = 0.0
    peaks_mb: list[float] = field(default_factory=list)

    @property
    def grown_mb(self) -> float:
        """Growth of the peak memory after the warm-up."""
        return self.peaks_mb[-1] - self.peaks_mb[WARM_UP] if len(self.peaks_mb) > WARM_UP else 0.0

    def add(self, number: int, run: Run) -> None:
        """Count a run."""
        if run.failure:
            self.failures[number] = run.failure
        else:
            self.counts[run.outcome] += 1
        self.peaks_mb.append(max([run.peak_mb, *self.peaks_mb[-1:]]))


def chance_of(seed: int, name: str, run: int) -> random.Random:
    """The chance that decides about one run, the same every time."""
    return random.Random(f"{seed} {name} {run}")


def run_one(name: str, seed: int, number: int) -> Run:
    """Do one run in this process."""
    chance = chance_of(seed, name, number)
    files = target(name).damaged(chance)
    failure = outcome = ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            outcome = target(name).run(files, chance)
        except Exception:  # whatever it is, it is what is looked for
            failure = traceback.format_exc()
    return Run(outcome, failure, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def run_apart(
    name: str,
    seed: int,
    runs: int,
    work: Callable[[str, int, int], Run] = run_one,
    patience_s: float = PATIENCE_S,
    start: str = "spawn",
) -> Outcome:
    """Do runs in a process of their own; one that crashes or hangs is a failure, and the rest go on."""
    outcome, started = Outcome(), time.perf_counter()
    context = multiprocessing.get_context(start)
    pool = context.Pool(1)
    for number in range(runs):
        try:
            outcome.add(number, pool.apply_async(work, (name, seed, number)).get(patience_s))
        except multiprocessing.TimeoutError:
            outcome.add(number, Run("", f"crashed, or hung for {patience_s:g} s"))
            pool.terminate()
            pool = context.Pool(1)
    pool.terminate()
    outcome.seconds = time.perf_counter() - started
    return outcome


def runs_of(name: str, runs: int) -> int:
    """Runs of a target where one of streams gets `runs`."""
    return max(1, round(runs * SHARES.get(name, SHARES.get(name.partition(" ")[0], 1.0))))


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    parser.add_argument("--runs", type=_count, default=500, help="runs of a stream; files get fewer (500)")
    parser.add_argument("--seed", type=int, default=0, help="another one gives other cases (default: 0)")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="targets whose names hold one of these")


def run(runs: int, seed: int, only: Sequence[str] | None) -> Iterator[TextTable]:
    """Give the table of outcomes; exit code 1 where anything failed, with the folder of the failed cases."""
    folder = Path(tempfile.gettempdir(), "shukotsu-fuzz")
    outcomes: dict[str, Outcome] = {}
    for name in TARGETS:
        if any(part in name for part in only or [""]):
            outcomes[name] = run_apart(name, seed, runs_of(name, runs))
            _save_failures(name, seed, outcomes[name], folder)
            print(f"{name}: {len(outcomes[name].failures)} failures", file=sys.stderr, flush=True)
    yield _table(outcomes, seed)
    if any(outcome.failures for outcome in outcomes.values()):
        sys.exit(f"Failed cases are in {folder}.")


def _save_failures(name: str, seed: int, outcome: Outcome, folder: Path) -> None:
    """Write the files of the first failures, and what happened, for someone to look at."""
    for number, failure in list(outcome.failures.items())[:KEPT_FAILURES]:
        place = folder / f"{name.replace(' ', '_')}-{seed}-{number}"
        place.mkdir(parents=True, exist_ok=True)
        for file, data in target(name).damaged(chance_of(seed, name, number)).items():
            (place / file).write_bytes(data)
        (place / "failure.txt").write_text(failure, "utf-8")


def _table(outcomes: Mapping[str, Outcome], seed: int) -> TextTable:
    rows: list[tuple[Cell, ...]] = []
    for name, outcome in outcomes.items():
        runs = len(outcome.peaks_mb)
        kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(outcome.counts.items()))
        ms_a_run = 1e3 * outcome.seconds / runs
        rows.append((name, runs, len(outcome.failures), ms_a_run, outcome.grown_mb, kinds))
    return TextTable(
        f"fuzz: {sum(len(outcome.peaks_mb) for outcome in outcomes.values())} runs, seed {seed}",
        ("target", "runs:d", "failed:d", "ms a run:.2f", "MB grown:.1f", ""),
        rows,
        "A run damages a valid stream or file in up to 8 places. Failed: raised something else than "
        "InputError, warned, crashed, hung, lost a byte of the stream, or came out otherwise when the stream "
        f"was cut. MB grown: peak memory since run {WARM_UP}.",
    )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no count; expected a whole number above 0")
    return int(text)
