"""Tables of movement: what each recording shows of it, and what the study says of its subjects.

A row of a recording's movement is of a skeleton made of all its recordings. Statistics have the subject as
their unit: values are averaged over trials first, and a hand with a suspect finding is in none.
"""

from __future__ import annotations

from shukotsu.schemas.table_columns import (
    DIGIT,
    HAND,
    JOINT,
    MESSAGE,
    MODEL,
    OF_RECORDING,
    STATUS,
    TASK,
    TEXT,
    WHOLE,
    YES_NO,
    real,
)
from shukotsu.schemas.tables import Column, Table

_OF_MODEL = (*OF_RECORDING, MODEL)
ANGLE = Column("angle", TEXT, "", "flexion, abduction or rotation (docs/joint-angles.md)")
EVENT = Column("event", TEXT, "", "name of the events that begin the cycles")
QUANTITY = Column("quantity", TEXT, "", "what is compared, a column of a table of movement")
OF = Column("of", TEXT, "", "whose: a joint and its angle, a digit, or two digits joined by '-'")
UNIT = Column("unit", TEXT, "", "unit of the values; empty where they have none")
FACTOR = Column("factor", TEXT, "", "what tells the levels apart, a factor of the study file")
LEVEL = Column("level", TEXT, "", "the level that is compared")
OTHER_LEVEL = Column("other_level", TEXT, "", "the level that it is compared with")
LEVELS = (FACTOR, LEVEL, OTHER_LEVEL)
LEFT_OUT = Column("left_out", WHOLE, "", "subjects that were recorded for this and are in no number")
LEFT_OUT_REASON = Column("left_out_reason", TEXT, "", "why they are not, and which recordings are not")
N_FRAMES = Column("n_frames", WHOLE, "", "frames with a value")


def _count(name: str, description: str) -> Column:
    return Column(name, WHOLE, "", description)


def _key(*columns: Column | str) -> tuple[str, ...]:
    return tuple(column if isinstance(column, str) else column.name for column in columns)


def _with_interval(name: str, description: str) -> tuple[Column, Column, Column]:
    """A number with the ends of its interval."""
    low = real(f"{name}_low", f"lower end of the 95 % interval of {name}")
    return real(name, description), low, real(f"{name}_high", "upper end")


EVENTS = Table(
    "events",
    2,
    "an event of a recording",
    (
        *OF_RECORDING,
        _count("event", "number of the event in the recording, from 0"),
        Column("name", TEXT, "", "what happened"),
        real("onset_s", "when it began, on the clock of the recording's time_s"),
        real("duration_s", "how long it lasted; null where nothing says so"),
        real("value", "what came with it, e.g. a key's velocity"),
        Column("channel", WHOLE, "", "MIDI channel, 1 to 16; null of other sources", nullable=True),
        Column("source", TEXT, "", "sheet, xdf, midi or tracker"),
        real(
            "onset_sd_ms",
            "1-sigma error of onset_s: of the two clocks' line, and of a single time on the device's clock",
        ),
    ),
    _key(*OF_RECORDING, "event"),
)

CLOCKS = Table(
    "clocks",
    2,
    "how another device's clock was brought to the recording's",
    (
        *OF_RECORDING,
        Column("source", TEXT, "", "xdf, midi or tracker; empty where the file was not read"),
        real("scale_ppm", "how much faster the recording's clock runs than the device's"),
        real("offset_s", "the recording's time at the device's zero"),
        real("residual_ms", "standard deviation of the pulses about the line; null where there are none"),
        real("clock_sd_ms", "largest 1-sigma error of the line between the first and last pulse"),
        _count("n_pulses", "pulses that both have"),
        _count("n_missing", "pulses that only the recording has, while both ran"),
        _count("n_extra", "pulses that only the device has, while both ran"),
        STATUS,
        MESSAGE,
    ),
    _key(*OF_RECORDING, "source"),
)

RANGES_OF_MOTION = Table(
    "ranges_of_motion",
    2,
    "how far and how fast an angle of a joint moved in a recording",
    (
        *_OF_MODEL,
        JOINT,
        ANGLE,
        real("range_deg", "from low_deg to high_deg"),
        real("low_deg", "2.5th percentile of the angle"),
        real("high_deg", "97.5th percentile"),
        real("full_range_deg", "from the least to the largest angle"),
        real("median_deg", "median of the angle: the posture"),
        real("range_sd_deg", "1-sigma error of range_deg: what skin and skeleton leave uncertain"),
        real("median_sd_deg", "the same of median_deg"),
        real("range_session_sd_deg", "of range_sd_deg, what differs when the receivers are put on anew"),
        real("median_session_sd_deg", "the same of median_sd_deg"),
        real("speed_median_deg_s", "median of the angle's speed"),
        real("speed_p95_deg_s", "95th percentile of the angle's speed"),
        N_FRAMES,
        real("valid_percent", "frames with an angle, of those of the recording"),
        STATUS,
        MESSAGE,
    ),
    _key(*_OF_MODEL, JOINT, ANGLE),
)

FINGERTIP_PATHS = Table(
    "fingertip_paths",
    3,
    "the way of a fingertip in the frame of the hand in a recording",
    (
        *_OF_MODEL,
        DIGIT,
        real("path_length_mm", "length of the filtered path in the hand's frame, gaps left out"),
        real("duration_s", "time that the path has, gaps left out"),
        real("speed_median_mm_s", "median of the tip's speed"),
        real("speed_p95_mm_s", "95th percentile of the tip's speed"),
        real("path_sd_mm", "1-sigma error of path_length_mm"),
        N_FRAMES,
        real("valid_percent", "frames with a tip, of those of the recording"),
        STATUS,
        MESSAGE,
    ),
    _key(*_OF_MODEL, DIGIT),
)

MOVEMENT_CYCLES = Table(
    "movement_cycles",
    1,
    "a cycle of a recording, from an event to the next of its name or to its own end",
    (
        *OF_RECORDING,
        EVENT,
        _count("cycle", "number of the cycle among those of its event, from 0"),
        real("onset_s", "when it began, on the clock of the recording's time_s"),
        real("duration_s", "how long it lasted"),
        Column("used", YES_NO, "", "whether it is a whole cycle whose ends are known"),
        MESSAGE,
    ),
    _key(*OF_RECORDING, EVENT, "cycle"),
)

EVENT_STROKES = Table(
    "event_strokes",
    3,
    "an event that a fingertip made, e.g. a keystroke, from the posed hand (docs/keystrokes.md)",
    (
        *_OF_MODEL,
        _count("event", "number of the event in the recording, as in the events table"),
        Column("name", TEXT, "", "what happened, as in the events table"),
        Column("digit", TEXT, "", "the digit that struck; empty where that is not known"),
        real("onset_s", "when the event began, on the clock of the recording's time_s"),
        real("onset_sd_ms", "1-sigma error of onset_s"),
        real("key_down_s", "when the fingertip stopped going down"),
        real("key_down_sd_ms", "1-sigma error of key_down_s"),
        real("contact_speed_mm_s", "speed of the fingertip just before key_down_s, in the transmitter frame"),
        real("contact_speed_sd_mm_s", "1-sigma error of contact_speed_mm_s"),
        real("peak_speed_before_mm_s", "largest speed on the way down, in the transmitter frame"),
        real("peak_speed_sd_mm_s", "1-sigma error of the peak speed"),
        Column("used", YES_NO, "", "whether digit and contact are sure"),
        STATUS,
        MESSAGE,
    ),
    _key(*_OF_MODEL, "event"),
)

MOVEMENT_DIFFERENCES = Table(
    "movement_differences",
    3,
    "how two levels of a factor differ in a quantity, subjects as the unit",
    (
        *LEVELS,
        HAND,
        TASK,
        MODEL,
        QUANTITY,
        OF,
        Column("design", TEXT, "", "within (the same subjects) or between (groups)"),
        _count("n", "subjects with a value at the level; within: at both"),
        _count("n_other", "subjects with a value at the other level; within: at both"),
        LEFT_OUT,
        LEFT_OUT_REASON,
        real("mean", "mean over the subjects at the level"),
        real("other_mean", "mean at the other level"),
        real("difference", "mean minus other_mean"),
        real("low", "lower end of the difference's 95 % interval"),
        real("high", "upper end"),
        real("effect_size", "standardised difference"),
        real("effect_low", "lower end of its 95 % interval"),
        real("effect_high", "upper end"),
        Column("effect_size_name", TEXT, "", "d_z (within) or hedges_g (between); empty without one"),
        real("p", "two-sided p-value of the test, of this number alone"),
        real(
            "p_holm",
            "the same after Holm's correction over all that is said of these levels under this model: every "
            "quantity, `of`, hand and task",
        ),
        Column("verdict", TEXT, "", "shown (p_holm at most 0.05) or not-shown; empty: too few subjects"),
        Column("test", TEXT, "", "signs flipped, or Welch's t, Cochran's p; empty: none"),
        UNIT,
        MESSAGE,
    ),
    _key(*LEVELS, HAND, TASK, MODEL, QUANTITY, OF),
)

MOVEMENT_RELIABILITY = Table(
    "movement_reliability",
    3,
    "how well a quantity repeats across sessions or trials",
    (
        Column("across", TEXT, "", "session or trial"),
        HAND,
        TASK,
        MODEL,
        QUANTITY,
        OF,
        _count("n", "subjects with a value in each of the k"),
        _count("k", "sessions or trials that at least half of the subjects have"),
        Column(
            "contains",
            TEXT,
            "",
            "factors whose levels change from one to the next, joined by ';': their effect is in all that "
            "follows, which is then no measurement error",
        ),
        LEFT_OUT,
        LEFT_OUT_REASON,
        *_with_interval("icc_2_1", "ICC(2,1), absolute agreement"),
        *_with_interval("icc_3_1", "ICC(3,1), consistency"),
        *_with_interval("sem", "standard error of measurement: standard deviation within subjects"),
        real("mdc", "minimal detectable change at 95 %: 1.96 sqrt(2) sem"),
        UNIT,
        MESSAGE,
    ),
    _key("across", HAND, TASK, MODEL, QUANTITY, OF),
)

MOVEMENT_TABLES = (
    EVENTS,
    CLOCKS,
    RANGES_OF_MOTION,
    FINGERTIP_PATHS,
    MOVEMENT_CYCLES,
    EVENT_STROKES,
    MOVEMENT_DIFFERENCES,
    MOVEMENT_RELIABILITY,
)
