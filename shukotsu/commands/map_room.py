"""Command line: a recording of two receivers on a rigid bar -> where the tracker may be trusted."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shukotsu.errors import InputError, listed
from shukotsu.stages import command_line

if TYPE_CHECKING:
    from shukotsu.checks.rigid_bar import Bar
    from shukotsu.checks.room_map import RoomMap

FEWEST_FRAMES, WORST_CELLS = 50, 3
SLICES = (1, 3, 5)
"""Sixths of the room's height that the picture shows."""


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu wand",
        "Say where in the room the tracker may be trusted, by a recording of two receivers on a rigid\n"
        "bar that was moved about, slowly and turning, where hands will be.",
        "shukotsu wand wand.arrows --out room.parquet",
        records_failure=False,
    )
    parser.add_argument("recording", type=Path, help="the raw capture (.arrows)")
    parser.add_argument("--out", type=Path, help="the map to write (.parquet), for `room:` of a study")
    return parser


def map_room(arguments: argparse.Namespace) -> None:
    """Print what a map says, and write it where asked. Raises InputError where there is no such bar."""
    from shukotsu.checks.rigid_bar import usable_bar
    from shukotsu.checks.room_map import room_map
    from shukotsu.schemas.catalogue import ROOM_MAP
    from shukotsu.schemas.tables import Provenance, write_table

    path = arguments.recording
    recorded = read_bar(path)
    try:
        bar, found, notes = usable_bar(recorded)
        room = room_map(bar, found)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    for note in notes:
        print(f"note: {path}: {note}", file=sys.stderr)
    print("\n".join([*summary_lines(bar, room), *picture(room)]))
    if arguments.out is not None:
        write_table(arguments.out, ROOM_MAP, map_columns(room), Provenance.of([path]))
        print(
            f"{arguments.out}: {room.n_frames.size} cells; a study reads it by `room: {arguments.out.name}`"
        )


def read_bar(path: Path) -> Bar:
    """Read the frames in which both receivers of a capture are valid; InputError where it has not two."""
    import numpy as np

    from shukotsu.checks.rigid_bar import Bar
    from shukotsu.skeleton.rotations import unit
    from shukotsu.trackers.archive import open_archive
    from shukotsu.trackers.decode.records_table import UNUSABLE, flagged_records
    from shukotsu.trackers.decode.survey import survey_archive

    archive = open_archive(path)
    rows: list[Any] = [np.zeros((0, 10))]
    for part in flagged_records(archive, survey_archive(archive)):
        records, good = part.records, ~part.flagged(*UNUSABLE, "device-error")
        columns = (records.station, records.frame, part.time_s, records.position_mm, records.quaternion)
        rows.append(np.column_stack(columns)[good])
    table = np.concatenate(rows)
    table = table[np.isfinite(table).all(1)]
    stations = np.unique(table[:, 0]).astype(int).tolist()
    if len(stations) != 2:
        has = f"receivers {listed([str(own) for own in stations])}" if stations else "no pose"
        raise InputError(
            f"{path}: has {has}; expected two, on one rigid bar: record with --stations and these two"
        )
    own = [table[table[:, 0] == station, 1:] for station in stations]
    _, *common = np.intersect1d(own[0][:, 0], own[1][:, 0], return_indices=True)
    if len(common[0]) < FEWEST_FRAMES:
        raise InputError(f"{path}: {len(common[0])} frames have both receivers; expected a minute of them")
    both = np.stack([each[rows] for each, rows in zip(own, common, strict=True)], 1)
    return Bar((str(stations[0]), str(stations[1])), both[:, 0, 1], both[..., 2:5], unit(both[..., 5:]))


def map_columns(room: RoomMap) -> dict[str, Any]:
    """Give the columns of the map's table."""
    import numpy as np

    columns: dict[str, Any] = {f"{axis}_mm": room.centres_mm[..., at] for at, axis in enumerate("xyz")}
    columns |= {name: np.full(room.n_frames.shape, getattr(room, name)) for name in ("cell_mm", "bar_mm")}
    for name in ("error", "error_sd", "noise"):
        columns |= dict(zip((f"{name}_mm", f"{name}_deg"), getattr(room, name), strict=True))
    columns |= {"n_frames": room.n_frames, "trusted": room.trusted}
    return {name: own.ravel() for name, own in columns.items()}


def summary_lines(bar: Bar, room: RoomMap) -> list[str]:
    """Say in lines how large the trusted box is, where it is worst, and where data lack."""
    import numpy as np

    from shukotsu.checks.room_map import TRUSTED, trusted_box

    (mm, deg), noise = (np.nanmedian(own.reshape(2, -1), axis=1) for own in (room.error, room.noise))
    lines = [
        f"receivers {' and '.join(bar.names)}, {room.bar_mm:.1f} mm apart, {len(bar.time_s)} frames: "
        f"{room.known.sum()} cells of {room.cell_mm:.0f} mm measured, {room.trusted.sum()} of them trusted "
        f"(within {TRUSTED[0]:g} mm and {TRUSTED[1]:g} deg)",
        f"usually off by {mm:.2f} mm and {deg:.2f} deg a receiver, and noise of {noise[0]:.2f} mm and "
        f"{noise[1]:.2f} deg; what both are off alike does not show",
    ]
    if (box := trusted_box(room)) is None:
        lines.append("no part of the room is trusted: look for metal, or go nearer to the transmitter")
    else:
        size = " x ".join(f"{own / 10:.0f}" for own in box[1] - box[0])
        sides = ", ".join(f"{a} {p:+.0f} to {q:+.0f}" for a, p, q in zip("xyz", *box, strict=True))
        lines.append(f"largest trusted box: {size} cm ({sides} mm)")
    for at in np.argsort(-_worse(room), axis=None)[:WORST_CELLS]:
        cell = np.unravel_index(at, room.n_frames.shape)
        if room.known[cell] and not room.trusted[cell]:
            mm, deg = (float(own[cell]) for own in room.error)
            lines.append(f"off by {mm:.1f} mm and {deg:.1f} deg {_where(room.centres_mm[cell])}")
    if (few := (room.n_frames > 0) & ~room.known).any():
        middle = _where(room.centres_mm[few].mean(0))
        lines.append(
            f"{few.sum()} cells lack data, their middle {middle}: move on there, slowly, twice or more"
        )
    return lines


def _worse(room: RoomMap) -> Any:
    """The larger of a cell's errors, mm or deg; 0 where data lack."""
    import numpy as np

    return np.nan_to_num(room.error).max(0)


def _where(place_mm: Any) -> str:
    """A place by its distance and direction from the transmitter."""
    ways = ", ".join(f"{own / 10:+.0f} cm in {axis}" for axis, own in zip("xyz", place_mm, strict=True))
    return f"{float(place_mm @ place_mm) ** 0.5 / 10:.0f} cm from the transmitter ({ways})"


def picture(room: RoomMap) -> list[str]:
    """Draw slices of the map beside each other, in lines."""
    import numpy as np

    digits = np.clip(np.round(_worse(room)), 1, 9).astype(int).astype(str)
    signs = np.where(room.trusted, "+", np.where(room.known, digits, "."))
    nx, ny, nz = signs.shape
    heights = list(dict.fromkeys(nz * own // 6 for own in SLICES))
    rows = [[f"z {room.centres_mm[0, 0, z, 2]:+.0f} mm" for z in heights]]
    rows += [["".join(signs[:, y, z]) for z in heights] for y in reversed(range(ny))]
    lines = ["  ".join(f"{own:{max(nx, 12)}}" for own in row).rstrip() for row in rows]
    return ["slices, x to the right, y upwards: + trusted, . no data, else mm or deg, the larger:", *lines]


def main(argv: list[str]) -> int:
    """Map the room; give the exit code."""
    return command_line.run(build_parser, argv, map_room)
