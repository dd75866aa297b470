"""Command line: run the benchmarks, all or those named, and print their tables."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import time

from benchmarks.cost import PARTS

BENCHMARKS = {
    "cost": "studies, long_recordings, solve_hand and joint_solve, into docs/benchmarks.md",
    "studies": "whole studies of 1, 10 and 100 subjects: seconds, where they go, what a change costs",
    "long_recordings": "recordings of a minute and an hour through the stages: seconds and memory",
    "joint_solve": "one joint: closed form, stacked SVD and biobuddy on the same data",
    "solve_hand": "all joints of a hand with 16 receivers",
    "start_up": "every stage as a process: its --help, and a job on tiny data",
    "decode_capture": "an hour of a tracker's bytes to Parquet, beside copying them",
    "live_capture": "recording live through a terminal and a network port: loss, load, delay",
    "accuracy": "every estimator, and published software, on simulated hands against their truth",
    "paper_accuracy": "the paper's pipeline on simulated hands: its joints, their status, its tip error",
    "demo_study": "the demo study: cold, unchanged, and after one change",
    "cluster_plan": "a study of thousands on a cluster: jobs, hours, files, and what ends first",
    "report_pages": "the report: seconds to make its pages, their bytes, how a browser shows them",
}

FIRST_SEED = 5010
"""Of the documented run; seeds below are for development."""


def main(words: list[str] | None = None) -> int:
    """Run the benchmarks on the words of a command line; give the exit code."""
    arguments = _parser().parse_args(words)
    os.environ["OMP_NUM_THREADS"] = "1"  # before NumPy is there: one thread each, as in the workflow
    names = arguments.name or [name for name in BENCHMARKS if name not in PARTS]
    options = {"accuracy": {"seeds": _seeds(arguments), "write": arguments.write}}
    print("Seconds and milliseconds are of this machine, now; ratios are what to quote.\n")
    for name in names:
        started = time.perf_counter()
        for table in importlib.import_module(f"benchmarks.{name}").run(**options.get(name, {})):
            print(table, end="\n\n", flush=True)
        print(f"({name} took {time.perf_counter() - started:.0f} s)\n", flush=True)
    return 0


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, BENCHMARKS))
    lines = [f"  {name:{width}}  {summary}" for name, summary in BENCHMARKS.items()]
    made = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure what the stages cost and how well they do.\n\nbenchmarks:\n" + "\n".join(lines),
        epilog="example:\n  python -m benchmarks joint_solve solve_hand\n"
        "  python -m benchmarks accuracy --hands 20 --write",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    names = ", ".join(BENCHMARKS)
    made.add_argument("name", nargs="*", type=_known, metavar="NAME", help=f"{names} (default: all)")
    accuracy = made.add_argument_group("options of accuracy")
    accuracy.add_argument(
        "--hands", type=_hands, default=20, help="so many hands, right and left of each seed (default: 20)"
    )
    accuracy.add_argument(
        "--seeds", type=_range, help=f"first-last, both included, in place of --hands from {FIRST_SEED}"
    )
    accuracy.add_argument(
        "--write", action="store_true", help="refresh docs/accuracy.md and docs/accuracy.svg, too"
    )
    return made


def _seeds(arguments: argparse.Namespace) -> range:
    if arguments.seeds is not None:
        return arguments.seeds  # type: ignore[no-any-return]
    return range(FIRST_SEED, FIRST_SEED + arguments.hands // 2)


def _hands(text: str) -> int:
    if not text.isdigit() or int(text) < 2 or int(text) % 2:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of hands; expected an even one, e.g. 20")
    return int(text)


def _range(text: str) -> range:
    first, _, last = text.partition("-")
    if not first.isdigit() or not (last or first).isdigit() or int(last or first) < int(first):
        raise argparse.ArgumentTypeError(f"{text!r} is no range of seeds; expected e.g. 5000-5009")
    return range(int(first), int(last or first) + 1)


def _known(name: str) -> str:
    if name not in BENCHMARKS:
        raise argparse.ArgumentTypeError(f"{name!r} is no benchmark; expected one of {', '.join(BENCHMARKS)}")
    return name


if __name__ == "__main__":
    sys.exit(main())
