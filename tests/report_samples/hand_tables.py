"""The tables of a made-up study's hands: its study-wide tables, taken apart again."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from schemas.catalogue import JOINT_SOLUTIONS, TABLES
from schemas.model import read_model
from schemas.results import FIT_TABLES, HAND_TABLES, SCORE_TABLES, Results
from schemas.study import Study
from schemas.tables import Provenance, Table, columns_from_rows, read_table, write_table


def write_hand_tables(study: Study, results: Results) -> None:
    """Write what the earlier stages would have left of every hand; of the joint solves no row."""
    models = {name: read_model(path.absolute()) for name, path in study.models.items()}
    for name in (*HAND_TABLES, *FIT_TABLES, *SCORE_TABLES):
        if not results.study_table(name).is_file():
            continue
        table = TABLES[name]
        whole = read_table(results.study_table(name), table)
        for hand in study.hands:
            mine = whole.filter(
                pc.and_(pc.equal(whole["subject"], hand.subject), pc.equal(whole["hand"], hand.hand))
            )
            if name in SCORE_TABLES:
                _write(results.score_table(hand, name), table, mine)
                continue
            for model in models:
                if name in HAND_TABLES or models[model].fitting is not None:
                    rows = mine.filter(pc.equal(mine["model"], model))
                    _write(results.hand_table(model, hand, name), table, rows)
    for hand in study.hands:
        for model in models:
            none = columns_from_rows(JOINT_SOLUTIONS, [])
            path = results.hand_table(model, hand, "joint_solutions")
            write_table(path, JOINT_SOLUTIONS, none, Provenance())


def _write(path: Path, table: Table, rows: pa.Table) -> None:
    columns = {column.name: rows.column(column.name) for column in table.columns}
    write_table(path, table, columns, Provenance())
