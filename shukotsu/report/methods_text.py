"""Methods section for a manuscript, in English: what was recorded, computed, compared and tested.

It is derived from the study's files and states no results.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from statistics import median

from shukotsu.errors import InputError, count_of
from shukotsu.report.movement_results import StudyMovement
from shukotsu.report.study_results import StudyResults
from shukotsu.resources import VERSION
from shukotsu.scores.paired_statistics import FEWEST_SUBJECTS
from shukotsu.study.mapping import read_mapping

REFERENCES = (
    "M. Saito, K. Mitobe, M. Suzuki, N. Yoshimura: Modeling of Hand Skeletal Structure from Magnetic Motion "
    "Capture Data. Akita University.",
    "J. F. O'Brien, R. E. Bodenheimer, G. J. Brostow, J. K. Hodgins: Automatic Joint Parameter Estimation "
    "from Magnetic Motion Capture Data. Graphics Interface 2000, 53–60.",
    "R. M. Ehrig, W. R. Taylor, G. N. Duda, M. O. Heller: A survey of formal methods for determining the "
    "centre of rotation of ball joints. Journal of Biomechanics 39 (2006) 2798–2809.",
    "G. Wu et al.: ISB recommendation on definitions of joint coordinate systems of various joints for the "
    "reporting of human joint motion, part II. Journal of Biomechanics 38 (2005) 981–992.",
    "R. A. Fisher: The Design of Experiments. Oliver and Boyd, 1935.",
    "S. Holm: A Simple Sequentially Rejective Multiple Test Procedure. Scandinavian Journal of Statistics 6 "
    "(1979) 65–70.",
    "L. V. Hedges: Distribution Theory for Glass's Estimator of Effect Size and Related Estimators. Journal "
    "of Educational Statistics 6 (1981) 107–128.",
)


def methods_text(results: StudyResults, movement: StudyMovement) -> list[str]:
    """Return the paragraphs, in the past tense, including one on movement if any was measured."""
    return [
        _describe_recordings(results),
        _describe_models(results),
        _describe_comparison(results),
        *([_describe_movement(movement)] if len(movement.ranges) else []),
        f"All computations were made with Shukotsu {VERSION}; the configuration, software versions and the "
        "SHA-256 of every input file are recorded in the study's tables.",
    ]


def _describe_recordings(results: StudyResults) -> str:
    used = [row for row in results.rows.recordings if row["status"] == "used"]
    rates = [
        (row["n_frames"] - 1) / row["duration_s"] for row in used if row["duration_s"] and row["n_frames"] > 1
    ]
    worn = sorted({row["n_receivers"] for row in used})
    tasks = sorted(Counter(row["task"] for row in used).items())
    text = (
        f"{count_of(len(results.hands), 'hand')} of {count_of(len(results.subjects), 'subject')}, "
        + ("each counted once per session, " if results.has_sessions else "")
        + ("simulated" if results.simulated else "recorded")
        + f" with {'–'.join(map(str, worn[:1] + worn[1:][-1:])) or 'no'} receivers per hand"
        + (f" at {median(rates):.0f} Hz" if rates else "")
        + f", gave {count_of(len(used), 'recording')}"
        + (f" ({', '.join(f'{task}: {n}' for task, n in tasks)})" if tasks else "")
    )
    if lost := len(results.recordings) - len(used):
        text += f"; {lost} more could not be used"
    if results.suspect:
        hands = ", ".join(sorted(f"subject {each.who.label}, {each.hand} hand" for each in results.suspect))
        text += f". Left out of all statistics because of findings in their recordings: {hands}"
    if results.simulated:
        return f"{text}. The true skeletons are known from the simulation; no person was measured."
    trackers = ", ".join(sorted({row["tracker"] for row in used if row.get("tracker")}))
    text += f". Tracker: {trackers or '[name it here]'}."
    mappings = Counter(each.source.mapping for each in results.recordings if not each.exclude)
    return text + "".join(
        f" {count_of(n, 'recording')} of another program, read as declared in {path.name}"
        f"{_describe_mapping(path)}."
        for path, n in sorted((path, n) for path, n in mappings.items() if path)
    )


def _describe_mapping(path: Path) -> str:
    """Return the units and conventions of a mapping, or an empty string if it cannot be read."""
    try:
        mapping = read_mapping(path)
    except InputError:
        return ""
    keys = ("kind", "order", "axes", "unit", "rotates")
    turning = " ".join(filter(None, ((mapping.orientation or {}).get(key) for key in keys)))
    return f": positions in {mapping.config['position_unit']}" + (f", {turning}" if turning else "")


def _describe_models(results: StudyResults) -> str:
    """Describe the models; their descriptions are shortened if no layout has a thumb."""
    thumb = any("thumb" in layout.digits for layout in results.layouts.values())
    text = (
        "Joint centres were estimated from the relative motion of the receivers on both sides of each joint "
        f"[1–3] with {count_of(len(results.models), 'skeleton model')}."
    )
    for name, model in results.models.items():
        described = "each joint estimated from the receivers on both sides of it"
        text += f" {name}: {model.description.rstrip('.') if thumb or not model.own_cmc else described}."
    if results.fitted:
        text += (
            f" {', '.join(results.fitted)}: all joint centres, axes, bone lengths and receiver positions "
            "were estimated together (maximum a posteriori, with anatomical priors), and their uncertainty "
            "by a Gaussian approximation. Joint angles follow the ISB recommendation [4]."
        )
    return text


def _describe_comparison(results: StudyResults) -> str:
    fresh = any(row["held_out"] and not row["reference"] for row in results.rows.skeleton_scores)
    seen = "of tasks that were not used to make them" if fresh else "used to make them; nothing was held out"
    return (
        f"Skeletons were scored on recordings {seen}. The subject was the unit of analysis: each contributed "
        "one difference between two models, the mean over its hands, recordings and digits. Differences were "
        "tested by sign-flip permutation [5]; 95 % confidence intervals are based on Student's t (for "
        f"{FEWEST_SUBJECTS} or more subjects); p values were corrected by Holm's procedure [6]; effect sizes "
        "are Cohen's d_z with Hedges' correction [7]."
    )


def _describe_movement(movement: StudyMovement) -> str:
    """Describe how movement was measured and compared: filters, statistics and number of subjects."""
    subjects = count_of(movement.ranges["subject"].nunique(), "subject")
    text = (
        f"Movement was measured in {subjects} by joint angles under the model {movement.model}. The range of "
        "motion is the difference between the 97.5th and the 2.5th percentile of an angle. Speeds are slopes "
        "of a parabola fitted in a moving window (Savitzky-Golay filter, half power at 10 Hz)."
    )
    if len(movement.differences):
        tests = ", ".join(sorted(filter(None, movement.differences["test"].unique())))
        text += (
            " Values were averaged over trials, then over sessions; the subject was the unit of analysis. "
            f"Two-sided tests: {tests or 'none, too few subjects'}. Differences were called significant if p "
            "was at most 0.05 after Holm's correction over all quantities, joint angles, hands and tasks of "
            "a pair of levels; 95 % confidence intervals; effect sizes are d_z within subjects and Hedges' g "
            "between groups, both corrected for small samples."
        )
    if len(movement.reliability):
        text += (
            " Repeatability: ICC(2,1) and ICC(3,1) with F-based confidence intervals, standard error of "
            "measurement within subjects, and minimal detectable change, 1.96 √2 times that error."
        )
    return text
