"""Removal of results of subjects, recordings, models and exports that no longer belong to a study."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.study import results
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.plan import SubjectPlan
from shukotsu.study.plan_file import read_plan
from shukotsu.workflow.file_digests import STAMP

EXPORTED = ("sub-", "bids", "tables")
"""Beginnings of the names of exported files and folders."""


def remove_former_results(paths: results.Results, present: Collection[str]) -> list[str]:
    """Remove results that no longer belong to the study; return the names of the folders they were in.

    A subject's results are the files that follow from the plan in its folder; exports are recognised by their
    names. Other files are not touched. present : outputs of the study as it is now.
    """
    exports = [
        f for f in (paths.exports, paths.new_dataset, paths.tidy_tables) if f.as_posix() not in present
    ]
    folders = [former.name for former in exports if _remove(_exported(former), paths.folder)]
    for path in sorted(paths.folder.glob("sub-*/plan.json")):
        plan = None
        with suppress(InputError):  # from a damaged plan it is unknown what was made
            plan = read_plan(path)
        if plan is None or plan.folder != path.parent:
            continue
        files = [file for file in _files_of_subject(plan, paths, present) if file.as_posix() not in present]
        folders += [plan.folder.name] if _remove(files, paths.folder) else []
    return folders


def _remove(files: Iterable[Path], top: Path) -> bool:
    """Remove the files that exist and then empty folders below `top`; return whether any file was removed."""
    removed = [file for file in files if file.is_file()]
    for file in removed:
        file.unlink()
        with suppress(OSError):  # stop at the first folder that is not empty
            for folder in file.parents:
                if folder == top:
                    break
                folder.rmdir()
    return bool(removed)


def _exported(folder: Path) -> Iterator[Path]:
    """Yield the paths of exported files and folders in a folder."""
    yield from (f for f in sorted(folder.rglob("*")) if f.relative_to(folder).parts[0].startswith(EXPORTED))
    yield folder / STAMP


def _files_of_subject(plan: SubjectPlan, paths: results.Results, present: Collection[str]) -> Iterator[Path]:
    """Yield the paths of all results of a subject according to its plan."""
    yield plan.folder / "plan.json"
    yield from map(plan.poses, plan.recordings)
    yield from (plan.table(name) for name in results.SUBJECT_TABLES)
    for model in (*plan.fitted_models, REFERENCE):
        yield from (plan.table(name, hand, model) for hand in plan.hands for name in results.FIT_TABLES)
    pages, exports = paths.subject_pages(*plan.who), paths.subject_exports(*plan.who)
    if pages.as_posix() not in present:
        yield from (paths.recording_page(recording) for recording in plan.recordings)
        yield from (paths.subject_page(*plan.who), pages / results.FAILED_PAGES, pages / STAMP)
    if exports.as_posix() not in present:
        yield from _exported(exports)
