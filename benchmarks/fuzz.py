"""Command line: spoil byte streams and files, and see that every decoder and reader takes it.

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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from benchmarks.text_table import Cell, TextTable

Files = Mapping[str, bytes]

SHARE_OF_FILES = 0.1
_SHARE = {"file c3d": 0.05}  # every file is read in a process of its own
HANG_S = 60.0
WARM_UP = 200
"""Runs before memory is first looked at: modules are loaded by then, and caches filled."""
KEPT_FAILURES = 5

_TOKENS = (
    *(b"LY", b"PA", b"VPRP", b"VPRC", b"01", b"02  ", b"\r\n", b"nan", b"inf", b"1e999", b"-", b".", b","),
    *(
        b"\x00" * 4,
        b"\xff" * 4,
        b"\x7f\xff\xff\xff",
        b"\xff\xff\xff\x7f",
        b"\t",
        b'"',
        b"\xef\xbb\xbf",
        b"{}",
    ),
)
_VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 2, 7, 16, 77, 10**400, 1e308, float("nan"), "", "viper", "ascii", "inch", "7"),
    *([], [1], {}, {"1": [2, 4]}),
)


def spoil(data: bytes, chance: random.Random) -> bytes:
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


def _spoil_json(loaded: Any, chance: random.Random) -> None:
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
    """What is fuzzed: `spoilt` makes a case, `run` gives a word for its outcome or raises."""

    spoilt: Callable[[random.Random], Files]
    run: Callable[[Files, random.Random], str]


def _decoder(name: str) -> Target:
    from benchmarks.fuzz_decoding import check_decoder
    from benchmarks.tracker_streams import streams

    stream = streams()[name]

    def run(files: Files, chance: random.Random) -> str:
        return check_decoder(stream.settings, files["stream"], chance)

    return Target(lambda chance: {"stream": spoil(stream.data, chance)}, run)


def _settings(_: str) -> Target:
    from benchmarks.fuzz_decoding import check_settings
    from benchmarks.tracker_streams import streams

    every = list(streams().values())

    def spoilt(chance: random.Random) -> Files:
        stream = chance.choice(every)
        told = json.loads(json.dumps(stream.settings.to_json()))
        for _ in range(chance.randint(1, 3)):
            _spoil_json(told, chance)
        return {"settings.json": json.dumps(told).encode(), "stream": stream.data[:400]}

    return Target(
        spoilt, lambda files, chance: check_settings(files["settings.json"], files["stream"], chance)
    )


def _archive(_: str) -> Target:
    from benchmarks.fuzz_files import capture_bytes

    data = capture_bytes()
    folder = tempfile.TemporaryDirectory()

    def run(files: Files, _: random.Random) -> str:
        from schemas.errors import InputError
        from stages.capture.archive import open_archive

        path = Path(folder.name, "a.arrows")
        path.write_bytes(files["a.arrows"])
        try:
            for piece in open_archive(path).pieces():
                assert len(piece.host_ns) == len(piece.kind) == len(piece.data)
        except InputError:
            return "refused"
        return "read"

    return Target(lambda chance: {"a.arrows": spoil(data, chance)}, run)


def _reader(name: str) -> Target:
    from benchmarks.fuzz_files import RECORDINGS
    from schemas.layout import read_layout
    from schemas.mapping import mapping_from_config
    from stages.capture.formats.readers import find_reader
    from stages.capture.samples import ReadingOptions

    recording = RECORDINGS[name]()
    layout = read_layout("liberty16")
    mapping = mapping_from_config(recording.mapping, "mapping.yaml") if recording.mapping else None
    folder = tempfile.TemporaryDirectory()

    def spoilt(chance: random.Random) -> Files:
        chosen = chance.choice(sorted(recording.files))
        return {**recording.files, chosen: spoil(recording.files[chosen], chance)}

    def run(files: Files, _: random.Random) -> str:
        from schemas.errors import InputError

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

    return Target(spoilt, run)


def targets() -> dict[str, Callable[[str], Target]]:
    """Everything that is fuzzed, by name."""
    from benchmarks.fuzz_files import RECORDINGS
    from benchmarks.tracker_streams import streams

    return {
        **dict.fromkeys(streams(1), _decoder),
        "settings": _settings,
        "archive": _archive,
        **{f"file {name}": lambda whole: _reader(whole.removeprefix("file ")) for name in RECORDINGS},
    }


@dataclass
class Outcome:
    """What came of a target's runs; failures : run -> what happened."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: dict[int, str] = field(default_factory=dict)
    seconds: float = 0.0
    grown_mb: float = 0.0


def chance_of(seed: int, name: str, run: int) -> random.Random:
    """The chance that decides about one run, the same every time."""
    return random.Random(f"{seed} {name} {run}")


def run_here(
    name: str, seed: int, runs: Iterable[int], told: Callable[[int], object] = lambda _: None
) -> Outcome:
    """Do the runs in this process; `told` hears of each before it starts."""
    target, outcome = targets()[name](name), Outcome()
    started, at_first = time.perf_counter(), 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for count, run in enumerate(runs):
            told(run)
            if count == WARM_UP:
                at_first = _peak_kb()
            chance = chance_of(seed, name, run)
            files = target.spoilt(chance)
            try:
                outcome.counts[target.run(files, chance)] += 1
            except Exception:  # whatever it is, it is what is looked for
                outcome.failures[run] = traceback.format_exc()
    outcome.seconds = time.perf_counter() - started
    outcome.grown_mb = (_peak_kb() - at_first) / 1024 if at_first else 0.0
    return outcome


def _peak_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _work(name: str, seed: int, runs: range, connection: Connection) -> None:
    connection.send(run_here(name, seed, runs, connection.send))
    connection.close()


def run_apart(name: str, seed: int, runs: int) -> Outcome:
    """Do the runs in a process of their own; one that crashes or hangs is a failure, and the rest go on."""
    whole, first = Outcome(), 0
    while first < runs:
        ours, theirs = multiprocessing.Pipe(duplex=False)
        worker = multiprocessing.get_context("spawn").Process(
            target=_work, args=(name, seed, range(first, runs), theirs)
        )
        worker.start()
        theirs.close()
        ended, current = _followed(ours, first)
        if isinstance(ended, Outcome):
            worker.join()
            whole.counts += ended.counts
            whole.failures |= ended.failures
            whole.seconds += ended.seconds
            whole.grown_mb = max(whole.grown_mb, ended.grown_mb)
            return whole
        worker.kill()
        worker.join()
        whole.counts["before a crash"] += current - first
        whole.failures[current] = f"{ended}, exit code {worker.exitcode}"
        first = current + 1
    return whole


def _followed(connection: Connection, first: int) -> tuple[Outcome | str, int]:
    """Hear a worker to its end: its outcome, or how it failed; and the run that it was in."""
    current = first
    while True:
        if not connection.poll(HANG_S):
            return f"hung for {HANG_S:.0f} s", current
        try:
            heard: int | Outcome = connection.recv()
        except EOFError:
            return "crashed", current
        if isinstance(heard, Outcome):
            return heard, current
        current = heard


def _save_failures(name: str, seed: int, outcome: Outcome, folder: Path) -> None:
    """Write the files of the first failures, and what happened, for someone to look at."""
    target = targets()[name](name)
    for run, what in list(outcome.failures.items())[:KEPT_FAILURES]:
        place = folder / f"{name.replace(' ', '_')}-{seed}-{run}"
        place.mkdir(parents=True, exist_ok=True)
        for file, data in target.spoilt(chance_of(seed, name, run)).items():
            (place / file).write_bytes(data)
        (place / "what.txt").write_text(what, "utf-8")


def shares(names: Sequence[str], runs: int) -> dict[str, int]:
    """Runs of each target: files, which are slow, get SHARE_OF_FILES of them together, C3D fewer still."""
    slow = {name: _SHARE.get(name, 1.0) for name in names if name.startswith("file ")}
    of_slow = runs if len(slow) == len(names) else round(runs * SHARE_OF_FILES) if slow else 0
    fast = len(names) - len(slow)
    return {
        name: max(1, round(of_slow * slow[name] / sum(slow.values())))
        if name in slow
        else max(1, (runs - of_slow) // fast)
        for name in names
    }


def main(words: list[str] | None = None) -> int:
    """Fuzz on the words of a command line; exit code 1 where anything failed."""
    arguments = _parser().parse_args(words)
    names = [name for name in targets() if any(part in name for part in arguments.only or [""])]
    folder = Path(tempfile.gettempdir(), "shukotsu-fuzz")
    outcomes: dict[str, Outcome] = {}
    for name, runs in shares(names, arguments.runs).items():
        outcomes[name] = run_apart(name, arguments.seed, runs)
        _save_failures(name, arguments.seed, outcomes[name], folder)
        print(f"{name}: {runs} runs, {len(outcomes[name].failures)} failures", file=sys.stderr, flush=True)
    print(table(outcomes, arguments.seed))
    failed = any(outcome.failures for outcome in outcomes.values())
    if failed:
        print(f"What failed is in {folder}.")
    return int(failed)


def table(outcomes: Mapping[str, Outcome], seed: int) -> TextTable:
    """Put the outcomes into a table."""
    rows: list[tuple[Cell, ...]] = []
    for name, outcome in outcomes.items():
        done = sum(outcome.counts.values()) + len(outcome.failures)
        kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(outcome.counts.items()))
        per_run = 1e3 * outcome.seconds / done if done else None
        rows.append((name, done, len(outcome.failures), per_run, outcome.grown_mb, kinds))
    total = sum(int(str(row[1])) for row in rows)
    return TextTable(
        f"fuzz: {total} runs, seed {seed}",
        (("target", ""), ("runs", "d"), ("failed", "d"), ("ms a run", ".2f"), ("MB grown", ".1f"), ("", "")),
        rows,
        "A run spoils a valid stream or file in up to 8 places. Failed: raised something else than "
        "InputError, warned, crashed, hung, lost a byte of the stream, or came out otherwise when the stream "
        f"was cut. MB grown: peak memory since run {WARM_UP}.",
    )


def _parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="python -m benchmarks.fuzz",
        description="Spoil byte streams and files, and see that every decoder and reader takes it.",
        epilog="example:\n  python -m benchmarks.fuzz --runs 100000 --seed 1 --only viper c3d",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("--runs", type=_count, default=20_000, help="runs in all (default: %(default)s)")
    made.add_argument("--seed", type=int, default=0, help="another one makes other cases (default: 0)")
    made.add_argument("--only", nargs="+", metavar="NAME", help="targets whose names hold one of these")
    return made


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no count; expected a whole number above 0")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
