"""Read a C3D file with ezc3d, in a process of its own: on damaged files it may crash or never end.

It makes an object of every point, which takes thirteen times the file; so it is given long files in pieces.
"""

from __future__ import annotations

import io
import os
import resource
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.limits import check_regular
from shukotsu.files.text_files import reading

PARAMETERS = (
    *(("POINT", f"LABELS{number}") for number in ("", *range(2, 20))),
    *(("ROTATION", f"LABELS{number}") for number in ("", *range(2, 20))),
    ("POINT", "UNITS"),
    ("POINT", "RATE"),
)
"""Group and name of the parameters that are read."""

LONGEST_S = 5.0
LONGEST_S_PER_MB = 0.5
"""Seconds of a core that reading may take: ezc3d takes about 0.05 a megabyte."""
WAIT = 6.0
"""How much longer it may take on a machine that does other things too."""
MOST_BYTES = 4 << 30
MOST_BYTES_PER_BYTE = 64
"""Memory that the process may take: files hold floats, ezc3d objects."""

PIECE_BYTES = 4 << 20
"""Of frames that ezc3d reads at a time, a multiple of the memory that they take."""
_INTEL = 84
"""Processor type of files whose numbers have their low byte first."""
_MIPS = 86
"""That of files whose numbers have their high byte first, which ezc3d does not read."""
_MOST_FRAMES = 65_534
"""A header's numbers of frames say no more."""

_ROOT = Path(__file__).parents[4]


def read_content(path: Path) -> Mapping[str, np.ndarray]:
    """Give `points` (T, P, 3), `rotations` (T', R, 4, 4), `frames` (first, last; from 0) and the PARAMETERS
    that the file has, as "GROUP:NAME".

    Raises InputError where the file is absent or is no C3D file that can be read.
    """
    with reading(path, "a C3D file"):
        megabytes = check_regular(path, "a C3D file") / 1e6
        with path.open("rb") as stream:
            stream.seek(512 * (max(stream.read(1), b"\1")[0] - 1) + 3)
            processor = stream.read(1)
    if processor == bytes([_MIPS]):
        raise InputError(f"{path}: is in the byte order of MIPS (SGI) computers; export it in that of a PC")
    command = [sys.executable, "-m", "shukotsu.stages.capture.formats.c3d_content", str(path.absolute())]
    environment = {**os.environ, "PYTHONPATH": str(_ROOT)}
    try:
        child = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            timeout=WAIT * (LONGEST_S + LONGEST_S_PER_MB * megabytes),
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise _unreadable(path, "reading it does not end") from error
    if child.returncode:  # ezc3d's own words are of its code
        raise _unreadable(path, "it is damaged")
    with np.load(io.BytesIO(child.stdout), allow_pickle=False) as arrays:
        return dict(arrays)


def _unreadable(path: Path, why: str) -> InputError:
    return InputError(f"{path}: not a readable C3D file ({why}); copy it again")


def main(path: str) -> None:
    """Read the file and write what it holds to stdout, in NumPy's npz format."""
    size = Path(path).stat().st_size
    for limit, most in (
        (resource.RLIMIT_AS, MOST_BYTES + MOST_BYTES_PER_BYTE * size),
        (resource.RLIMIT_CPU, round(LONGEST_S + LONGEST_S_PER_MB * size / 1e6)),
    ):
        resource.setrlimit(limit, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    np.savez(sys.stdout.buffer, allow_pickle=False, **(_in_pieces(Path(path)) or _arrays(path)))


def _arrays(path: str) -> dict[str, np.ndarray]:
    import ezc3d

    content = ezc3d.c3d(path)
    header = content["header"]["points"]
    return {
        # NaN where the residual is -1
        "points": np.asarray(content["data"]["points"], float).transpose(2, 1, 0)[:, :, :3],
        "rotations": np.asarray(content["data"]["rotations"], float).transpose(3, 2, 0, 1),
        "frames": np.array([header["first_frame"], header["last_frame"]]),
        **_parameters(content["parameters"]),
    }


def _in_pieces(path: Path) -> dict[str, np.ndarray] | None:
    """Give the arrays of a long file, whose frames are read as files of a few of them; None of any other.

    Words 2 to 9 of the header (C3D user guide) are the points and the analog numbers of a frame, the first
    and the last frame, their largest gap, the scale (two words, negative where numbers are floats) and the
    block at which the frames start. Rotations stand behind all frames, so a file that has some is read whole.
    """
    with path.open("rb") as stream:
        header = stream.read(512)
        if path.stat().st_size < 2 * PIECE_BYTES:
            return None
        points, analogs, first, last, _, scale, block = struct.unpack_from("<HHHHHfH", header, 2)
        head = header + stream.read(max(0, 512 * (block - 1) - 512))
        kind = head[512 * (head[0] - 1) + 3 :][:1]
        frame_bytes = (4 * points + analogs) * (4 if scale < 0 else 2)
        if kind != bytes([_INTEL]) or not points or not first <= last <= _MOST_FRAMES:
            return None
        there = min(last - first + 1, (path.stat().st_size - len(head)) // frame_bytes)
        found: dict[str, np.ndarray] = {}
        positions = np.empty((there, points, 3))
        step = max(1, PIECE_BYTES // frame_bytes)
        with tempfile.NamedTemporaryFile(suffix=".c3d") as piece:
            for start in range(0, there, step):
                count = min(step, there - start)
                piece.seek(0)
                piece.write(head[:6] + struct.pack("<HH", 1, count) + head[10:])
                piece.write(stream.read(count * frame_bytes))
                piece.truncate()
                piece.flush()
                found = _arrays(piece.name)
                if found["points"].shape != (count, points, 3) or found["rotations"].size:
                    return None
                positions[start : start + count] = found["points"]
    frames = np.array([first - 1, first + there - 2])
    return {**found, "points": positions, "frames": frames} if there else None


def _parameters(groups: Mapping[str, Any]) -> dict[str, np.ndarray]:
    arrays = {}
    for group, name in PARAMETERS:
        parameter = groups.get(group, {}).get(name)
        if parameter is not None:
            values = parameter["value"]
            arrays[f"{group}:{name}"] = np.array(values, float if name == "RATE" else str)
    return arrays


if __name__ == "__main__":
    main(sys.argv[1])
