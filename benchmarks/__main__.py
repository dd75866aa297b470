"""Command line: run the benchmarks, all or those named, and print their tables."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import time

BENCHMARKS = {
    "joint_solve": "one joint: closed form, stacked SVD and biobuddy on the same data",
    "solve_hand": "all joints of a hand with 16 receivers",
    "start_up": "every stage as a process: its --help, and a job on tiny data",
    "decode_capture": "an hour of a tracker's bytes to Parquet, beside copying them",
    "live_capture": "recording live through a terminal and a network port: loss, load, delay",
    "accuracy": "joint centres and tips of simulated hands against their truth",
    "demo_study": "the demo study: cold, unchanged, and after one change",
}


def main(words: list[str] | None = None) -> int:
    """Run the benchmarks on the words of a command line; give the exit code."""
    arguments = _parser().parse_args(words)
    os.environ["OMP_NUM_THREADS"] = "1"  # before NumPy is there: one thread each, as in the workflow
    names = arguments.name or list(BENCHMARKS)
    print("Seconds and milliseconds are of this machine, now; ratios are what to quote.\n")
    for name in names:
        started = time.perf_counter()
        for table in importlib.import_module(f"benchmarks.{name}").run():
            print(table, end="\n\n", flush=True)
        print(f"({name} took {time.perf_counter() - started:.0f} s)\n", flush=True)
    return 0


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, BENCHMARKS))
    lines = [f"  {name:{width}}  {summary}" for name, summary in BENCHMARKS.items()]
    made = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure what the stages cost and how well they do.\n\nbenchmarks:\n" + "\n".join(lines),
        epilog="example:\n  python -m benchmarks joint_solve solve_hand",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    names = ", ".join(BENCHMARKS)
    made.add_argument("name", nargs="*", type=_known, metavar="NAME", help=f"{names} (default: all)")
    return made


def _known(name: str) -> str:
    if name not in BENCHMARKS:
        raise argparse.ArgumentTypeError(f"{name!r} is no benchmark; expected one of {', '.join(BENCHMARKS)}")
    return name


if __name__ == "__main__":
    sys.exit(main())
