"""Damaged studies, sheets, layouts, models, mappings, plans and tables are read or refused in one
sentence.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from damaged_bytes import assert_read_or_refused, damaged
from hypothesis import given
from hypothesis import strategies as st
from sample_files import poses_of
from small_study import write_study

from shukotsu.study.config_files import CONFIG_FOLDER
from shukotsu.study.layout import read_layout
from shukotsu.study.mapping import read_mapping
from shukotsu.study.model import read_model
from shukotsu.study.plan_file import StudyPlans, plan_text, read_plan
from shukotsu.study.study import read_study
from shukotsu.tables.poses import read_poses

ROWS = ("01 right rom both a.csv", "01 right grasp evaluation b.csv 2", "02 left rom both c.csv")
SHEETS = {
    "participants": "subject hand_length_mm hand_breadth_mm group\n01 180 80 a\n02   b\n",
    "corrections": "subject hand joint dx_mm dy_mm dz_mm\n01 right index_pip 1 -2 3e0\n",
    "measurements": "subject hand quantity value_mm sd_mm\n01 right index_proximal 40.5 1\n",
    "touches": "subject hand task digit part from_s to_s x_mm y_mm z_mm sd_mm\n"
    "01 right rom index pad 0.5 1 1 2 3 0.5\n",
    "events": "subject hand task trial onset_s duration_s name\n01 right grasp 2 0.5 1 tap\n",
}
MORE = "factors: [group, hand]\nexports: [bvh, glb]\n"
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
    **dict.fromkeys((f"sheets/{name}.tsv" for name in ("recordings", *SHEETS)), plans_of),
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
    write_study(folder, *ROWS, models=("paper-fig4", "whole-hand"), more=MORE, **SHEETS)
    files = {"mapping.yaml": MAPPING, "layout.yaml": layout.read_text("utf-8")}
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
