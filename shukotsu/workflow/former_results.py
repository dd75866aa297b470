"""Remove results of subjects, recordings and models that a study had when it ran last and has no longer.

What the workflow wrote for a subject is known by the plan that it wrote beside it; nothing else is touched.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path

from shukotsu.errors import InputError
from shukotsu.schemas.config_files import REFERENCE
from shukotsu.schemas.plan import SubjectPlan, read_plan
from shukotsu.schemas.results import FAILED_PAGES, FIT_TABLES, SUBJECT_TABLES, Results
from shukotsu.workflow.file_digests import STAMP


def remove_former_results(results: Results, present: Collection[str]) -> list[str]:
    """Remove them; return the subjects' folders that they were in. present : paths that rules make now."""
    folders = []
    for path in sorted(results.folder.glob("sub-*/plan.json")):
        plan = None
        with suppress(InputError):  # one that cannot be read says nothing of what was made
            plan = read_plan(path)
        if plan is None or plan.folder != path.parent:
            continue
        former = [own for own in _written(plan, results, present) if own.as_posix() not in present]
        removed = [own for own in former if own.is_file()]
        for own in removed:
            own.unlink()
            with suppress(OSError):  # the first folder that is not empty
                for folder in own.parents:
                    if folder == results.folder:
                        break
                    folder.rmdir()
        folders += [plan.folder.name] if removed else []
    return folders


def _written(plan: SubjectPlan, results: Results, present: Collection[str]) -> Iterator[Path]:
    """The paths of all that was written for a subject, by its plan."""
    yield plan.folder / "plan.json"
    yield from plan.poses_files.values()
    yield from (plan.table(name) for name in SUBJECT_TABLES)
    for model in (*plan.fitted_models, REFERENCE):
        yield from (plan.fit_table(hand, model, name) for hand in plan.hands for name in FIT_TABLES)
    pages, exports = results.subject_pages(*plan.who), results.subject_exports(*plan.who)
    if pages.as_posix() not in present:
        yield from (results.recording_page(recording) for recording in plan.recordings)
        yield from (results.subject_page(*plan.who), pages / FAILED_PAGES, pages / STAMP)
    if exports.as_posix() not in present:
        yield from (own for own in exports.rglob("*") if own.relative_to(exports).parts[0].startswith("sub-"))
        yield exports / STAMP
