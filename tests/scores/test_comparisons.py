"""Comparing models across subjects: averaging, missing numbers, and correction for multiple tests."""

import json
import shutil
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_samples.made_study import FITTED_MODELS, MadeStudy, make_study, scored_study
from stage_runs import compare_models as main

from shukotsu.report.study_results import StudyResults
from shukotsu.scores import comparisons
from shukotsu.scores.comparisons import ALL_DIGITS, NOT_SCORED, ComparedModels, compare_models
from shukotsu.scores.observations import METRICS, Metric, Observation, ScoredStudy, observations
from shukotsu.study.model import read_model
from shukotsu.study.results import MODEL_COMPARISONS, Results
from shukotsu.tables.catalogue import PROBLEMS, TABLES
from shukotsu.tables.typed_table import Provenance, columns_from_rows, read_metadata, read_table, write_table

PAIR = ("whole-hand", "paper-fig4")
JOINT_ERROR, _, TRUE_TIP, _, REPLAY = METRICS


def observations_of(values: Iterable[Sequence[float]], digit: str = "index") -> list[Observation]:
    """Return one observation per subject and model of PAIR."""
    return [
        Observation(f"S{subject:02}", model, digit, "right hand, rom", value)
        for subject, numbers in enumerate(values)
        for model, value in zip(PAIR, numbers, strict=True)
    ]


def compare(
    seen: Iterable[Observation],
    monkeypatch: pytest.MonkeyPatch,
    models: Sequence[str] = PAIR,
    subjects: Sequence[str] = (),
) -> ComparedModels:
    """Compare given observations by TRUE_TIP, with paper-fig4 as the baseline."""
    frame = pd.DataFrame(seen, columns=Observation._fields)
    monkeypatch.setattr(comparisons, "METRICS", (TRUE_TIP,))
    monkeypatch.setattr(comparisons, "observations", lambda *_, **__: frame)
    empty = pd.DataFrame()
    named = {name: read_model(name) for name in models}
    names = sorted({*frame["subject"], *subjects})
    return compare_models(ScoredStudy(tuple(names), named, {}, empty, empty, empty))


def with_baseline(compared: ComparedModels) -> dict[tuple[str, str], dict[str, Any]]:
    return {(row["model"], row["digit"]): row for row in compared.differences if row["baseline"]}


def differences(compared: ComparedModels, digit: str = ALL_DIGITS) -> dict[str, float]:
    return {
        row["subject"]: row["difference"]
        for row in compared.pairs
        if (row["digit"], row["model"], row["other"]) == (digit, *PAIR)
    }


def missing(compared: ComparedModels, subject: str) -> dict[str, dict[str, int]]:
    """Return the reasons for a subject's missing numbers over all digits, by model."""
    return {
        row["model"]: json.loads(row["missing"])
        for row in compared.values
        if (row["digit"], row["subject"]) == (ALL_DIGITS, subject) and row["missing"]
    }


def test_a_subject_counts_once_with_any_number_of_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hands, tasks and digits are averaged within a subject before subjects are averaged."""
    seen = observations_of([(1.0, 2.0), (2.0, 2.0), (2.0, 4.0)])
    seen += [
        Observation("S00", model, digit, recording, value)
        for digit, recording in product(("index", "ring"), ("left hand, rom", "right hand, grip, trial 2"))
        for model, value in zip(PAIR, (4.0, 8.0), strict=True)
    ]
    compared = compare(seen, monkeypatch)
    assert differences(compared) == {"S00": pytest.approx(-17 / 5), "S01": 0.0, "S02": -2.0}
    assert differences(compared, "index") == {"S00": pytest.approx(-3.0), "S01": 0.0, "S02": -2.0}
    assert differences(compared, "ring") == {"S00": -4.0}
    overall = with_baseline(compared)[PAIR[0], ALL_DIGITS]
    assert overall["mean_difference"] == pytest.approx((-17 / 5 - 2) / 3)
    assert [overall[name] for name in ("n_compared_subjects", "n_better", "n_equal")] == [3, 2, 1]


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=8), st.integers(0, 2))
def test_every_subject_is_compared_or_listed_as_missing(there: list[tuple[bool, bool]], more: int) -> None:
    """A subject that is not compared has the reason for each missing model."""
    seen = [
        Observation(f"S{k:02}", model, "index", "rom", 1.0 if scored else None, "" if scored else "why")
        for k, pair in enumerate(there)
        for model, scored in zip(PAIR, pair, strict=True)
    ]
    extra = [f"T{index}" for index in range(more)]
    with pytest.MonkeyPatch.context() as monkeypatch:
        if not any(map(any, there)):
            assert compare(seen, monkeypatch, subjects=extra).values == []
            return
        compared = compare(seen, monkeypatch, subjects=extra)
    both = [f"S{k:02}" for k, scored in enumerate(there) if all(scored)]
    assert list(differences(compared)) == both
    for k, scored in enumerate(there):
        absent = {model: {"why": 1} for model, is_scored in zip(PAIR, scored, strict=True) if not is_scored}
        assert missing(compared, f"S{k:02}") == absent
    for name in extra:
        assert missing(compared, name) == {model: {NOT_SCORED: 1} for model in PAIR}
    assert with_baseline(compared)[PAIR[0], ALL_DIGITS]["n_compared_subjects"] == len(both)


def test_comparisons_with_one_model_are_corrected_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Comparisons over all digits and those of single digits are two families, which include comparisons with
    too few subjects but none without any.
    """
    seen = observations_of([(1.0, 2.0 + 0.1 * s) for s in range(8)])
    seen += observations_of([(1.0, 2.0), (1.0, 3.0)], "ring")
    seen += [Observation("S00", "rigid", "thumb", "right hand, rom", 3.0)]
    rows = with_baseline(compare(seen, monkeypatch, (*PAIR, "rigid")))
    assert rows[PAIR[0], ALL_DIGITS]["p_holm"] == pytest.approx(2 / 256)
    assert rows[PAIR[0], "index"]["p"] == pytest.approx(2 / 256)
    assert rows[PAIR[0], "index"]["p_holm"] == pytest.approx(4 / 256)
    assert rows[PAIR[0], "ring"]["p_holm"] == pytest.approx(0.5)
    assert {row["n_comparisons"] for (_, digit), row in rows.items() if digit} == {2}
    assert rows["rigid", "thumb"].get("p") is rows["rigid", "thumb"]["p_holm"] is None


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> MadeStudy:
    """A simulated study with a whole-hand model."""
    folder = tmp_path_factory.mktemp("fitted")
    return make_study(folder, models=FITTED_MODELS, subjects=("S01",), simulated=True)


@pytest.fixture(scope="module")
def fitted(study: MadeStudy) -> StudyResults:
    return study.results


def seen_in(results: StudyResults, metric: Metric, *names: str, held_out: bool = True) -> pd.DataFrame:
    return observations(scored_study(results), metric, names, held_out=held_out)


@pytest.mark.parametrize("held_out", [True, False])
def test_compared_numbers_are_those_of_the_scores(fitted: StudyResults, held_out: bool) -> None:
    """The mean over a subject's hands and digits is that of the held-out or the other rows."""
    seen = seen_in(fitted, TRUE_TIP, *PAIR, held_out=held_out)
    assert list(dict.fromkeys(seen["digit"])) == ["thumb", "index", "middle", "ring", "little"]
    for model in PAIR:
        rows = [r for r in fitted.rows.skeleton_scores if (r["model"], r["held_out"]) == (model, held_out)]
        values = [r["true_tip_mean_mm"] for r in rows if r["true_tip_mean_mm"] is not None]
        assert seen.loc[seen["model"] == model, "value"].mean() == pytest.approx(np.mean(values))
    assert set(seen.loc[seen["value"].isna(), "reason"]) == {"joint ring_dip failed"}


def test_joint_errors_are_those_of_the_judged_skeletons(fitted: StudyResults) -> None:
    """Held-out skeletons are those made from rom, not from opposition; a reference has no calibration."""
    rows = [
        {**row, "error_mm": row["error_mm"] + 100.0}
        if row["calibrated_on"] == "opposition" and row["error_mm"] is not None
        else row
        for row in fitted.rows.joint_errors
    ]
    moved = fitted.with_rows(joint_errors=rows)
    for model, made_from in (("whole-hand", "rom"), ("prior-only", "")):
        mine = [r for r in rows if (r["model"], r["calibrated_on"]) == (model, made_from)]
        little = [r["error_mm"] for r in mine if r["joint"].startswith("little")]
        seen = seen_in(moved, JOINT_ERROR, model)
        assert seen.loc[seen["digit"] == "little", "value"].mean() == pytest.approx(np.mean(little))
    both = [
        seen_in(moved, JOINT_ERROR, "whole-hand", held_out=held_out)["value"].mean()
        for held_out in (True, False)
    ]
    assert both[1] == pytest.approx(both[0] + 100.0)


@pytest.mark.slow
def test_the_stage_writes_tables_without_suspect_hands(study: MadeStudy, tmp_path: Path) -> None:
    """With a suspect finding on one hand, only recordings of the other hand are compared."""
    results = Results(Path(shutil.copytree(study.folder, tmp_path / "results")))

    def count() -> int:
        assert main(["--study", str(study.file), "--results", str(results.folder)]) == 0
        rows = read_table(results.study_table("model_pairs"), TABLES["model_pairs"]).to_pylist()
        keys = ("S01", ALL_DIGITS, *PAIR)
        names = ("subject", "digit", "model", "other")
        return sum(row["n_places"] for row in rows if tuple(row[name] for name in names) == keys)

    whole = count()
    inputs = read_metadata(results.study_table("model_values"))["inputs"]
    assert "skeleton_scores.parquet" in {Path(entry["file"]).name for entry in inputs}
    row = {column.name: "" for column in PROBLEMS.columns} | {"subject": "S01", "severity": "suspect"}
    counts = []
    for hand in ("left", "right"):
        columns = columns_from_rows(PROBLEMS, [row | {"hand": hand}])
        write_table(results.study_table(PROBLEMS.name), PROBLEMS, columns, Provenance((), {}))
        counts.append(count())
    assert min(counts) > 0
    assert sum(counts) == whole
    assert all(results.study_table(name).is_file() for name in MODEL_COMPARISONS)
