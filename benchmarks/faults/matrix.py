"""The matrix: every kind of fault on a small study, side by side, and its page of the guide."""

from __future__ import annotations

import argparse
import importlib
import math
import tempfile
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path

from benchmarks.benchmark_table import TextTable, write_tables
from benchmarks.faults.outcome import KILLS, Limit, Row
from benchmarks.faults.small_study import SmallStudy, make_study

PAGE, MARK = "reliability.md", "faults"
PARTS = ("stage_kills", "study_kills", "recorder_kills", "write_order", "storage", "memory", "changes")
OF_STUDIES = ("study_kills", "changes")
"""Those that run whole studies, under a model that takes little time."""
STUDIES, RECORDER = 0.06, 0.05
"""Shares of the kills."""

Part = tuple[str, Limit, int, Path, SmallStudy]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the matrix."""
    parser.add_argument("--kills", type=int, default=1000, help="of stages, recordings and studies (1000)")
    parser.add_argument("--minutes", type=float, default=math.inf, help="kill no more after that (no limit)")
    parser.add_argument("--seed", type=int, default=1, help="of the moments (1)")
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE}")


def run(
    kills: int = 1000, minutes: float = math.inf, seed: int = 1, write: bool = False
) -> Iterator[TextTable]:
    """Give the table."""
    with tempfile.TemporaryDirectory() as name:
        rows = sorted(_rows(Path(name), kills, minutes, seed), key=lambda row: row.fault)
    killed = [row for row in rows if row.fault.startswith(KILLS)]
    total = Row(
        f"{KILLS}, in all", sum(row.tried for row in killed), sum(row.failed or 0 for row in killed), ""
    )
    table = TextTable(
        "Faults, and what became of what is promised",
        ("fault", "tried:d", "failed:d", "promised"),
        [*killed, total, *(row for row in rows if row not in killed)],
        "On a study of one subject and one hand. Moments are uniform over what the command takes "
        "undisturbed; studies are killed twice in a row before the run that completes. Bytes are compared by "
        "the SHA-256 of all files but logs. A dash: not tried, which is no pass.",
    )
    yield table
    if write:
        limit = "" if math.isinf(minutes) else f" --minutes {minutes:g}"
        write_tables(PAGE, [table], f"python -m benchmarks faults --kills {kills}{limit} --write", MARK)


def _rows(folder: Path, kills: int, minutes: float, seed: int) -> list[Row]:
    end_s = time.monotonic() + 60 * minutes
    folder.chmod(0o755)
    whole = make_study(folder / "whole")
    small = make_study(folder / "small", ["rigid"], "")
    studies, recorder = round(STUDIES * kills), round(RECORDER * kills)
    counts = {"stage_kills": kills - studies - recorder, "study_kills": studies, "changes": studies}
    counts |= {"recorder_kills": recorder}
    parts = [
        (name, Limit(counts.get(name, 0), end_s), seed, folder / name, small if name in OF_STUDIES else whole)
        for name in PARTS
    ]
    with get_context("spawn").Pool(len(PARTS), maxtasksperchild=1) as pool:
        return [row for rows in pool.imap_unordered(_part, parts, chunksize=1) for row in rows]


def _part(part: Part) -> list[Row]:
    name, limit, seed, folder, study = part
    copy = study.copied(folder)
    module = importlib.import_module(f"benchmarks.faults.{name}")
    rows: list[Row] = module.rows(limit, seed, copy)
    return rows
