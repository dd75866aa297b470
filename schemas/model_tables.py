"""Tables of how skeleton models compare over a study's subjects.

The unit is the subject: hands, tasks, trials and digits of one person are not independent. A place is a digit
in a recording, or a joint of a hand; a number of a subject is the mean over places. Hands with a suspect
finding are in none.
"""

from __future__ import annotations

from shukotsu.schemas.table_columns import SUBJECT, TEXT, WHOLE, YES_NO, real
from shukotsu.schemas.tables import Column, Table

_METRIC = Column("metric", TEXT, "", "what is compared, a column of `table`; the smaller, the better")
_TABLE = Column("table", TEXT, "", "the table that has it: skeleton_scores or joint_errors")
_UNIT = Column("unit", TEXT, "", "unit of the values")
_DIGIT = Column("digit", TEXT, "", "the digit, as the layout names it; empty: all digits together")
_HELD_OUT = Column(
    "held_out", YES_NO, "", "whether skeletons were made without the tasks that they are scored on"
)
_MODEL = Column("model", TEXT, "", "the skeleton model")
_OTHER = Column("other", TEXT, "", "the model, or reference, that it is compared with")

MODEL_VALUES = Table(
    "model_values",
    1,
    "a subject's number under a skeleton model",
    (
        _METRIC,
        _DIGIT,
        SUBJECT,
        Column("model", TEXT, "", "the skeleton model, or a reference as in skeleton_scores"),
        Column("reference", YES_NO, "", "whether this is a reference and no model of the study"),
        _HELD_OUT,
        _UNIT,
        real("value", "mean over the places that have a number"),
        Column("n_places", WHOLE, "", "places that have a number"),
        Column(
            "missing",
            TEXT,
            "",
            "JSON: for each reason why a place has no number, how many such places; empty: all have",
        ),
    ),
    ("metric", "digit", "subject", "model"),
)

MODEL_PAIRS = Table(
    "model_pairs",
    1,
    "a subject's numbers under two skeleton models, over the places in which both have one",
    (
        _METRIC,
        _DIGIT,
        SUBJECT,
        _MODEL,
        _OTHER,
        _UNIT,
        real("value", "mean of the model over the shared places"),
        real("other_value", "mean of the other over the shared places"),
        real("difference", "value minus other_value"),
        Column("n_places", WHOLE, "", "the shared places"),
    ),
    ("metric", "digit", "subject", "model", "other"),
)

MODEL_DIFFERENCES = Table(
    "model_differences",
    2,
    "how two skeleton models differ, subjects as the unit",
    (
        _METRIC,
        _TABLE,
        _UNIT,
        _HELD_OUT,
        _DIGIT,
        _MODEL,
        _OTHER,
        Column("baseline", YES_NO, "", "whether the report compares the models with this other one"),
        Column("n_subjects", WHOLE, "", "subjects of the study"),
        Column("n_compared_subjects", WHOLE, "", "subjects with a number under both"),
        real("mean", "mean of the model over those subjects"),
        real("other_mean", "mean of the other"),
        real("mean_difference", "mean of model minus other"),
        real("median_difference", "median"),
        real("interval_95_low", "lower end of the mean difference's 95 % interval; null under 6 subjects"),
        real("interval_95_high", "upper end"),
        real("p", "two-sided p-value of the sign-flip test"),
        real("p_holm", "the same after Holm's correction, with one other over all models (and digits)"),
        real("smallest_p", "what p can be at best with so many subjects"),
        real("smallest_p_holm", "what p_holm can be at best"),
        Column("n_comparisons", WHOLE, "", "comparisons that p_holm is corrected for"),
        real("effect_size", "Cohen's d_z with Hedges' correction"),
        Column("n_better", WHOLE, "", "subjects with whom the model does better", nullable=True),
        Column("n_equal", WHOLE, "", "subjects with whom they do the same", nullable=True),
    ),
    ("metric", "digit", "model", "other"),
)

MODEL_TABLES = (MODEL_VALUES, MODEL_PAIRS, MODEL_DIFFERENCES)
