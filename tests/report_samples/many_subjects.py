"""A study of many subjects: the tables of one made-up subject, repeated, each subject's numbers scaled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa

from report_samples.made_study import FITTED_MODELS, make_study, write
from shukotsu.scores.study_comparison import compare_study
from shukotsu.study.results import STUDY_TABLES, Results
from shukotsu.study.study import read_study
from shukotsu.tables.catalogue import TABLES
from shukotsu.tables.typed_table import read_table

FIRST = "S001"
SCALED = ("skeleton_scores", "joint_errors", "bone_lengths")


def many_subjects(
    folder: Path, n_subjects: int, models: tuple[str, ...] = FITTED_MODELS, *, simulated: bool = True
) -> tuple[Path, Path]:
    """Write a study file, its sheet and its results; return the study file and the results folder."""
    study, results = make_study(folder, n_frames=20, models=models, subjects=(FIRST,), simulated=simulated)
    rng = np.random.default_rng(3)
    names = [f"S{index + 1:03}" for index in range(n_subjects)]
    header, *lines = (folder / "sheet.tsv").read_text("utf-8").splitlines()
    sheet = [header, *(line.replace(FIRST, name) for name in names for line in lines)]
    (folder / "sheet.tsv").write_text("\n".join(sheet) + "\n", "utf-8")
    factors = {(name, model): rng.lognormal(0.0, 0.2) for name in names for model in models}
    for table in STUDY_TABLES:
        path = results / f"{table}.parquet"
        rows = read_table(path, TABLES[table]).to_pylist()
        scaled = [
            column.name
            for column in TABLES[table].columns
            if table in SCALED and column.name.endswith("_mm") and pa.types.is_floating(column.type)
        ]
        repeated = []
        for name in names:
            for row in rows:
                factor = factors.get((name, row.get("model", "")), 1.0)
                numbers = {column: factor * row[column] for column in scaled if row[column] is not None}
                repeated.append(row | {"subject": name} | numbers)
        write(path, TABLES[table], repeated)
    compare_study(read_study(study), Results(results))
    return study, results
