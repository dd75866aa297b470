"""Command line: run one benchmark and print its tables."""

from __future__ import annotations

import argparse
import importlib
import os
import sys

BENCHMARKS = {
    "cost": "studies, long_recordings and joint_solve, into docs/benchmarks.md",
    "studies": "whole studies of 1, 10 and 100 subjects: seconds, where they go, what a change costs",
    "long_recordings": "recordings of a minute and an hour through the stages: seconds and memory",
    "joint_solve": "one joint and a hand's: closed form, stacked SVD, biobuddy and qmt on the same data",
    "hand_cost": "a whole hand fitted, posed and judged: time, start-up, memory, compiled beside NumPy",
    "captures": "an hour of a tracker's bytes to Parquet; recording live: loss, load, delay",
    "accuracy": "every estimator, and published software, on simulated hands against their truth",
    "measured_movement": "ranges of motion, ways of fingertips: how far off, and the sd stated of it",
    "fewer_receivers": "a task, and a calibration, with 16, 11, 7 and 6 receivers: centres, angles, their sd",
    "paper_accuracy": "the paper's pipeline on simulated hands: its joints, their status, its tip error",
    "mistakes": "mistakes planted in simulated hands: how often each is named, and false alarms",
    "displaced_receivers": "receivers that come loose or slide, and metal: how often each is named",
    "two_drawings": "whole hands drawn by us and by others: errors, those all share, stated sd, what is left",
    "believed_joints": "joints that are believed: how far off, and whether the stated error says so",
    "cures": "mistakes planted in a laboratory's own files, and cured as the sentences say: joints' errors",
    "null_studies": "studies in which nothing differs: false positives, coverage of intervals, power",
    "pianists": "12 pianists, 2 groups, 3 sessions: a known effect, sem of re-donning, the stated sd",
    "bit_flips": "one flipped bit in every kind of file: how often it goes unnoticed",
    "faults": "kills, full disks, little memory, changed files, lost power, against what is promised",
    "reader_memory": "import and inspect of large files of every format: the most memory that each takes",
    "fuzz": "damaged input for every reader and configuration file: tracebacks, hangs, memory (`make fuzz`)",
    "cluster_plan": "a study of thousands on a cluster: jobs, hours, files, and what ends first",
    "report_pages": "the report: bytes of its pages, how a browser shows them",
    "opensim_figure": "the guide's picture of an export in OpenSim, and its inverse kinematics",
}


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark that the command line names; give the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    name = _parser().parse_args(argv[:1]).name
    os.environ["OMP_NUM_THREADS"] = "1"  # before NumPy is there: one thread each, as in the workflow
    benchmark = importlib.import_module(f"benchmarks.{name}")
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks {name}", description=benchmark.__doc__, allow_abbrev=False
    )
    if hasattr(benchmark, "add_options"):
        benchmark.add_options(parser)
    for table in benchmark.run(**vars(parser.parse_args(argv[1:]))):
        print(table, end="\n\n", flush=True)
    return 0


def _parser() -> argparse.ArgumentParser:
    width = max(map(len, BENCHMARKS))
    lines = [f"  {name:{width}}  {summary}" for name, summary in BENCHMARKS.items()]
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure what the stages cost and how well they do. Seconds are of this machine, now;\n"
        "ratios are what to quote.\n\nbenchmarks:\n" + "\n".join(lines),
        epilog="example:\n  python -m benchmarks accuracy --hands 20 --write\n\n"
        "python -m benchmarks NAME --help lists the options of one.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("name", metavar="NAME", type=_known, help="the benchmark; its options follow")
    return parser


def _known(name: str) -> str:
    if name not in BENCHMARKS:
        raise argparse.ArgumentTypeError(f"{name!r} is no benchmark; expected one of {', '.join(BENCHMARKS)}")
    return name


if __name__ == "__main__":
    sys.exit(main())
