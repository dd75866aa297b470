"""Command line: run one stage for many, in one process; what is up to date stays as it is.

Starting Python and importing its packages takes longer than most runs of a stage, so the workflow does all
hands and models of a subject in one job. A unit is one command line of the stage. The tables that it writes
carry a key: a digest of the stage's code, of the unit's words and of the bytes of its inputs. A unit whose
tables all carry the key that they would get now is not run again.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import shlex
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from schemas.errors import InputError
from stages import command_line

ANEW = "SHUKOTSU_ANEW"
"""Environment variable: where it is set, nothing counts as up to date."""


@dataclass(frozen=True)
class Unit:
    """One command line of a stage: its words, the files that it writes, and its key."""

    words: list[str]
    outputs: tuple[Path, ...]
    key: str

    def is_up_to_date(self) -> bool:
        """Whether every output is there, was made from just this, and is no failure's."""
        return bool(self.outputs) and all(_key_of(path) == self.key for path in self.outputs)

    def sign(self) -> None:
        """Put the key beside the folders that were written; tables have it in them."""
        from schemas.files import write_text

        for folder in filter(Path.is_dir, self.outputs):
            write_text(_beside(folder), self.key + "\n")


def build_parser() -> argparse.ArgumentParser:
    """Give the argument parser."""
    parser = argparse.ArgumentParser(
        prog="python -m stages.each",
        description="Run a stage for many units in one process. Units come from standard input, as the "
        "workflow writes them: a JSON list of words, then a line a unit, the numbers of its words.",
        epilog="example:\n  printf '%s\\n' "
        '\'["--joints", "a.parquet", "--layout", "liberty16", "--model", "rigid", "--out", "b.parquet"]\' '
        "'0 1 2 3 4 5 6 7' | python -m stages.each project_planes --code 1 --made made.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("stage", help="a module with a command line, e.g. solve_joints")
    parser.add_argument("--code", required=True, help="digest of the stage's code")
    parser.add_argument("--made", type=Path, required=True, help="file to write: what was made, from what")
    return parser


def main(words: list[str] | None = None) -> int:
    """Run the stage for every unit; give the worst exit code."""
    from schemas.files import remove_leftovers, write_text
    from stages.units import unpack

    arguments = build_parser().parse_args(words)
    try:
        units = unpack(sys.stdin.read())
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return command_line.EXIT_BAD_INPUT
    module = _module(arguments.stage)
    made, status, count, work_s = [], 0, {"made": 0, "kept": 0}, 0.0
    for own in units:
        unit = unit_of(module, own, arguments.code)
        before = time.process_time()
        for path in unit.outputs:
            remove_leftovers(path)
        if ANEW in os.environ or not unit.is_up_to_date():
            print(f"python -m stages.{arguments.stage} {shlex.join(own)}", file=sys.stderr, flush=True)
            status = max(status, _run(module, unit))
            count["made"] += 1
        else:
            count["kept"] += 1
        work_s += time.process_time() - before
        files = [path.as_posix() for path in unit.outputs]
        made.append(json.dumps({"unit": unit.key, "files": files}, ensure_ascii=False))
    if not status:
        write_text(arguments.made, "[\n" + ",\n".join(made) + "\n]\n")
    print(
        f"{arguments.stage}: {count['made']} made, {count['kept']} up to date; {work_s:.2f} of "
        f"{time.process_time():.2f} s of processor after the start",
        file=sys.stderr,
    )
    return status


def unit_of(module: ModuleType, words: list[str], code: str) -> Unit:
    """Tell a command line's outputs (--out and --out-...) from its inputs, and give it its key."""
    arguments = module.build_parser().parse_args(words)
    parsed = vars(arguments)
    outputs = {name: path for name, path in parsed.items() if name.startswith("out") and path is not None}
    rest = {name: value for name, value in sorted(parsed.items()) if name not in outputs}
    if hasattr(module, "inputs"):  # a stage that finds its files by itself, and says which
        named: Any = [
            {name: str(value) for name, value in rest.items()},
            list(_content(module.inputs(arguments))),
        ]
    else:
        named = {name: list(_content(value)) for name, value in rest.items()}
    names = sorted((name, path.name) for name, path in outputs.items())
    whole = json.dumps([code, module.__name__, names, named])
    return Unit(words, tuple(outputs.values()), hashlib.sha256(whole.encode()).hexdigest()[:32])


def _key_of(output: Path) -> str:
    """The key that a table carries, or that stands beside a folder; empty for none, or for a failure."""
    from schemas.tables import read_metadata

    if output.is_dir():
        key = _beside(output)
        return key.read_text("utf-8").strip() if key.is_file() else ""
    try:
        metadata = read_metadata(output)
    except InputError:
        return ""
    return "" if "failure" in metadata else str(metadata.get("unit", ""))


def _beside(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.unit")


def _content(value: Any) -> Iterator[Any]:
    """What counts of an option's value: of a file or folder its name and bytes, else the value."""
    from schemas.files import file_sha256, files_in

    for one in value if isinstance(value, list) else [value]:
        path = Path(one) if isinstance(one, str | Path) and str(one) else None
        if path is not None and path.is_dir():
            yield path.name, [(p.name, file_sha256(p)) for p in files_in(path)]
        elif path is not None and path.is_file():
            yield path.name, file_sha256(path)
        else:
            yield str(one)


def _module(stage: str) -> ModuleType:
    module = importlib.import_module(f"stages.{stage}")
    return importlib.import_module(f"stages.{stage}.__main__") if hasattr(module, "__path__") else module


def _run(module: ModuleType, unit: Unit) -> int:
    from schemas.tables import made_by

    with made_by(unit.key):
        status: int = module.main(unit.words)
    if not status:
        unit.sign()
    return status


if __name__ == "__main__":
    command_line.begin()
    sys.exit(main())
