"""Read a C3D file with ezc3d, in a process of its own: on damaged files it may crash or never end.

It makes an object of every point, which takes thirteen times the file; so it is given files in pieces.
"""

from __future__ import annotations

import io
import os
import resource
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
from shukotsu.stages.capture.formats.c3d_frames import MIPS, count_frames

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
MOST_FRAMES = 65_534
"""Of a piece: what a header counts, and what does not mean more."""

OWN_REASON = 3
"""Exit code of the process where it says itself why a file cannot be read."""

_ROOT = Path(__file__).parents[4]


def read_content(path: Path) -> Mapping[str, np.ndarray]:
    """Give `points` (T, P, 3), `rotations` (T', R, 4, 4) and PARAMETERS as far as there are, as "GROUP:NAME".

    `frames` are the first one's number, from 1, how many there are and how many there should be; where these
    are more, no point is read. `doubt` is what the file's counts do not agree on, a sentence or none.

    Raises InputError where the file is absent or is no C3D file that can be read.
    """
    with reading(path, "a C3D file"):
        megabytes = check_regular(path, "a C3D file") / 1e6
        with path.open("rb") as stream:
            stream.seek(512 * (max(stream.read(1), b"\1")[0] - 1) + 3)
            processor = stream.read(1)
    if processor == bytes([MIPS]):  # which ezc3d does not read
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
    if child.returncode:
        own = child.returncode == OWN_REASON  # ezc3d's are of its code
        raise _unreadable(path, child.stderr.decode().strip() if own else "it is damaged")
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
    try:
        arrays = _in_pieces(Path(path)) or _arrays(path)
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(OWN_REASON)
    np.savez(sys.stdout.buffer, allow_pickle=False, **arrays)


def _arrays(path: str) -> dict[str, np.ndarray]:
    import ezc3d

    content = ezc3d.c3d(path)
    header = content["header"]["points"]
    points = np.asarray(content["data"]["points"], float).transpose(2, 1, 0)[:, :, :3]
    return {
        "points": points,  # NaN where the residual is -1
        "rotations": np.asarray(content["data"]["rotations"], float).transpose(3, 2, 0, 1),
        "frames": np.array([header["first_frame"] + 1, len(points), len(points)]),
        "doubt": np.array([], str),
        **_parameters(content["parameters"]),
    }


def _in_pieces(path: Path) -> dict[str, np.ndarray] | None:
    """Give the arrays of a file, read as files of a few of its frames each; None of one of another kind.

    Rotations stand behind all frames, so a file that has some is one piece.
    """
    count = count_frames(path)
    if count is None:
        return None
    step = max(1, min(MOST_FRAMES, PIECE_BYTES // count.frame_bytes))
    frames = count.frames if count.frames == count.promised else 0
    if count.rotations:
        step = MOST_FRAMES + 1  # with rotations ezc3d takes 65535 for a number
        if frames > step:
            raise InputError(f"it has rotations and {frames} frames, of which {step} can be read at most")
    positions = np.empty((frames, count.points, 3))
    found: dict[str, np.ndarray] = {}
    with path.open("rb") as stream, tempfile.TemporaryDirectory() as folder:
        piece = Path(folder) / "piece.c3d"
        stream.seek(len(count.head))
        for start in range(0, frames, step):
            now = min(step, frames - start)
            head = count.head_of(now) if now <= MOST_FRAMES else count.head
            frames_bytes = stream.read() if count.rotations else stream.read(now * count.frame_bytes)
            piece.write_bytes(head + frames_bytes)
            found = _arrays(str(piece))
            if found["points"].shape != (now, count.points, 3) or (
                found["rotations"].size and not count.rotations
            ):
                raise InputError("its points do not stand as its header says")
            positions[start : start + now] = found["points"]
    return {
        **found,
        "points": positions,
        "frames": np.array([count.first, count.frames, count.promised]),
        "doubt": np.array([count.doubt] if count.doubt else [], str),
    }


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
