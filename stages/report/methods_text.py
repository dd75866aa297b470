"""Methods text that can be pasted into a manuscript: what was recorded, computed, compared and tested.

It says what the study's own files say, and nothing of what came out.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from statistics import median

from shukotsu.errors import InputError
from shukotsu.schemas import VERSION
from shukotsu.schemas.mapping import read_mapping
from shukotsu.schemas.model import SkeletonModel
from shukotsu.sentences.translation import listed, ngettext, tr, translated
from shukotsu.stages.report.movement_results import Movement
from shukotsu.stages.report.study_results import Row, StudyResults
from shukotsu.stages.report.table_cells import number
from shukotsu.statistics.paired_statistics import FEWEST_SUBJECTS

REFERENCES = (
    (
        "M. Saito, K. Mitobe, M. Suzuki, N. Yoshimura: Modeling of Hand Skeletal Structure from "
        "Magnetic Motion Capture Data. Akita University."
    ),
    (
        "J. F. O'Brien, R. E. Bodenheimer, G. J. Brostow, J. K. Hodgins: Automatic Joint "
        "Parameter Estimation from Magnetic Motion Capture Data. Graphics Interface 2000, 53–60."
    ),
    (
        "R. M. Ehrig, W. R. Taylor, G. N. Duda, M. O. Heller: A survey of formal methods for "
        "determining the centre of rotation of ball joints. Journal of Biomechanics 39 (2006) "
        "2798–2809."
    ),
    (
        "G. Wu et al.: ISB recommendation on definitions of joint coordinate systems of various "
        "joints for the reporting of human joint motion, part II. Journal of Biomechanics 38 "
        "(2005) 981–992."
    ),
    "R. A. Fisher: The Design of Experiments. Oliver and Boyd, 1935.",
    (
        "S. Holm: A Simple Sequentially Rejective Multiple Test Procedure. Scandinavian Journal "
        "of Statistics 6 (1979) 65–70."
    ),
    (
        "L. V. Hedges: Distribution Theory for Glass's Estimator of Effect Size and Related "
        "Estimators. Journal of Educational Statistics 6 (1981) 107–128."
    ),
)


def methods_text(results: StudyResults, movement: Movement | None = None) -> list[str]:
    """The paragraphs, in the past tense, as a manuscript has them; on movement where any was measured."""
    moved = [movement_paragraph(movement)] if movement is not None and len(movement.ranges) else []
    return [_recorded(results), _solved(results), _judged(results), *moved, _software()]


def _recorded(results: StudyResults) -> str:
    used = [row for row in results.recording_rows if row["status"] == "used"]
    made = tr("simulated") if results.simulated else tr("recorded")
    receivers = sorted({row["n_receivers"] for row in used})
    worn = "–".join(str(count) for count in (receivers[:1] + receivers[1:][-1:])) or tr("no")
    tasks = Counter(row["task"] for row in used)
    text = ngettext(
        "{n} hand of {subjects} {part}was {made} with {worn} receivers a hand{rate}, in {recordings}",
        "{n} hands of {subjects} {part}were {made} with {worn} receivers a hand{rate}, in {recordings}",
        len(results.hands),
        subjects=ngettext("{n} subject", "{n} subjects", len(results.subjects)),
        part=tr("(counted in each session) ") if results.has_sessions else "",
        made=made,
        worn=worn,
        rate=_rate(used),
        recordings=ngettext("{n} recording", "{n} recordings", len(used)),
    )
    if tasks:
        text += " (" + listed(f"{task}: {count}" for task, count in sorted(tasks.items())) + ")"
    lost = len(results.recordings) - len(used)
    text += (
        "."
        if not lost
        else ngettext(
            "; {n} further recording could not be used.", "; {n} further recordings could not be used.", lost
        )
    )
    text += _left_out(results) + ("" if results.simulated else _tracker(used)) + _mappings(results)
    if results.simulated:
        text += tr(" The simulator knows the true skeleton; no person's hand is behind these numbers.")
    return text


def _left_out(results: StudyResults) -> str:
    """Return which hands are in no statistic, and why; empty where all are."""
    hands = sorted(tr("{hand}", hand=hand) for hand in results.suspect)
    if not hands:
        return ""
    return tr(
        " Left out of every statistic, for what was found in their recordings: {hands}.", hands=listed(hands)
    )


def _tracker(used: list[Row]) -> str:
    """Name the trackers that recorded them, as far as their files say."""
    known = listed(sorted({row["tracker"] for row in used if row.get("tracker")}))
    unknown = any(not row.get("tracker") for row in used)
    text = tr(" The tracker was: {tracker}.", tracker=known) if known else ""
    if unknown and known:
        return text + tr(" Other recordings do not name theirs.")
    return tr(" The recordings do not name the tracker: name it here.") if unknown else text


def _mappings(results: StudyResults) -> str:
    """Describe what mappings declare of files of other programs."""
    counts = Counter(own.mapping for own in results.recordings if own.mapping and not own.exclude)
    return "".join(
        ngettext(
            " {n} recording of another program was read as {mapping} declares{what}.",
            " {n} recordings of another program were read as {mapping} declares{what}.",
            count,
            mapping=path.name,
            what=_declared(path),
        )
        for path, count in sorted(counts.items())
    )


def _declared(path: Path) -> str:
    """Units and convention of a mapping; empty where it cannot be read."""
    try:
        mapping = read_mapping(path)
    except InputError:
        return ""
    orientation = mapping.orientation or {}
    words = (orientation.get(key) for key in ("kind", "order", "axes", "unit", "rotates"))
    turning = " ".join(filter(None, words))
    unit = mapping.config["position_unit"]
    return tr(": positions in {unit}", unit=unit) + (f", {turning}" if turning else "")


def _described(results: StudyResults, name: str, model: SkeletonModel) -> str:
    """A model in a sentence; where no layout has a thumb, nothing is said of one."""
    digits = {digit for layout in results.layouts.values() for digit in layout.digits}
    if "thumb" not in digits and model.own_cmc:
        return tr("{model}: each joint by the receivers on both sides of it.", model=name)
    return f"{name}: {translated(model.description.rstrip('.'))}."


def _solved(results: StudyResults) -> str:
    described = (_described(results, name, model) for name, model in results.models.items())
    text = (
        ngettext(
            "Joint centres were found from the relative motion of the receivers beside each joint "
            "[1–3]. {n} skeleton model was compared. ",
            "Joint centres were found from the relative motion of the receivers beside each joint "
            "[1–3]. {n} skeleton models were compared. ",
            len(results.models),
        )
    ) + " ".join(described)
    if results.fitted:
        text += tr(
            " {fitted}: all joint centres, axes, bone lengths and the receivers' places were "
            "estimated at once (maximum a posteriori, with anatomical priors), their uncertainty by "
            "a Gaussian approximation. Joint angles follow ISB [4].",
            fitted=listed(results.fitted),
        )
    return text


def _judged(results: StudyResults) -> str:
    fresh = any(row["held_out"] and not row["reference"] for row in results.scores)
    seen = (
        tr("Skeletons were scored on recordings of tasks that they were not made from.")
        if fresh
        else tr("Skeletons were scored on the recordings that they were made from; nothing was held out.")
    )
    return tr(
        "{seen} The subject was the unit of comparison: each gave one difference between two "
        "models, the mean over its hands, recordings and digits. Differences were tested by "
        "flipping their signs [5]; 95 % intervals are Student's (from {FEWEST_SUBJECTS} subjects on); Holm's "
        "procedure corrected p [6]; effect sizes are Cohen's d_z with Hedges' correction [7].",
        seen=seen,
        FEWEST_SUBJECTS=FEWEST_SUBJECTS,
    )


def movement_paragraph(movement: Movement) -> str:
    """Describe how movement was measured and compared: filters, statistics, n."""
    if movement.ranges.empty:
        return tr("No movement was compared: {why}.", why=movement.why_nothing)
    subjects = movement.ranges["subject"].nunique()
    text = tr(
        "Movement was measured in {subjects} by joint angles under {model}. The range of motion "
        "is the distance from the 2.5th to the 97.5th percentile of an angle. Speeds are slopes "
        "of a parabola fitted in a moving window that passes 10 Hz at half power "
        "(Savitzky-Golay).",
        subjects=ngettext("{n} subject", "{n} subjects", subjects),
        model=movement.model,
    )
    if len(movement.differences):
        tests = sorted(translated(test) for test in movement.differences["test"].unique() if test)
        text += tr(
            " Values were averaged over trials, then over sessions; the subject was the unit. Tests: "
            "{tests}; two-sided. A difference counts as shown where p is at most 5 % after "
            "Holm's correction over all quantities, joint angles, hands and tasks of two levels; "
            "95 % intervals; effect sizes are d_z within subjects and Hedges' g between groups, both "
            "corrected for few subjects.",
            tests=listed(tests) or tr("none, for want of subjects"),
        )
    if len(movement.reliability):
        text += tr(
            " Repeatability: ICC(2,1) and ICC(3,1) with F-based intervals, standard error of "
            "measurement within subjects, minimal detectable change 1.96 √2 times that."
        )
    return text


def _software() -> str:
    return tr(
        "All computations were made with Shukotsu {VERSION}; configuration, versions and the "
        "SHA-256 of every input file stand in the study's tables.",
        VERSION=VERSION,
    )


def _rate(used: list[Row]) -> str:
    """The median frame rate; empty where no recording has device times."""
    rates = [
        (row["n_frames"] - 1) / row["duration_s"] for row in used if row["duration_s"] and row["n_frames"] > 1
    ]
    return tr(" at {rates} Hz", rates=number(median(rates), 0)) if rates else ""
