"""Comparisons of movement between factor levels, sessions and trials of a study.

Each subject contributes one value per level, averaged first over trials and then over sessions, so that
subjects who were recorded more often have no more weight. Recordings of a hand with a suspect finding are
left out.

p_holm and the verdicts are corrected over a family: all quantities, joints, angles and digits in all hands
and tasks, for one pair of levels under one model. Repeatability is stated between sessions, and between the
trials of each subject's first session. It uses the sessions or trials that at least half of the subjects
have, and the subjects who have all of these.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from shukotsu.arrays import Array, Float
from shukotsu.errors import list_names
from shukotsu.scores import observations, paired_statistics
from shukotsu.scores.paired_statistics import FEWEST_IN_GROUP, FEWEST_REPEATED, FEWEST_SUBJECTS, LEVEL
from shukotsu.study.results import Results
from shukotsu.study.study import OWN_FACTORS
from shukotsu.tables import catalogue
from shukotsu.tables.typed_table import Provenance, Table, columns_from_rows, write_table
from shukotsu.translation import tr

if TYPE_CHECKING:
    from shukotsu.tables.rows import MovementDifferencesRow, MovementReliabilityRow


@dataclass(frozen=True)
class ComparedColumn:
    """A column of a table that is compared; of : columns that identify the joint, angle or digit of a row."""

    table: Table
    name: str
    of: tuple[str, ...]

    @property
    def unit(self) -> str:
        """Unit of the column's values."""
        return self.table.column(self.name).unit


_OF_ANGLES = ("range_deg", "full_range_deg", "median_deg", "speed_median_deg_s", "speed_p95_deg_s")
_OF_TIPS = ("path_length_mm", "speed_median_mm_s", "speed_p95_mm_s")
QUANTITIES = (
    *(ComparedColumn(catalogue.RANGES_OF_MOTION, name, ("joint", "angle")) for name in _OF_ANGLES),
    *(ComparedColumn(catalogue.FINGERTIP_PATHS, name, ("digit",)) for name in _OF_TIPS),
)


RECORDING = ["subject", "session", "hand", "task", "trial"]
SUSPECT = "suspect"
SESSION, TRIAL = "session", "trial"


@dataclass(frozen=True)
class RecordingLevels:
    """The study's recordings with their factor levels.

    rows : the columns RECORDING, one column per factor (`level_column`; empty if the level is unknown), and
    `left_out`, the reason why a recording is not used, or empty. factors : the factors that are compared.
    """

    rows: pd.DataFrame
    factors: tuple[str, ...]

    @property
    def counted(self) -> pd.DataFrame:
        """The recordings that are used."""
        return self.rows[self.rows["left_out"] == ""]

    @cached_property
    def contained(self) -> dict[str, dict[tuple[str, str], str]]:
        """Factors whose level changes between a subject's sessions, or trials, by hand and task.

        The keys are session or trial, then hand and task; factors are separated by semicolons. The effect of
        such a factor adds to the change between repetitions, which then is more than measurement error.
        """
        recordings = self.rows
        if SESSION in self.factors:
            recordings = recordings.assign(**{level_column("") + SESSION: recordings[SESSION]})
        names = [name for name in recordings if name.startswith(level_column(""))]
        changing: dict[str, dict[tuple[str, str], str]] = {SESSION: {}, TRIAL: {}}
        for across, whose in ((SESSION, ["subject"]), (TRIAL, ["subject", SESSION])) if names else ():
            for (hand, task), rows in recordings.groupby(["hand", "task"], sort=False):
                levels = rows.groupby([*whose, across], sort=False)[names].agg(frozenset)
                n = levels.groupby(whose, sort=False).nunique()
                changed = n.columns[(n > 1).any()].str.removeprefix(level_column(""))
                changing[across][str(hand), str(task)] = ";".join(changed)
        return changing


def level_column(factor: str) -> str:
    """Return the name of the column of a factor's levels, distinct from columns of the tables."""
    return factor if factor in OWN_FACTORS else f"level of {factor}"


def mark_suspect(
    rows: Sequence[Mapping[str, str]], factors: Collection[str], problems: pd.DataFrame
) -> RecordingLevels:
    """Return the recordings with their levels, with those of suspect hands marked as left out.

    rows : from `factor_levels`. problems : rows of the problems table.
    """
    names = [*RECORDING, *factors]
    levels = pd.DataFrame(rows, columns=list(dict.fromkeys(names)), dtype=str)
    levels = levels.rename(columns={name: level_column(name) for name in names if name not in RECORDING})
    hand = ["subject", "session", "hand"]
    suspect = set(problems.loc[problems["severity"] == SUSPECT, hand].itertuples(index=False, name=None))
    reasons = [SUSPECT if key in suspect else "" for key in levels[hand].itertuples(index=False, name=None)]
    return RecordingLevels(levels.assign(left_out=reasons), tuple(factors))


def numbers_of(quantity: ComparedColumn, whole: pd.DataFrame, counted: pd.DataFrame) -> pd.DataFrame:
    """Return a quantity's values in the recordings that are used.

    The columns are those of `counted`, and model, of (such as joint and angle) and value. Rows are sorted by
    session and then trial, in the order of `in_order`. whole : the quantity's table. counted : the recordings
    that are used.
    """
    first, *others = quantity.of
    of = whole[first].str.cat([whole[name] for name in others], sep=" ") if others else whole[first]
    numbers = whole[[*RECORDING, "model"]].assign(of=of, value=whole[quantity.name].astype(float))
    numbers = numbers.dropna(subset="value").merge(counted, on=RECORDING)
    for column in ("trial", "session"):
        order = {name: rank for rank, name in enumerate(in_order(counted, column))}
        numbers = numbers.sort_values(column, key=lambda names, order=order: names.map(order), kind="stable")
    return numbers.reset_index(drop=True)


def in_order(rows: pd.DataFrame, column: str) -> list[str]:
    """Return the values of a column of recordings in the sheet's order.

    Subjects with most values determine the order, so that a subject whose second session is missing does not
    put the third one before it.
    """
    levels = rows.groupby("subject", sort=False)[column].unique()
    most = levels[levels.map(len).sort_values(ascending=False, kind="stable").index]
    return list(dict.fromkeys(str(name) for names in most for name in names))


def subject_means(numbers: pd.DataFrame, factor: str, cell: Sequence[str]) -> pd.Series[float]:
    """Return means over trials, then over sessions, indexed by the columns of `cell`, subject and level."""
    levels = numbers.assign(level=numbers[level_column(factor)])
    levels = levels[levels["level"] != ""]
    by_session = levels.groupby([*cell, "subject", "session", "level"], sort=False)["value"].mean()
    means: pd.Series[float] = by_session.groupby([*cell, "subject", "level"], sort=False).mean()
    return means


WITHIN, BETWEEN = "within", "between"


@dataclass(frozen=True)
class LevelPair:
    """Two levels of a factor that are compared in one hand and task.

    Attributes
    ----------
    factor
        Name of the factor.
    where
        Hand and task, without the one that is the factor itself.
    level, other
        The two levels.
    design
        WITHIN if at least half of the study's subjects with either level have both, else BETWEEN.
    levels_of
        Each subject's levels among the two, including those of recordings that are not used. For the design
        BETWEEN they are from all hands and tasks.
    suspect
        Subjects with recordings that are not used: "suspect" if none is used, else "suspect in part".
    without
        Subjects who were recorded in this hand and task but have no level.

    """

    factor: str
    where: Mapping[str, str]
    level: str
    other: str
    design: str
    levels_of: Mapping[str, frozenset[str]]
    suspect: Mapping[str, str]
    without: Sequence[str]

    @cached_property
    def candidates(self) -> tuple[frozenset[str], frozenset[str]]:
        """Subjects that can represent each level: with both levels (WITHIN), or with only this (BETWEEN)."""
        first, other = frozenset({self.level}), frozenset({self.other})
        wanted = (first | other,) * 2 if self.design == WITHIN else (first, other)
        of = [frozenset(name for name, has in self.levels_of.items() if has == levels) for levels in wanted]
        return of[0], of[1]

    def left_out(self, used: Collection[str]) -> tuple[int, str]:
        """Return how many subjects are not in `used`, and why they or some recordings of others are not."""
        reason_of: dict[str, str] = {}
        for subject in sorted(self.levels_of, key=lambda name: name in used):
            levels, reason = self.levels_of[subject], self.suspect.get(subject, "")
            if subject not in used and reason != SUSPECT:
                if self.design == WITHIN and len(levels) == 1:
                    reason = f"only at {next(iter(levels))}"
                elif self.design == BETWEEN and len(levels) == 2:
                    reason = "at both levels"
                reason = reason or "no value"
            if reason:
                reason_of[subject] = reason
        reason_of |= dict.fromkeys(self.without, f"no level of {self.factor}")
        return sum(name not in used for name in self.levels_of) + len(self.without), _listed(reason_of)


def _listed(reason_of: Mapping[str, str]) -> str:
    """Return the reasons with the subjects to whom each applies; reason_of : by subject."""
    subjects: dict[str, list[str]] = {}
    for subject, reason in reason_of.items():
        subjects.setdefault(reason, []).append(subject)
    return "; ".join(f"{reason}: {list_names(names)}" for reason, names in subjects.items())


def level_pairs(everything: RecordingLevels) -> Iterator[LevelPair]:
    """Yield all pairs of levels of each factor, in each hand and task of the study (unless it is the factor).

    Levels are in the sheet's order, which is the same for all hands and tasks.
    """
    for factor in everything.factors:
        column = level_column(factor)
        study = everything.rows[everything.rows[column] != ""]
        order = in_order(study, column)
        names = [name for name in ("hand", "task") if name != factor]
        for key, in_place in everything.rows.groupby(names, sort=False):
            here = in_place[in_place[column] != ""]
            without = in_place.loc[~in_place["subject"].isin(here["subject"]), "subject"].unique().tolist()
            for levels in combinations([level for level in order if level in {*here[column]}], 2):
                rows = here[here[column].isin(levels)]
                anywhere = _levels_of(study[study[column].isin(levels)], column)
                both = sum(len(levels_there) == 2 for levels_there in anywhere.values())
                design = WITHIN if 2 * both >= len(anywhere) else BETWEEN
                levels_of = _levels_of(rows, column)
                if design == BETWEEN:
                    levels_of = {subject: anywhere[subject] for subject in levels_of}
                share = (rows["left_out"] != "").groupby(rows["subject"], sort=False).mean()
                suspect = {str(name): SUSPECT + " in part" * (of < 1) for name, of in share.items() if of > 0}
                where = {str(name): str(value) for name, value in zip(names, key, strict=True)}
                yield LevelPair(factor, where, *levels, design, levels_of, suspect, without)


def _levels_of(rows: pd.DataFrame, column: str) -> dict[str, frozenset[str]]:
    return {
        str(subject): frozenset(levels) for subject, levels in rows.groupby("subject", sort=False)[column]
    }


SHOWN, NOT_SHOWN = "shown", "not-shown"


def difference_rows(
    quantity: ComparedColumn, numbers: pd.DataFrame, pairs: Sequence[LevelPair]
) -> Iterator[MovementDifferencesRow]:
    """Yield the rows of movement_differences of one quantity for all pairs of levels.

    `judge` adds the last columns. numbers : from `numbers_of`.
    """
    for factor, of_factor in groupby(pairs, key=lambda pair: pair.factor):
        columns = [column for column in ("hand", "task") if column != factor]
        wide = subject_means(numbers, factor, [*columns, "model", "of"]).unstack("level", sort=False)
        families = dict(list(wide.groupby([*columns, "model"], sort=False))) if len(wide) else {}
        for pair in of_factor:
            where: Any = {"hand": "", "task": "", **pair.where, "factor": factor, "quantity": quantity.name}
            where |= {"level": pair.level, "other_level": pair.other, "design": pair.design}
            for key, family in families.items():
                if key[:-1] != tuple(pair.where.values()):
                    continue
                two_levels = family.reindex(columns=[pair.level, pair.other])
                for (of,), subjects, values in _cells(two_levels, ["of"]):
                    row = where | {"model": key[-1], "of": of, "unit": quantity.unit}
                    yield row | _difference_row(subjects, values, pair)


def _cells(
    wide: pd.DataFrame, names: Sequence[str]
) -> Iterator[tuple[tuple[str, ...], list[str], Float[Array, "n k"]]]:
    """Yield the key, subjects and values of each combination of the index levels `names`, in order.

    wide : indexed by the names and the subject, with k columns. Values of n subjects are (n, k), NaN if
    missing.
    """
    cell = wide.groupby(list(names), sort=False).ngroup().to_numpy()
    keys = list(zip(*(wide.index.get_level_values(name) for name in names), strict=True))
    subjects, values = wide.index.get_level_values("subject"), wide.to_numpy(float)
    in_order = np.argsort(cell, kind="stable")
    for rows in np.split(in_order, np.flatnonzero(np.diff(cell[in_order])) + 1) if len(wide) else ():
        yield keys[rows[0]], subjects[rows].tolist(), values[rows]


def judge(rows: Sequence[MovementDifferencesRow]) -> None:
    """Set each row's p_holm, corrected over all rows of a pair of levels and a model, and its verdict."""
    families: dict[tuple[str, ...], list[MovementDifferencesRow]] = {}
    for row in rows:
        key = row["factor"], row["level"], row["other_level"], row["model"]
        families.setdefault(key, []).append(row)
    for family in families.values():
        for row, p_holm in zip(family, paired_statistics.holm([row["p"] for row in family]), strict=True):
            row["p_holm"] = p_holm
            row["verdict"] = "" if p_holm is None else SHOWN if p_holm <= LEVEL else NOT_SHOWN


def _difference_row(
    subjects: Sequence[str], values: Float[Array, "n 2"], pair: LevelPair
) -> MovementDifferencesRow:
    """Return a comparison's columns; values : (n, 2), of the subjects at both levels, NaN if missing."""
    counts = np.array([[name in may for may in pair.candidates] for name in subjects]) & ~np.isnan(values)
    is_within = pair.design == WITHIN
    if is_within:
        counts[:] = counts.all(1, keepdims=True)
    first, other = values[counts[:, 0], 0], values[counts[:, 1], 1]
    n, m = len(first), len(other)
    used = {name for name, counted in zip(subjects, np.asarray(counts.any(1)), strict=True) if counted}
    n_left_out, reason = pair.left_out(used)
    row: MovementDifferencesRow = {"n": n, "n_other": m, "left_out": n_left_out, "left_out_reason": reason}
    if n and m:
        row |= {"mean": float(first.mean()), "other_mean": float(other.mean())}
        sd, other_sd = (float(each.std(ddof=1)) if len(each) > 1 else None for each in (first, other))
        row |= {"sd": sd, "other_sd": other_sd}
        row["difference"] = row["mean"] - row["other_mean"]
    result: paired_statistics.Difference | None = None
    if is_within and n:
        result = paired_statistics.paired_difference(first - other)
    elif not is_within and min(n, m) >= 2:
        result = paired_statistics.group_difference(first, other)
    row |= {"p": None, "test": "", "effect_size_name": ""}
    if result is not None and result.effect is not None and result.effect_interval is not None:
        low, high = result.effect_interval
        row |= {"effect_size": result.effect, "effect_low": low, "effect_high": high}
        row["effect_size_name"] = "d_z" if is_within else "hedges_g"
    row["message"] = why_untested(pair.design, n, m)
    if not row["message"] and result is not None:
        row |= {"p": result.p, "test": "signs flipped" if is_within else "Welch's t, Cochran's p"}
        row["low"], row["high"] = result.interval or (None, None)
    return row


def why_untested(design: str, n: int, m: int) -> str:
    """Return why n and m subjects at two levels are too few for a test, or an empty string.

    The sentence is in the language in use.
    """
    if min(n, m) == 0:
        if design == WITHIN:
            return tr("no subject has a value at both levels")
        return tr("no subject has a value at one of the levels")
    if design == WITHIN and n < FEWEST_SUBJECTS:
        return tr("not tested: {n} with both levels, a test needs {k} subjects", n=n, k=FEWEST_SUBJECTS)
    if design == BETWEEN and min(n, m) < FEWEST_IN_GROUP:
        k = FEWEST_IN_GROUP
        return tr("not tested: groups of {n} and {m} subjects, a test needs {k} in each", n=n, m=m, k=k)
    return ""


CELL = ["hand", "task", "model", "of"]


def reliability_rows(
    quantity: ComparedColumn, numbers: pd.DataFrame, everything: RecordingLevels
) -> Iterator[MovementReliabilityRow]:
    """Yield the rows of movement_reliability of one quantity; numbers : from `numbers_of`."""
    reasons = _reasons(everything)
    keys = ["subject", "hand", "task"]
    first = everything.counted.drop_duplicates(keys)[[*keys, SESSION]]
    first_sessions = numbers.merge(first, on=[*keys, SESSION])
    for across, measured in ((SESSION, numbers), (TRIAL, first_sessions)):
        if measured.empty or measured[across].nunique() < 2:
            continue
        means = measured.groupby([*CELL, "subject", across], sort=False)["value"].mean()
        wide = means.unstack(across, sort=False)
        for key, subjects, values in _cells(wide, CELL):
            where: Any = dict(zip(CELL, key, strict=True)) | {"across": across}
            expected = reasons[where["hand"], where["task"]].items()
            absent = {subject: reason for subject, reason in expected if subject not in subjects}
            row = _reliability_row(subjects, values, list(wide.columns), absent)
            if row:
                contains = everything.contained[across].get((where["hand"], where["task"]), "")
                named = {"quantity": quantity.name, "unit": quantity.unit, "contains": contains}
                yield where | named | row


def _reasons(everything: RecordingLevels) -> dict[tuple[str, str], dict[str, str]]:
    """Return, by hand and task, each recorded subject with the reason to state if they have no value."""
    subjects_of: dict[tuple[str, str], dict[str, str]] = {}
    for row in everything.rows.itertuples():
        subjects = subjects_of.setdefault((row.hand, row.task), {})
        reason = subjects.setdefault(row.subject, row.left_out)
        subjects[row.subject] = reason if reason and row.left_out else ""
    return {
        key: {subject: reason or "no value" for subject, reason in subjects.items()}
        for key, subjects in subjects_of.items()
    }


def _reliability_row(
    subjects: Sequence[str], values: Float[Array, "n k"], levels: Sequence[str], absent: Mapping[str, str]
) -> MovementReliabilityRow:
    """Return the columns of one quantity's repeatability, empty if no subject has two values.

    values : (n, k), of n subjects in k sessions or trials, NaN if missing. absent : reasons why other
    subjects have no value.
    """
    seen = ~np.isnan(values)
    if seen.sum(1).max() < 2:
        return {}
    is_shared = seen.sum(0) * 2 >= len(values)
    shared = [level for level, counts in zip(levels, is_shared, strict=True) if counts]
    in_all = np.asarray(seen[:, is_shared].all(1))
    dropped = [subject for subject, complete in zip(subjects, in_all, strict=True) if not complete]
    reasons = {subject: f"not in all of {list_names(shared)}" for subject in dropped} | dict(absent)
    n, k = int(in_all.sum()), len(shared)
    row: MovementReliabilityRow = {"n": n, "k": k, "left_out": len(reasons), "message": ""}
    row["left_out_reason"] = _listed(reasons)
    if n < FEWEST_REPEATED or k < 2:
        return row | {"message": f"not computed: {n} in all {k}, but {FEWEST_REPEATED} subjects are needed"}
    result = paired_statistics.reliability(values[in_all][:, is_shared])
    intervals = {
        "icc_2_1": (result.agreement.value, result.agreement.interval),
        "icc_3_1": (result.consistency.value, result.consistency.interval),
        "sem": (result.sem, result.sem_interval),
    }
    numbers: Any = {"mdc": result.mdc}
    for name, (value, (low, high)) in intervals.items():
        numbers |= {name: value, f"{name}_low": low, f"{name}_high": high}
    row |= numbers
    return row


TABLES = {quantity.table.name: quantity.table for quantity in QUANTITIES}


def compare_study(
    levels: Sequence[Mapping[str, str]], factors: Sequence[str], results: Results, sheets: Sequence[Path] = ()
) -> None:
    """Read the study's tables of movement and write the tables of comparisons beside them.

    levels : from `factor_levels`. factors : the factors that are compared pair by pair. sheets : their files,
    for the tables' metadata. Raises TableError if a table is damaged.
    """
    problems = observations.study_frame(
        results, catalogue.PROBLEMS, ["subject", "session", "hand", "severity"]
    )
    everything = mark_suspect(levels, factors, problems)
    inputs = [results.study_table(name) for name in (catalogue.PROBLEMS.name, *TABLES)]
    provenance = Provenance.of([*sheets, *inputs], factors=list(factors))
    differences: list[MovementDifferencesRow] = []
    reliabilities: list[MovementReliabilityRow] = []
    pairs = list(level_pairs(everything))
    for quantity, numbers in _numbers(results, everything):
        differences += difference_rows(quantity, numbers, pairs)
        reliabilities += reliability_rows(quantity, numbers, everything)
    judge(differences)
    tables = ((catalogue.MOVEMENT_DIFFERENCES, differences), (catalogue.MOVEMENT_RELIABILITY, reliabilities))
    for table, rows in tables:
        write_table(results.study_table(table.name), table, columns_from_rows(table, rows), provenance)


def _numbers(results: Results, everything: RecordingLevels) -> Iterator[tuple[ComparedColumn, pd.DataFrame]]:
    """Yield each quantity with its values, reading one table after the other."""
    counted = everything.counted
    for name, quantities in groupby(QUANTITIES, key=lambda quantity: quantity.table.name):
        listed = list(quantities)
        columns = dict.fromkeys([*listed[0].of, *(quantity.name for quantity in listed)])
        whole = observations.study_frame(results, TABLES[name], [*RECORDING, "model", *columns])
        for quantity in listed:
            yield quantity, numbers_of(quantity, whole, counted)
