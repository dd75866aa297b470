"""The folder that the guide's commands are run in: a small finished study `demo`, and a lab's own files.

The study has the demo's names (subject 01, right hand, rom and opposition), so that what the guide writes of
results/demo runs on it.
"""

from __future__ import annotations

from pathlib import Path

from studies.running import record, write_study

SUBJECTS = ("01", "02")
MODELS = ["rigid", "paper-fig4", "whole-hand"]
FRAMES = 400
LAB_FILES = {
    "recordings.tsv": "subject\thand\ttask\trole\tfile\nP01\tright\trom\tcalibration\tp01_rom.csv\n"
    "P01\tright\tscales\tevaluation\tp01_scales.csv\n",
    "participants.tsv": "subject\thand_length_mm\thand_breadth_mm\nP01\t185\t82\n",
}
STUDY = "study: piano\nrecordings: recordings.tsv\nlayout: liberty16\nmodels: [rigid, paper-fig4]\n"


def write_lab_files(folder: Path) -> None:
    """Recordings of one hand and the sheets that name them, as the guide says that a reader has."""
    for name, task in (("rom", "rom"), ("p01_rom", "rom"), ("p01_scales", "opposition")):
        record(folder / f"{name}.csv", subject="P01", task=task, frames=FRAMES)
    for name, text in LAB_FILES.items():
        (folder / name).write_text(text, "utf-8")


def make_guide_folder(folder: Path) -> None:
    """Write the lab's files, and the study `demo`, and run it."""
    write_lab_files(folder)
    rows = []
    for subject in SUBJECTS:
        for task, role in (("rom", "calibration"), ("opposition", "both")):
            name = f"{subject}_{task}.parquet"
            record(folder / "captures" / name, subject=subject, task=task, frames=FRAMES)
            rows.append(f"{subject}\tright\t{task}\t{role}\tcaptures/{name}\t")
    write_study(folder, "demo", rows, MODELS, exports="[glb]").run()
    (folder / "config").mkdir()
    for name in ("demo.yaml", "demo.tsv"):
        text = (folder / name).read_text("utf-8").replace("captures/", "../captures/")
        (folder / "config" / name).write_text(text, "utf-8")
    (folder / "study.yaml").write_text((folder / "demo.yaml").read_text("utf-8"), "utf-8")


def begin_as_reader(folder: Path, page: str) -> None:
    """Make the folder's study the one that the page's text speaks of."""
    if "results/piano" in page:
        (folder / "study.yaml").write_text(STUDY, "utf-8")
