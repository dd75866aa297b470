"""Command line: run one benchmark and print its tables."""

from __future__ import annotations

import argparse
import importlib
import os
import sys

from benchmarks.benchmark_table import write_tables
from shukotsu import command_line

BENCHMARKS = {
    "cost": "time and memory of whole studies, and of fitting, posing and judging a hand",
    "two_drawings": "hands of our simulator and of an independent one: errors, verdicts, stated sd",
    "sources": "people drawn around a source that is left out of the prior: errors, lengths, stated sd",
    "agreement": "simulated people recorded twice: differences of bone lengths over their expected sd",
    "mistakes": "mistakes planted in simulated hands: how often each is named, and false alarms",
    "keystrokes": "simulated pianists: contact, speed and fingering",
    "null_studies": "studies with and without a true difference: false positives and power",
}


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark that the command line names, and print each table; return the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    name = _parser().parse_args(argv[:1]).name
    os.environ["OMP_NUM_THREADS"] = "1"  # set before NumPy is imported: one thread, as in the workflow
    benchmark = importlib.import_module(f"benchmarks.{name}")
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks {name}", description=benchmark.__doc__, allow_abbrev=False
    )
    if hasattr(benchmark, "PEOPLE"):
        people, seed = benchmark.PEOPLE
        parser.add_argument(
            "--hands", "--people", dest="n_hands", type=int, default=people, help=f"drawn hands ({people})"
        )
        parser.add_argument("--seed", type=int, default=seed, help=f"seed of the first person ({seed})")
    if hasattr(benchmark, "add_options"):
        benchmark.add_options(parser)
    page, section = benchmark.WRITTEN_TO
    parser.add_argument("--write", action="store_true", help=f"write the tables to docs/{page}")
    options = vars(parser.parse_args(argv[1:]))
    write, tables = options.pop("write"), []
    for table in benchmark.run(**options):
        print(table, end="\n\n", flush=True)
        tables.append(table)
    if write:
        write_tables(page, tables, " ".join(["python -m benchmarks", *argv]), section)
    return 0


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, BENCHMARKS))
    lines = [f"  {name:{width}}  {summary}" for name, summary in BENCHMARKS.items()]
    parser = command_line.parser(
        "python -m benchmarks",
        "Measure the cost and the accuracy of the stages. Seconds depend on this machine and\n"
        "its load; quote ratios.\n\nbenchmarks:\n" + "\n".join(lines),
        "python -m benchmarks two_drawings --hands 24 --write\n\n"
        "python -m benchmarks NAME --help lists the options of a benchmark.",
    )
    parser.add_argument("name", metavar="NAME", choices=BENCHMARKS, help="the benchmark; its options follow")
    return parser


if __name__ == "__main__":
    sys.exit(main())
