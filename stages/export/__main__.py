"""Command line: a study's tables -> skeleton and motion of one recording in formats that programs read."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from stages import command_line
from stages.export.formats import FORMATS

if TYPE_CHECKING:
    from schemas.study import Recording, Study
    from stages.export.motion import SkeletonMotion
    from stages.export.settings import Settings


HANDS = {"right": ("right",), "left": ("left",), "both": ("right", "left")}


def build_parser() -> argparse.ArgumentParser:
    """Give the stage's argument parser."""
    formats = "".join(f"\n  {name:6}{', '.join(f.extensions)}: {f.what}" for name, f in FORMATS.items())
    made = command_line.parser(
        "stages.export",
        f"Write a person's skeleton and its motion in one recording for other programs.\n\nformats:{formats}",
        "python -m stages.export --study config/demo.yaml --results results/demo --subject 01 --hand right "
        "--recording opposition --model whole-hand --formats bvh,csv --out exports",
    )
    made.add_argument("--study", type=Path, required=True, help="the study file")
    made.add_argument("--results", type=Path, help="its results (default: results/ and the study's name)")
    made.add_argument("--subject", required=True, help="whose hand")
    made.add_argument(
        "--hand", choices=tuple(HANDS), required=True, help="which hand; both: in one file, of glb and usd"
    )
    made.add_argument("--recording", required=True, help="the task, or TASK_TRIAL")
    made.add_argument("--model", required=True, help="a skeleton model of the study")
    made.add_argument("--formats", required=True, help=f"one or more of {','.join(FORMATS)}")
    made.add_argument("--out", type=Path, required=True, help="the folder to write to")
    made.add_argument("--licence", default="", help="words on the terms of use, to go into every file")
    add_motion_options(made)
    return made


def add_motion_options(made: argparse.ArgumentParser) -> None:
    """Add the options that say how a motion is made ready; `settings_of` reads them."""
    made.add_argument("--fps", type=_positive, help="frames a second to resample to (default: as recorded)")
    made.add_argument("--frames", type=_frames, default=(None, None), help="A:B, recorded frame numbers")
    made.add_argument("--rate-hz", type=_positive, help="rate of a recording that has no device time")
    made.add_argument("--unit", choices=("m", "cm", "mm"), default="", help="where the format has a choice")
    made.add_argument("--up", choices=("y", "z"), default="", help="likewise, the axis that points up")
    made.add_argument(
        "--transmitter-up",
        choices=("x", "y", "z", "-x", "-y", "-z"),
        default="z",
        help="the transmitter's axis that points up; write --transmitter-up=-z (default: %(default)s)",
    )
    made.add_argument(
        "--gaps",
        choices=("refuse", "hold", "cut", "interpolate"),
        default="refuse",
        help="frames without a pose; formats that can hold them keep them by default (default: %(default)s)",
    )
    made.add_argument(
        "--max-gap-s", type=_positive, default=0.1, help="longest gap to interpolate (default: %(default)s)"
    )
    made.add_argument("--rig", default="", help="names of webxr, openxr, vrm, unity, unreal or mixamo")
    made.add_argument(
        "--bones",
        choices=("exact", "stiff"),
        default="exact",
        help="exact: joints where the tables have them, bones stretch by the joints' gaps; stiff: bones keep "
        "their length and only turn (default: %(default)s)",
    )


def _positive(word: str) -> float:
    value = float(word)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{word} is not above 0")
    return value


def _frames(word: str) -> tuple[int | None, int | None]:
    first, colon, last = word.partition(":")
    try:
        if not colon:
            raise ValueError
        return (int(first) if first else None, int(last) if last else None)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{word!r} is not A:B, for example 100:900") from error


def export(arguments: argparse.Namespace) -> None:
    """Read the study and the recording's tables, write every format, say on stderr what was done.

    A format that cannot be written does not keep the others from being written. Its InputError is raised at
    the end, or with --record-failure written into STEM_FORMAT.failed.txt.
    """
    from schemas.errors import InputError
    from schemas.files import write_text

    formats, settings = chosen_formats(arguments.formats), settings_of(arguments)
    motions = [_read(arguments, hand) for hand in HANDS[arguments.hand]]
    for sentence in dict.fromkeys(sentence for motion in motions for sentence in motion.notes):
        print(f"note: {sentence}", file=sys.stderr)
    failures = {}
    for name in formats:
        path = _path(arguments, motions, name)
        try:
            said = _written(motions, settings, name, path)
        except InputError as error:
            failures[name] = str(error)
            continue
        for sentence in said:
            print(f"{name}: {sentence}", file=sys.stderr)
        print(path)
    for name, message in failures.items() if arguments.record_failure else ():
        print(f"error: {message}", file=sys.stderr)
        write_text(arguments.out / f"{_stem(arguments, motions)}_{name}.failed.txt", f"{message}\n")
    if failures and not arguments.record_failure:
        raise InputError("; ".join(dict.fromkeys(failures.values())))


def _written(motions: list[SkeletonMotion], settings: Settings, name: str, path: Path) -> tuple[str, ...]:
    from schemas.errors import InputError

    if len(motions) == 1:
        return write_format(motions[0], settings, name, path)
    if FORMATS[name].write_scene is None:
        raise InputError(f"--hand both: {name} holds one hand a file; choose --hand right or --hand left")
    return write_hands(motions, settings, name, path)


def _stem(arguments: argparse.Namespace, motions: list[SkeletonMotion]) -> str:
    from dataclasses import replace

    from stages.export.note import stem

    return stem(replace(motions[0].origin, hand=arguments.hand))


def _path(arguments: argparse.Namespace, motions: list[SkeletonMotion], name: str) -> Path:
    made = FORMATS[name]
    own = f"{_stem(arguments, motions)}{made.extensions[0]}"
    return Path(arguments.out / (made.shared or own))


def write_hands(motions: list[SkeletonMotion], settings: Settings, name: str, path: Path) -> tuple[str, ...]:
    """Write several hands into one file of a format that can hold them; see `write_format`."""
    from stages.export.settings import prepared

    made = FORMATS[name]
    assert made.write_scene is not None
    target = made.target(settings.unit, settings.up)
    ready = [prepared(motion, settings, holds_gaps=made.holds_gaps, up=target.up) for motion in motions]
    done = [own.notes[len(motion.notes) :] for own, motion in zip(ready, motions, strict=True)]
    dropped = made.write_scene(ready, target, path)
    told = dict.fromkeys(sentence for own in done for sentence in own)
    return (*told, f"not in the file: {made.drops}", *dropped)


def write_format(motion: SkeletonMotion, settings: Settings, name: str, path: Path) -> tuple[str, ...]:
    """Write a motion as it was read in one of FORMATS; give what was done to it and what the file lacks."""
    from schemas.files import write_text
    from stages.export.note import text
    from stages.export.settings import prepared

    made = FORMATS[name]
    target = made.target(settings.unit, settings.up)
    ready = prepared(motion, settings, holds_gaps=made.holds_gaps, up=target.up)
    dropped = made.write(ready, target, path)
    if not made.embeds_note:
        write_text(path.with_name(f"{path.name}.txt"), text(ready, target, (made.drops, *dropped)))
    return (*ready.notes[len(motion.notes) :], f"not in the file: {made.drops}", *dropped)


def chosen_formats(words: str) -> list[str]:
    """Names from a comma-separated list, each once; InputError where one is no format."""
    from schemas.errors import InputError

    names = list(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    strange = [name for name in names if name not in FORMATS]
    if strange or not names:
        raise InputError(
            f"--formats: {strange[0] if strange else 'nothing'!r} is no format; expected one or more of "
            f"{', '.join(FORMATS)}, joined by commas"
        )
    return names


def settings_of(arguments: argparse.Namespace) -> Settings:
    """The settings that `add_motion_options` asked for."""
    from stages.export.settings import Settings

    return Settings(
        unit=arguments.unit,
        up=arguments.up,
        transmitter_up=arguments.transmitter_up,
        gaps=arguments.gaps,
        max_gap_s=arguments.max_gap_s,
        rig=arguments.rig,
        stiff=arguments.bones == "stiff",
        fps=arguments.fps,
        first=arguments.frames[0],
        last=arguments.frames[1],
        rate_hz=arguments.rate_hz,
    )


def _read(arguments: argparse.Namespace, hand: str) -> SkeletonMotion:
    from schemas.errors import InputError
    from schemas.layout import read_layout
    from schemas.model import read_model
    from schemas.results import Results
    from schemas.study import read_study
    from stages.export.reading import read_motion

    study = read_study(arguments.study)
    recording = _recording(study, arguments, hand)
    if arguments.model not in study.models:
        raise InputError(
            f"--model: {arguments.study} has no model {arguments.model!r}; it has {', '.join(study.models)}"
        )
    results = Results(arguments.results) if arguments.results else Results.of(study.name)
    layout = read_layout(recording.layout.absolute())
    model = read_model(study.models[arguments.model].absolute())
    return read_motion(results, recording, layout, model, arguments.licence)


def _recording(study: Study, arguments: argparse.Namespace, hand: str) -> Recording:
    from schemas.errors import InputError

    ours = [r for r in study.recordings if (r.hand.subject, r.hand.hand) == (arguments.subject, hand)]
    if not ours:
        hands = ", ".join(f"{known.subject} {known.hand}" for known in study.hands)
        raise InputError(
            f"--subject, --hand: {arguments.study} has no {hand} hand of {arguments.subject!r}; it "
            f"has {hands}"
        )
    word = arguments.recording
    found = [r for r in ours if word in (r.name, r.task, f"{r.task}_{r.trial}")]
    exact = [r for r in found if word in (r.name, f"{r.task}_{r.trial}") or not r.trial]
    if len(exact or found) != 1:
        names = ", ".join(r.name for r in ours)
        raise InputError(f"--recording: {word!r} is not one recording of that hand; expected one of {names}")
    return (exact or found)[0]


def inputs(arguments: argparse.Namespace) -> list[Path]:
    """Everything of the results that a recording's export is made from (see `stages.each`).

    A change of the layout or the model changes these tables too, for the digests of both are in them.
    """
    from schemas.results import Results
    from schemas.study import Hand

    results, found = Results(arguments.results), []
    for side in HANDS[arguments.hand]:
        hand = Hand(arguments.subject, side)
        found.append(results.skeleton(arguments.model, hand))
        found.append(results.folder / hand.folder / arguments.recording / "poses.parquet")
    return found


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write the reason into a text file where the first format's file would be."""
    from schemas.files import write_text
    from stages.export.motion import Origin
    from stages.export.note import stem

    task, model = arguments.recording, arguments.model
    name = stem(Origin(arguments.subject, arguments.hand, task, "", model, ""))
    write_text(arguments.out / f"{name}.failed.txt", f"{message}\n")


def main(words: list[str] | None = None) -> int:
    """Run the stage on the words of a command line; give its exit code."""
    return command_line.run(build_parser().parse_args(words), export, record_failure)


if __name__ == "__main__":
    sys.exit(main())
