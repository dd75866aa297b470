"""Small valid configuration files, sheets, plans and tables, as bytes: what the fuzzer spoils."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fuzzing.sample_files import FRAMES, SEGMENTS
from fuzzing.tracker_streams import pose
from shukotsu.schemas.catalogue import POSES
from shukotsu.schemas.config_files import CONFIG_FOLDER
from shukotsu.schemas.parts import PARTS_KEY, Part
from shukotsu.schemas.plan import StudyPlans, plan_text
from shukotsu.schemas.study import read_study
from shukotsu.schemas.tables import METADATA_KEY, Table

STUDY: dict[str, bytes] = {
    "study.yaml": b"study: a\nrecordings: recordings.tsv\nparticipants: participants.tsv\n"
    b"corrections: corrections.tsv\nmeasurements: measurements.tsv\ntouches: touches.tsv\n"
    b"events: events.tsv\nfactors: [group, hand]\n"
    b"layout: liberty16\nmodels: [paper-fig4, whole-hand]\nexports: [bvh, glb]\n",
    "recordings.tsv": b"subject\thand\ttask\trole\tfile\ttrial\tlayout\tformat\tmapping\themisphere\texclude"
    b"\taccept\n01\tright\trom\tboth\ta.csv\t\t\t\t\t\t\t\n01\tright\tgrasp\tevaluation\tb.csv\t2\tliberty16"
    b"\tauto\tm.yaml\trepair\tlost\tseen\n02\tleft\trom\tboth\tc.csv\n",
    "participants.tsv": b"subject\thand_length_mm\thand_breadth_mm\tgroup\n01\t180\t80\ta\n02\t\t\tb\n",
    "corrections.tsv": b"subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\tnote\n"
    b"01\tright\tindex_pip\t1\t-2\t3e0\tx\n",
    "measurements.tsv": b"subject\thand\tquantity\tvalue_mm\tsd_mm\n01\tright\tindex_proximal\t40.5\t1\n",
    "touches.tsv": b"subject\thand\ttask\tdigit\tpart\tfrom_s\tto_s\tx_mm\ty_mm\tz_mm\tsd_mm\n"
    b"01\tright\trom\tindex\tpad\t0.5\t1\t1\t2\t3\t0.5\n",
    "events.tsv": b"subject\thand\ttask\ttrial\tonset_s\tduration_s\tname\tvalue\n"
    b"01\tright\tgrasp\t2\t0.5\t1\ttap\t64\n",
}
"""A study file and its sheets."""

LAYOUTS = tuple(path.read_bytes() for path in sorted((CONFIG_FOLDER / "layouts").glob("*.yaml")))
MODELS = tuple(
    path.read_bytes().replace(f"model: {path.stem}".encode(), b"model: model")
    for path in sorted((CONFIG_FOLDER / "models").glob("*.yaml"))
)


def plan_bytes(folder: Path) -> bytes:
    """The plan of subject 01 of STUDY, which is written into that folder."""
    for name, data in STUDY.items():
        (folder / name).write_bytes(data)
    return plan_text(StudyPlans(read_study(folder / "study.yaml"), Path("results/a")).content("01")).encode()


PARTS = (Part("right", "paper-fig4", "", "01"), Part("right", "paper-fig4", "rom", "01"))
_TEXTS = {"subject": "01", "hand": "right", "task": "rom", "model": "paper-fig4", "made_without": ""}


def metadata_of(table: Table) -> dict[str, Any]:
    """Give what this program writes into a table's file, as JSON types."""
    names = {"subject": "01", "hand": "right", "task": "rom", "trial": "", "layout": "liberty16"}
    extra = {
        "inputs": [{"file": "a.csv", "sha256": "0" * 64}],
        "parameters": {**names, "absent": [], "notes": ["late"], "losses": [], "missing_frames": 0},
    }
    whole: dict[str, Any] = json.loads((table.arrow_schema(extra).metadata or {})[METADATA_KEY])
    return whole


def parts_list() -> list[dict[str, Any]]:
    """Give what a subject table lists of its parts."""
    return [asdict(PARTS[0]), {**asdict(PARTS[1]), "failure": "too few frames"}]


def table_bytes(table: Table, metadata: bytes | None = None, parts: bytes | None = None) -> bytes:
    """A table of two rows, of poses a row group for each segment, without any checksum."""
    columns = _poses_columns() if table is POSES else {c.name: _values(c.name, c.type) for c in table.columns}
    fields = [pa.field(c.name, c.type, c.nullable) for c in table.columns]
    written = {
        METADATA_KEY: json.dumps(metadata_of(table)).encode() if metadata is None else metadata,
        PARTS_KEY.encode(): json.dumps(parts_list()).encode() if parts is None else parts,
    }
    arrays = [pa.array(columns[field.name], field.type) for field in fields]
    out = io.BytesIO()
    pq.write_table(
        pa.Table.from_arrays(arrays, schema=pa.schema(fields, written)),
        out,
        row_group_size=FRAMES if table is POSES else 1 << 10,
        compression="none",
        use_dictionary=False,
    )
    return out.getvalue()


def _values(name: str, kind: pa.DataType) -> list[Any]:
    if pa.types.is_string(kind):
        return [_TEXTS.get(name, ""), _TEXTS.get(name, "a")]
    if pa.types.is_boolean(kind):
        return [True, False]
    if pa.types.is_fixed_size_list(kind):
        return [[0.5] * kind.list_size, [1.0] * kind.list_size]
    return [1, 2] if pa.types.is_integer(kind) else [0.25, 1.5]


def _poses_columns() -> dict[str, list[Any]]:
    rows = [(frame, station) for station in SEGMENTS for frame in range(FRAMES)]
    numbers = [[*position, *turn] for position, turn in (pose(*row) for row in rows)]
    names = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    return {
        **{
            c.name: [""] * len(rows) if pa.types.is_string(c.type) else [0] * len(rows) for c in POSES.columns
        },
        "frame": [frame for frame, _ in rows],
        "time_s": [frame / 240 for frame, _ in rows],
        "segment": [SEGMENTS[station] for _, station in rows],
        "valid": [True] * len(rows),
        **dict(zip(names, map(list, zip(*numbers, strict=True)), strict=True)),
    }
