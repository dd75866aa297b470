"""Running stages by name in this process, for the tests of all rooms."""

import runpy
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from shukotsu import command_line
from shukotsu.command_line import option_of
from shukotsu.commands.run_stage import STAGES
from shukotsu.study.config_files import REFERENCE
from shukotsu.study.plan_file import read_plan
from shukotsu.study.results import FIT_TABLES


def __getattr__(name: str) -> Callable[[Sequence[str]], int]:
    """Return the function that runs a stage: `stage_runs.solve_joints`."""
    path = STAGES / f"{name}.py"
    if not path.is_file():
        raise AttributeError(name)
    return partial(command_line.run_script, path)


@cache
def names_in(stage: str) -> dict[str, Any]:
    """Return the names that a stage's script defines."""
    return runpy.run_path(str(STAGES / f"{stage}.py"))


def reads(stage: str) -> Sequence[str]:
    """Return the subject's tables for which a stage has options."""
    return names_in(stage)["build_parser"]().get_default("tables") or ()


def outputs(stage: str, folder: Path) -> list[str]:
    """Return the options of a stage that name its output tables in a folder, or the folder itself."""
    writes = {"out": "findings"} if stage == "check_recordings" else names_in(stage)["WRITES"]
    return [
        f"{option_of(option)}={folder / f'{tables}.parquet' if isinstance(tables, str) else folder}"
        for option, tables in writes.items()
    ]


def of_plan(stage: str, plan_file: Path) -> list[str]:
    """Return the options of a stage that name a plan and the existing tables beside it."""
    plan, options = read_plan(plan_file), [f"--plan={plan_file}"]
    fits = [(hand, model) for hand in plan.hands for model in (*plan.fitted_models, REFERENCE)]
    for name in reads(stage):
        paths = [plan.table(name, *fit) for fit in fits] if name in FIT_TABLES else [plan.table(name)]
        files = [str(path) for path in paths if path.is_file()]
        options += [option_of(name), *files] if files else []
    return options
