"""Damaged studies, sheets, layouts, models, mappings, plans and tables are read or refused in one
sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from damaged_bytes import assert_read_or_refused, damaged
from hypothesis import given
from hypothesis import strategies as st
from sample_files import poses_of

from shukotsu.study.config_files import CONFIG_FOLDER
from shukotsu.study.layout import read_layout
from shukotsu.study.mapping import read_mapping
from shukotsu.study.model import read_model
from shukotsu.study.plan_file import StudyPlans, plan_text, read_plan
from shukotsu.study.study import read_study
from shukotsu.tables.poses import read_poses

STUDY = {
    "study.yaml": "study: a\nrecordings: recordings.tsv\nparticipants: participants.tsv\n"
    "corrections: corrections.tsv\nmeasurements: measurements.tsv\ntouches: touches.tsv\nevents: events.tsv\n"
    "factors: [group, hand]\nlayout: liberty16\nmodels: [paper-fig4, whole-hand]\nexports: [bvh, glb]\n",
    "recordings.tsv": "subject\thand\ttask\trole\tfile\ttrial\n01\tright\trom\tboth\ta.csv\t\n"
    "01\tright\tgrasp\tevaluation\tb.csv\t2\n02\tleft\trom\tboth\tc.csv\t\n",
    "participants.tsv": "subject\thand_length_mm\thand_breadth_mm\tgroup\n01\t180\t80\ta\n02\t\t\tb\n",
    "corrections.tsv": "subject\thand\tjoint\tdx_mm\tdy_mm\tdz_mm\n01\tright\tindex_pip\t1\t-2\t3e0\n",
    "measurements.tsv": "subject\thand\tquantity\tvalue_mm\tsd_mm\n01\tright\tindex_proximal\t40.5\t1\n",
    "touches.tsv": "subject\thand\ttask\tdigit\tpart\tfrom_s\tto_s\tx_mm\ty_mm\tz_mm\tsd_mm\n"
    "01\tright\trom\tindex\tpad\t0.5\t1\t1\t2\t3\t0.5\n",
    "events.tsv": "subject\thand\ttask\ttrial\tonset_s\tduration_s\tname\n01\tright\tgrasp\t2\t0.5\t1\ttap\n",
}
MAPPING = """{format: csv, position_unit: cm, orientation: {kind: quaternion, order: wxyz},
csv: {time: t, time_unit: s}, receivers: {hand: {position: [x, y, z], orientation: [a, b, c, d]}}}"""


def plans_of(folder: Path) -> StudyPlans:
    return StudyPlans(read_study(folder / "study.yaml"), Path("results/a"))


def all_plans(folder: Path) -> None:
    plans = plans_of(folder)
    for subject in read_study(folder / "study.yaml").subjects:
        plans.content(subject)


def plan_of(folder: Path) -> None:
    plan = read_plan(folder / "plan.json")
    plan.parts()
    for recording in plan.recordings:
        plan.poses(recording)


READERS: Mapping[str, Callable[[Path], object]] = {
    **dict.fromkeys(STUDY, lambda folder: read_study(folder / "study.yaml")),
    "study.yaml": all_plans,
    "layout.yaml": lambda folder: read_layout("layout.yaml", folder).of_hand("left"),
    "model.yaml": lambda folder: read_model("model.yaml", folder),
    "mapping.yaml": lambda folder: read_mapping(folder / "mapping.yaml"),
    "plan.json": plan_of,
    "poses.parquet": lambda folder: read_poses(folder / "poses.parquet", ("hand",)),
}


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sound")
    layout, model = CONFIG_FOLDER / "layouts/liberty16.yaml", CONFIG_FOLDER / "models/whole-hand.yaml"
    files = STUDY | {"mapping.yaml": MAPPING, "layout.yaml": layout.read_text("utf-8")}
    files |= {"model.yaml": model.read_text("utf-8").replace("model: whole-hand", "model: model")}
    for name, text in files.items():
        (folder / name).write_text(text, "utf-8")
    (folder / "plan.json").write_text(plan_text(plans_of(folder).content("01")), "utf-8")
    poses_of(folder)
    return folder


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused(sound: Path, name: str, data: st.DataObject) -> None:
    path = sound / name
    before = path.read_bytes()
    READERS[name](sound)
    try:
        path.unlink()
        path.write_bytes(data.draw(damaged(before)))
        assert_read_or_refused(lambda: READERS[name](sound))
    finally:
        path.write_bytes(before)
