"""A picture of what OpenSim makes of an export: the hand in motion, and its inverse kinematics beside ours.

Inverse kinematics takes some 0.2 s a frame.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark_table import TextTable
from benchmarks.processes import ROOT

READER = ROOT / "tests" / "export_samples" / "readers" / "read_with_opensim.py"
SHOWN = ("thumb_mcp_flexion", "index_mcp_flexion", "index_pip_flexion", "little_pip_flexion")
COLOURS = ("#0b6e4f", "#1f4e9c", "#b45309", "#7a3b8f")
PALETTE_SIZE = 48
SEGMENTS = ("metacarpal", "proximal", "middle", "distal")
ACROSS_AND_UP = np.array([[0.0, 0.7], [0.0, 0.7], [-1.0, 0.0]])
POSTURES = (0.0, 0.035, 0.47, 0.7)
"""Which are drawn, as parts of the recording."""
DIGITS = ("thumb", "index", "middle", "ring", "little")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the benchmark."""
    parser.add_argument("stem", type=Path, help="the exported files' path without an ending")
    parser.add_argument("python", type=Path, help="Python of the environment with opensim in it")
    parser.add_argument("picture", type=Path, help="the picture to write, such as docs/opensim.png")


def run(stem: Path, python: Path, picture: Path) -> Iterator[TextTable]:
    """Run OpenSim on the files and draw; give a table of the markers' error."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "opensim.npz"
        command = [str(path.absolute()) for path in (python, READER, stem, out)]
        subprocess.run([*command, "--ik"], check=True)
        with np.load(out) as arrays:
            result = dict(arrays)
    draw(result, picture.absolute())
    rms_mm = result["ik_rms_m"] * 1000
    yield TextTable(
        f"opensim_figure: {picture}",
        ("frames:d", "markers' rms mm, median:.2f", "worst:.2f"),
        [(len(rms_mm), float(np.median(rms_mm)), float(rms_mm.max()))],
        "Errors of the markers in OpenSim's inverse kinematics.",
    )


def draw(result: Mapping[str, Any], picture: Path) -> None:
    """Draw what OpenSim gave: four postures, four angles, the markers' error."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from PIL import Image

    figure = plt.figure(figsize=(10, 6.4), layout="constrained")
    grid = figure.add_gridspec(3, 4, height_ratios=(1.5, 1.2, 0.6))
    rows = (len(result["mot_time_s"]) * np.array(POSTURES)).astype(int)
    for column, row in enumerate(rows):
        _draw_hand(figure.add_subplot(grid[0, column]), result, int(row))
    angles = figure.add_subplot(grid[1, :])
    time_s = result["ik_time_s"]
    for name, colour in zip(SHOWN, COLOURS, strict=True):
        ours = result["mot_values"][:, result["mot_coordinates"].tolist().index(name)]
        theirs = result["ik_values"][:, result["ik_coordinates"].tolist().index(name)]
        angles.plot(result["mot_time_s"], ours, color=colour, lw=1.3, label=name)
        angles.plot(time_s, theirs, color=colour, lw=1.3, ls=(0, (1, 1.5)))
    angles.set_ylabel("deg")
    angles.set_title("Coordinates: the export's (solid), OpenSim's inverse kinematics (dotted)", fontsize=10)
    angles.legend(ncols=4, fontsize=8, frameon=False, loc="upper center")
    angles.margins(x=0, y=0.2)
    errors = figure.add_subplot(grid[2, :], sharex=angles)
    errors.plot(time_s, result["ik_rms_m"] * 1000, color="#333333", lw=1)
    errors.set(xlabel="time, s", ylabel="mm", ylim=(0, None))
    errors.set_title("RMS error of the markers in OpenSim's inverse kinematics", fontsize=10)
    raw = BytesIO()
    figure.savefig(raw, dpi=100, metadata={"Software": None})
    Image.open(raw).convert("RGB").quantize(PALETTE_SIZE).save(picture, optimize=True)


def _draw_hand(axes: Any, result: Mapping[str, Any], row: int) -> None:
    """The model's bodies, joined along the digits, and its markers, from above and from the thumb's side."""
    bodies, markers = result["mot_bodies"].tolist(), result["mot_markers"].tolist()
    place, spots = result["mot_place_m"][row] @ ACROSS_AND_UP, result["mot_marker_m"][row] @ ACROSS_AND_UP
    for digit in DIGITS:
        names = ["hand", *(f"{digit}_{part}" for part in SEGMENTS)]
        points = [place[bodies.index(name)] for name in names if name in bodies]
        points.append(spots[markers.index(f"{digit}_tip")])
        axes.plot(*np.array(points).T, "-o", color="#8a7350", lw=2.5, ms=3.5)
    there = spots[[index for index, name in enumerate(markers) if not name.endswith("_tip")]]
    axes.plot(*there.T, ".", color="#c2255c", ms=2.5)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(f"{result['mot_time_s'][row]:.1f} s", fontsize=9)
