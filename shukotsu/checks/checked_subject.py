"""Check all recordings of a subject, each one alone and against each other.

Only a comparison shows that a file is listed twice, or that a recording is of another person.
"""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from shukotsu import command_line
from shukotsu.arrays import Array
from shukotsu.checks.checked_recording import LEFT_OUT, CheckedRecording, check_recording
from shukotsu.checks.hypotheses import Declared
from shukotsu.hand.average_hand import DIGITS
from shukotsu.study.findings import NOTE, SUSPECT, Finding, same_file, unchecked_finding
from shukotsu.study.layout import Layout
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.study import Recording
from shukotsu.tables.catalogue import POSES
from shukotsu.tables.poses import read_poses, recording_name, usable_poses
from shukotsu.tables.typed_table import read_metadata, read_row_groups


def checked_poses(path: Path, layout: Layout, hand: str | None = None) -> CheckedRecording:
    """Check what was declared about the recording in a poses file; hand : instead of the file's."""
    parameters = read_metadata(path)["parameters"]
    declared = Declared.of(parameters.get("mapping"), parameters.get("orientation", ""))
    side = hand or recording_name(path).hand
    poses, broken = read_poses(path, layout.measured), parameters.get("breaks", ())
    checked = check_recording(poses, layout, side, declared, _left_out(path), broken)
    loose = _loose_clusters(parameters.get("clusters", ()))
    missing = [
        Finding("receivers-absent", NOTE, variant, {"segments": parameters[name]})
        for variant, name in (("", "absent"), ("unmapped", "unmapped"))
        if parameters.get(name)
    ]
    return replace(checked, findings=(*loose, *checked.findings, *missing))


LOOSE_PERCENT = 1.0
"""Percentage of misfitting frames from which a cluster is not rigid; a smaller one is due to label slips."""


def _loose_clusters(clusters: Sequence[Mapping[str, Any]]) -> list[Finding]:
    """Return a finding for each cluster that is not rigid, and one note on label slips in the others."""
    loose = [each for each in clusters if not each["whole"] and each["percent"] >= LOOSE_PERCENT]
    findings = [
        Finding("cluster-not-rigid", SUSPECT, "" if each["groups"] else "apart", each)
        for each in ({**each, "groups": " or ".join(each["groups"])} for each in loose)
    ]
    slips = {each["segment"]: each["count"] for each in clusters if each not in loose}
    if slips:
        seen = {"count": sum(slips.values()), "of": [*slips], "counts": [*slips.values()]}
        findings.append(Finding("cluster-not-rigid", NOTE, "some", seen))
    return findings


def _left_out(path: Path) -> dict[str, Counter[str]]:
    """Return the number of poses with each flag of LEFT_OUT that occurs, by segment."""
    flagged: dict[str, Counter[str]] = {flag: Counter() for flag in LEFT_OUT}
    for rows in read_row_groups(path, POSES, ["segment", "flags"]):
        for flag, counts in flagged.items():
            counts.update(rows.filter(pc.match_substring(rows["flags"], flag))["segment"].to_pylist())
    return {flag: counts for flag, counts in flagged.items() if counts}


def check_subject(plan: SubjectPlan, arguments: Namespace) -> list[tuple[Recording, CheckedRecording]]:
    """Check a subject's recordings, each one alone and against each other.

    A recording that cannot be checked gets a note instead.

    arguments : command-line arguments `stage` and `record_failure`.
    """
    recordings = [r for r in plan.recordings if not r.exclude and usable_poses([plan.poses(r)])[0]]
    checked = [_check_recording(plan, recording, arguments) for recording in recordings]
    named = [
        (" ".join(filter(None, (recording.task, recording.trial))), recording.hand.hand, checks)
        for recording, checks in zip(recordings, checked, strict=True)
    ]
    with command_line.keep_failure(arguments, arguments.record_failure) as messages:
        checked = compare_recordings(named)
    if messages:
        note = unchecked_finding(messages[0])
        checked = [replace(checks, findings=(*checks.findings, note)) for checks in checked]
    return list(zip(recordings, checked, strict=True))


def _check_recording(plan: SubjectPlan, recording: Recording, arguments: Namespace) -> CheckedRecording:
    with command_line.keep_failure(arguments, arguments.record_failure) as messages:
        return checked_poses(plan.poses(recording), plan.layouts[recording.hand.hand])
    return CheckedRecording((unchecked_finding(messages[0]),), "", None, None)


FINGERS = tuple(name for name in DIGITS if name != "thumb")
_PHALANX_MM, _KNUCKLE_MM = [(2.0, 5.2), (1.9, 3.5)], [(1.9, 3.5), (1.3, 2.9), (1.4, 2.7)]
_SCALE = (0.025, 0.105)
SAME_SD, OTHERS_SD = np.array([*np.repeat(_PHALANX_MM + _KNUCKLE_MM, len(FINGERS), axis=0), _SCALE]).T
"""SD of a difference between recordings of one person and of two people: proximal and middle phalanges;
knuckles about their mean, distally, sideways and dorsally; the hand's scale. From our simulated hands."""
WORN_AGAIN_MM = 0.68
"""Median difference of joint coordinates in the receivers' frames above which receivers were put on again."""
OTHER_PERSON = 2.0
"""Log odds above which lengths are those of another person."""


@dataclass(frozen=True)
class MeasuredHand:
    """Sizes of a hand in one recording.

    sizes : (N,) lengths and scale, which differ between people. centre_mm : (J, 2, 3) joint centres in both
    receivers' frames. scale : of the hand, 1 is average.
    """

    sizes: Array
    centre_mm: Array
    joints: tuple[str, ...]
    scale: float


def compare_recordings(recordings: Sequence[tuple[str, str, CheckedRecording]]) -> list[CheckedRecording]:
    """Compare a subject's recordings and add the findings of the comparison.

    If a file is listed twice, the entry with more severe findings counts as the copy: for example a right
    hand's file that is listed as the left hand's.

    recordings : (task, hand, checked recording) in the order of the sheet.
    """
    first_of: dict[str, tuple[str, str]] = {}
    for task, hand, checked in sorted(
        recordings, key=lambda entry: any(f.severity != NOTE for f in entry[2].findings)
    ):
        first_of.setdefault(checked.digest, (hand, task))
    compared, others = [], _other_people(recordings)
    for index, (task, hand, checked) in enumerate(recordings):
        first = first_of[checked.digest] if checked.digest else (hand, task)
        copied = [same_file(*first)] if first != (hand, task) else []
        differs = [others[index]] if index in others and not copied else []
        compared.append(replace(checked, findings=(*copied, *checked.findings, *differs)))
    return compared


def copies(recordings: Iterable[tuple[Recording, str]]) -> Iterator[tuple[Recording, Finding]]:
    """Yield recordings that have the same digest as one of another subject or session."""
    first_of: dict[str, Recording] = {}
    for recording, digest in recordings:
        first = first_of.setdefault(digest, recording) if digest else recording
        if first.hand.who != recording.hand.who:
            yield recording, same_file(first.hand.hand, first.title, *first.hand.who).accept(recording.accept)


def _other_people(recordings: Sequence[tuple[str, str, CheckedRecording]]) -> dict[int, Finding]:
    """Return a finding, by index, for each recording whose receivers are placed differently from the rest."""
    findings: dict[int, Finding] = {}
    all_sizes = [measure(checked) for _, _, checked in recordings]
    changed = [any(each.kind == "sudden-change" for each in checked.findings) for _, _, checked in recordings]
    for hand in dict.fromkeys(hand for _, hand, _ in recordings):
        of_hand = [index for index, (_, side, _) in enumerate(recordings) if side == hand]
        measured = {index: sizes for index in of_hand if (sizes := all_sizes[index]) is not None}
        judging = {index: sizes for index, sizes in measured.items() if not changed[index]}
        if not judging:
            continue
        usual = min(  # the first one of those that differ from fewest others
            judging,
            key=lambda index: sum(_worn_elsewhere(judging[index], other) for other in judging.values()),
        )
        for index, sizes in measured.items():
            if _worn_elsewhere(sizes, measured[usual]):
                first = {"subject": "", "session": "", "hand": hand, "task": recordings[usual][0]}
                difference = sizes.sizes - measured[usual].sizes
                odds = 0.5 * difference**2 * (SAME_SD**-2 - OTHERS_SD**-2) - np.log(OTHERS_SD / SAME_SD)
                if odds.sum() > OTHER_PERSON:
                    scales = {"scale": sizes.scale, "usual": measured[usual].scale}
                    findings[index] = Finding("other-person", SUSPECT, "another", {**first, **scales})
                else:
                    findings[index] = Finding("other-person", NOTE, "put-on-anew", first)
    return findings


def _worn_elsewhere(first: MeasuredHand, second: MeasuredHand) -> bool:
    apart = np.abs(first.centre_mm - second.centre_mm) if first.joints == second.joints else np.zeros(1)
    return bool(np.median(apart) > WORN_AGAIN_MM)


def measure(checked: CheckedRecording) -> MeasuredHand | None:
    """Return the sizes of a hand with receivers on all four fingers; None for any other body."""
    body, explained = checked.body, checked.explanation
    needed = [f"{finger}_{kind}" for finger in FINGERS for kind in ("mcp", "pip", "dip")]
    if body is None or explained is None or not ({*needed} <= {*body.names} and body.has_anatomy.any()):
        return None
    centre = dict(zip(body.names, explained.centre_mm[0], strict=True))
    phalanges = [
        centre[f"{finger}_{after}"][0, 0] - centre[f"{finger}_{before}"][1, 0]
        for before, after in (("mcp", "pip"), ("pip", "dip"))
        for finger in FINGERS
    ]
    knuckles = np.array([centre[f"{finger}_mcp"][0] for finger in FINGERS])
    spread = (knuckles - knuckles.mean(0)).T.ravel()
    scale = float(explained.scale[0])
    return MeasuredHand(np.array([*phalanges, *spread, scale]), explained.centre_mm[0], body.names, scale)
