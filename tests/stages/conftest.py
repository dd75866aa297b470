"""A subject whose every stage was run by its plan, for tests of stages."""

from pathlib import Path

import pytest
from small_study import run_stages, write_plans, write_poses, write_study

from shukotsu.study.plan import read_plan

ROWS = (
    "01 right rom calibration a.csv",
    "01 right opposition both b.csv",
    "01 left opposition both c.csv",
    "01 left rom both d.csv - - moved",
)


@pytest.fixture(scope="session")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plan of a subject with all tables up to tip errors beside it, which tests only read.

    The right hand's skeletons are made without opposition as well, from rom; the left hand's are not.
    """
    file = write_study(tmp_path_factory.mktemp("study"), *ROWS, models=("rigid", "paper-fig4"))
    plan = write_plans(file)["01"]
    write_poses(read_plan(plan))
    run_stages(plan)
    return plan
