"""Joint solutions of all parts of a subject: every recording is read, every solver run as often as needed."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from shukotsu.errors import TableError, joined
from shukotsu.schemas.layout import Layout
from shukotsu.schemas.model import JointSolving
from shukotsu.schemas.parts import Part
from shukotsu.schemas.poses import usable_poses
from shukotsu.stages.solve_joints.solution_rows import Row, solution_rows
from shukotsu.stages.solve_joints.solve import solve_recordings, stream_recordings


@dataclass(frozen=True)
class PartRequest:
    """What a part of the table is made from: a hand's calibration recordings, a solver's settings."""

    part: Part
    poses: tuple[Path, ...]
    layout: Layout
    settings: JointSolving


def solve_parts(requests: Sequence[PartRequest]) -> dict[Part, list[Row] | Exception]:
    """The rows of every part, or why it failed, in the order of the requests.

    Every recording is read and every solver run once. Raises TableError where a file is no poses table.
    """
    groups: dict[tuple[str, tuple[Path, ...]], list[PartRequest]] = {}
    for request in requests:
        groups.setdefault((request.part.hand, request.poses), []).append(request)
    outcomes: dict[Part, list[Row] | Exception] = {}
    for group in groups.values():
        try:
            rows = _rows_by_settings(group)
        except TableError:
            raise
        except Exception as error:  # also a bug must not cost the study its other hands
            outcomes |= dict.fromkeys((request.part for request in group), error)
        else:
            outcomes |= {request.part: rows[request.settings] for request in group}
    return {request.part: outcomes[request.part] for request in requests}


def _rows_by_settings(group: Sequence[PartRequest]) -> dict[JointSolving, list[Row]]:
    """Solve the joints of one hand's recordings with every solver that the group asks for."""
    layout = group[0].layout
    usable, reasons = usable_poses(group[0].poses)
    for reason in reasons:
        print(f"note: left out of the calibration: {reason}", file=sys.stderr)
    settings = dict.fromkeys(request.settings for request in group)
    recordings = stream_recordings(usable, layout)
    rows = {own: solution_rows(layout, solve_recordings(recordings, own)) for own in settings}
    if not usable:
        why = f"no calibration recording: {joined(reasons) or 'the study names none'}"
        rows = {own: [{**row, "message": why} for row in failed] for own, failed in rows.items()}
    return rows
