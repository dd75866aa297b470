"""Joint solutions of all parts of a subject: every recording is read, every solver run as often as needed."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from schemas.errors import TableError
from schemas.layout import Layout
from schemas.parts import Part
from schemas.poses import usable_poses
from stages.solve_joints.solution_rows import Row, solution_rows
from stages.solve_joints.solve import HandDescription, SolverSettings, solve_recordings, stream_recordings


@dataclass(frozen=True)
class PartRequest:
    """What one part of the table is made from: calibration recordings of a hand, and a solver's settings."""

    part: Part
    poses: tuple[Path, ...]
    layout: Layout
    settings: SolverSettings
    hand: HandDescription


def solve_parts(requests: Sequence[PartRequest]) -> dict[Part, list[Row] | Exception]:
    """Give the rows of every part, or why it failed, in the order of the requests.

    The requests are grouped by hand and recordings, each group of which is read once, and within a group by
    settings, each of which is solved once. Raises TableError where a file is no poses table.
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


def _rows_by_settings(group: Sequence[PartRequest]) -> dict[SolverSettings, list[Row]]:
    """Solve the joints of one hand's recordings with every solver that the group asks for."""
    layout, hand = group[0].layout, group[0].hand
    usable, reasons = usable_poses(group[0].poses)
    for reason in reasons:
        print(f"note: left out of the calibration: {reason}", file=sys.stderr)
    settings = dict.fromkeys(request.settings for request in group)
    recordings = stream_recordings(usable, layout, sample_frames=any(own.anatomical for own in settings))
    rows = {own: solution_rows(layout, solve_recordings(recordings, own, hand)) for own in settings}
    if not usable:
        message = f"no calibration recording: {'; '.join(reasons) or 'the study names none'}"
        rows = {own: [{**row, "message": message} for row in failed] for own, failed in rows.items()}
    return rows
