"""Command line: draw the figures of a study or of one recording, as SVG and PDF with captions."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shukotsu import command_line


def build_parser() -> argparse.ArgumentParser:
    """Return the stage's argument parser."""
    parser = command_line.parser(
        "shukotsu stage print_figures",
        "Draw a study's figures, or with --recording one recording's, for print: NAME.svg, NAME.pdf and the "
        "caption NAME.txt of each.",
        "shukotsu stage print_figures --study config/demo.yaml --results results/demo "
        "--out results/demo/figures",
    )
    command_line.add_study_options(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where the figures go")
    one = (
        "draw this recording instead, e.g. 01 right opposition (with a trial: opposition_2), into "
        "FOLDER/sub-SUBJECT/HAND/NAME"
    )
    parser.add_argument("--recording", nargs=3, metavar=("SUBJECT", "HAND", "NAME"), help=one)
    return parser


def draw(arguments: argparse.Namespace) -> None:
    """Read the study's results and write every figure; report on stderr which figures have no data."""
    from shukotsu.report.figures import recording_figures
    from shukotsu.report.figures.drawing import save
    from shukotsu.report.figures.study_figures import of_study
    from shukotsu.report.figures.style import font_note, print_language
    from shukotsu.report.study_results import read_results
    from shukotsu.report.templates import speaking
    from shukotsu.study.study import read_study
    from shukotsu.translation import ENGLISH

    study = read_study(arguments.study)
    results = read_results(study, arguments.results)
    folder, language = arguments.out, print_language(study.language)
    if note := font_note(study.language):
        print(f"note: {note}", file=sys.stderr)
    with speaking(language):
        if arguments.recording:
            recording = recording_figures.find_recording(results, *arguments.recording)
            folder = folder / recording.hand.folder / recording.name
            drawings = recording_figures.of_recording(results, recording)
        else:
            drawings = of_study(results, study)
        for drawing in drawings:
            save(folder, drawing)
            if drawing.missing:
                why = drawing.missing if language == ENGLISH else "not drawn; the caption states why"
                print(f"{folder / drawing.name}: {why}", file=sys.stderr)


def record_failure(arguments: argparse.Namespace, message: str) -> None:
    """Write figures that state why the study's figures could not be drawn."""
    if arguments.recording:
        print("error: nothing was written, since no study lists a recording's figures", file=sys.stderr)
        return
    from shukotsu.report.figures.drawing import not_drawn, save
    from shukotsu.study.results import STUDY_FIGURES

    for name in STUDY_FIGURES:
        save(arguments.out, not_drawn(name, message))


main = command_line.script(build_parser, draw, record_failure)


if __name__ == "__main__":
    raise SystemExit(main())
