"""What ezc3d reads of a C3D file, in a process of its own: on damaged files it may crash or never end."""

from __future__ import annotations

import io
import os
import resource
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from schemas.errors import InputError
from schemas.limits import check_regular
from schemas.text_files import reading

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

_ROOT = Path(__file__).parents[3]


def read_content(path: Path) -> Mapping[str, np.ndarray]:
    """Give `points` (T, P, 3), `rotations` (T', R, 4, 4), `frames` (first, last; from 0) and the PARAMETERS
    that the file has, as "GROUP:NAME".

    Raises InputError where the file is absent or is no C3D file that can be read.
    """
    with reading(path, "a C3D file"):
        megabytes = check_regular(path, "a C3D file") / 1e6
    command = [sys.executable, "-m", "stages.capture.formats.c3d_content", str(path.absolute())]
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
        said = child.stderr.decode("utf-8", "replace").strip().splitlines()
        raise _unreadable(path, said[-1] if said and child.returncode == 1 else "it is damaged")
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
    import ezc3d

    content = ezc3d.c3d(path)
    header = content["header"]["points"]
    arrays = {
        # NaN where the residual is -1
        "points": np.asarray(content["data"]["points"], float).transpose(2, 1, 0)[:, :, :3],
        "rotations": np.asarray(content["data"]["rotations"], float).transpose(3, 2, 0, 1),
        "frames": np.array([header["first_frame"], header["last_frame"]]),
        **_parameters(content["parameters"]),
    }
    written = io.BytesIO()
    np.savez(written, allow_pickle=False, **arrays)
    sys.stdout.buffer.write(written.getvalue())


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
