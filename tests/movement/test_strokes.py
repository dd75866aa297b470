"""The stage from a subject's tables to its own: somebody plays, and what is measured is what was played."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulated_poses import write_poses
from small_study import QUICK, PlannedSubject, planned_subject
from stage_runs import measure_movement as main
from stage_runs import of_plan

from benchmarks.pianist import Played, play
from shukotsu.tables.catalogue import CLOCKS, EVENTS, TABLES
from shukotsu.tables.typed_table import Provenance, columns_from_rows, read_table, rows_of, write_table

TASK, SEED = "opposition", 4
KEYS = {"subject": "01", "session": "", "hand": "right", "task": TASK, "trial": ""}
Row = dict[str, Any]


@dataclass
class Measured:
    """A subject who played, and the tables of it."""

    subject: PlannedSubject
    played: Played
    out: Path

    def rows(self, table: str, **wanted: Any) -> list[Row]:
        """Rows of a table that have those values."""
        rows = rows_of(read_table(self.out / f"{table}.parquet", TABLES[table]))
        return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    folder = tmp_path_factory.mktemp("keys")
    recordings = [("right", "rom", "calibration"), ("right", TASK, "evaluation")]
    alone = QUICK.replace("steps: 10", "steps: 10, share_lengths: false")
    subject = planned_subject(folder, recordings, ["rigid", "quick"], n_frames=900, seed=SEED, quick=alone)
    played = play(SEED, "right", 0.4, 14.0, 0.2, "")
    write_poses(subject.poses(TASK), played.poses, "right", TASK)
    subject.run_stages(reference=False)
    rows = []
    for number, stroke in enumerate(played.strokes):
        duration_s = stroke.up_s - stroke.contact_s
        times = {"onset_s": stroke.contact_s, "duration_s": duration_s, "onset_sd_ms": 1.0}
        name = {"event": number, "name": f"note {stroke.pitch}", "source": "midi", "message": ""}
        rows.append(KEYS | name | times)
    rows[3] |= {"name": f"note {played.strokes[3].pitch} {played.strokes[3].digit}"}
    rows[4] |= {"onset_sd_ms": 30.0}
    rows[5] |= {"onset_s": 0.5, "duration_s": 0.1}
    rows.append(rows[5] | {"event": len(rows), "name": "lamp"})
    write_events(subject, rows)
    assert run(subject, folder / "tables") == 0
    return Measured(subject, played, folder / "tables")


def write_events(subject: PlannedSubject, rows: list[Row], status: str = "ok") -> None:
    clock = KEYS | {"source": "midi", "status": status, "message": "", "n_pulses": 0}
    clock |= {"n_missing": 0, "n_extra": 0}
    for table, table_rows in ((EVENTS, rows), (CLOCKS, [clock])):
        path = subject.plan_file.with_name(f"{table.name}.parquet")
        write_table(path, table, columns_from_rows(table, table_rows), Provenance())


def run(subject: PlannedSubject, out: Path, *options: str) -> int:
    folder = subject.plan_file.parent
    names = (f"--events={folder}/events.parquet", f"--clocks={folder}/clocks.parquet", f"--out={out}")
    return main([*of_plan("measure_movement", subject.plan_file), *names, *options])


def test_strokes_are_those_that_were_played(measured: Measured) -> None:
    rows = sorted(measured.rows("event_strokes", model="quick"), key=lambda row: row["event"])
    assert [row["event"] for row in rows] == list(range(len(measured.played.strokes))), "a lamp is no stroke"
    pairs = [pair for pair in zip(rows, measured.played.strokes, strict=True) if pair[0]["event"] != 5]
    used = [(row, stroke) for row, stroke in pairs if row["used"]]
    assert len(used) > 0.9 * len(pairs)
    assert np.mean([row["digit"] == stroke.digit for row, stroke in used]) > 0.95
    lag_ms = np.array([1e3 * (row["key_down_s"] - stroke.contact_s) for row, stroke in used])
    assert np.abs(lag_ms).max() < 4
    speed = np.array([row["contact_speed_mm_s"] / stroke.speed_mm_s for row, stroke in used])
    assert np.mean(speed) == pytest.approx(1.0, abs=0.05)
    assert np.std(speed) < 0.08
    assert all(row["peak_speed_before_mm_s"] >= row["contact_speed_mm_s"] for row, _ in used)
    for model in ("rigid", "quick"):
        row = measured.rows("event_strokes", model=model)[3]
        assert (row["contact_speed_sd_mm_s"] is None) == (model == "rigid"), "fitted hands alone state errors"


def test_what_is_given_is_believed_and_what_is_not_known_is_not_used(measured: Measured) -> None:
    rows = sorted(measured.rows("event_strokes", model="quick"), key=lambda row: row["event"])
    named, late, other = rows[3:6]
    assert (named["digit"], named["used"]) == (measured.played.strokes[3].digit, True)
    assert (late["used"], late["digit"]) == (False, "")
    assert late["message"] == "its onset is known to 30 ms, more than 10"
    assert (other["used"], other["digit"]) == (False, ""), "nothing went down then"
    assert other["message"].startswith("no digit of this hand went down")


def test_events_on_a_clock_that_is_weak_are_not_used(measured: Measured, tmp_path: Path) -> None:
    copy = measured.subject.copied(tmp_path)
    rows = list(rows_of(read_table(copy.plan_file.with_name("events.parquet"), EVENTS)))
    write_events(copy, rows, "weak")
    assert run(copy, tmp_path / "tables") == 0
    strokes = Measured(copy, measured.played, tmp_path / "tables").rows("event_strokes")
    assert not any(row["used"] for row in strokes)
    assert strokes[0]["message"] == "its clock is not sure: its clock is weak"
