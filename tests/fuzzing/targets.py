"""Damaged byte streams and files: whether every decoder and reader takes them.

A decoder must give every byte of any stream to one record, reply or skip, the same however the stream is cut.
A reader must give samples, or InputError. Nothing may raise anything else, warn, hang or crash.
"""

from __future__ import annotations

import copy
import json
import random
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from fuzzing.decoding import check_decoder, check_settings
from fuzzing.sample_files import RECORDINGS, capture_bytes
from fuzzing.tracker_streams import streams
from schemas.errors import InputError
from schemas.layout import read_layout
from schemas.mapping import mapping_from_config
from stages.capture.formats.readers import find_reader
from trackers.archive import open_archive

Files = Mapping[str, bytes]

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
            samples = find_reader(path, "auto", mapping)(path, layout, mapping)
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


def chance_of(seed: int, name: str, run: int) -> random.Random:
    """The chance that decides about one run, the same every time."""
    return random.Random(f"{seed} {name} {run}")


def outcomes(name: str, seed: int, runs: int) -> Counter[str]:
    """Do runs of a target; count what came of them. AssertionError that names the first run that failed.

    Its case is what `target(name).damaged(chance_of(seed, name, run))` gives.
    """
    counts: Counter[str] = Counter()
    for number in range(runs):
        chance = chance_of(seed, name, number)
        files = target(name).damaged(chance)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                counts[target(name).run(files, chance)] += 1
            except Exception as error:  # whatever it is, it is what is looked for
                raise AssertionError(f"{name}, seed {seed}, run {number}") from error
    return counts
