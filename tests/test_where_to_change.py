"""What docs/architecture.md says of common changes is all: where a file is forgotten, a test here fails."""

from __future__ import annotations

import ast
import re
from dataclasses import fields
from pathlib import Path

import pytest
from fuzzing.sample_files import RECORDINGS
from fuzzing.tracker_streams import streams

from shukotsu.schemas.config_files import config_path, json_schema, read_config
from shukotsu.schemas.model import HandFitting, JointSolving, MetacarpalPosing, Planes, model_from_config
from shukotsu.stages.capture.formats.readers import FORMATS as READ_ALONE
from shukotsu.stages.capture.formats.readers import MAPPED
from shukotsu.stages.export.registry import FORMATS
from shukotsu.trackers.families import FAMILIES

REPOSITORY = Path(__file__).resolve().parent.parent
DOCS = REPOSITORY / "docs"

GROUPS = {
    "joints": (JointSolving, "stages/solve_joints", "schemas/plan.py"),
    "planes": (Planes, "stages/project_planes"),
    "fit": (HandFitting, "stages/fit_hand"),
    "metacarpals": (MetacarpalPosing, "stages/estimate_metacarpals"),
}
"""Groups of a model file, what holds each, and who obeys it."""


def attributes_read(place: Path) -> set[str]:
    """Every name that a file, or the code of a folder, reads of some object."""
    files = [place] if place.is_file() else place.rglob("*.py")
    trees = (ast.parse(path.read_text("utf-8")) for path in files)
    return {node.attr for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


@pytest.mark.parametrize("group", GROUPS)
def test_a_key_of_a_model_is_held_and_read_where_it_is_obeyed(group: str) -> None:
    holder, *places = GROUPS[group]
    held = {field.name for field in fields(holder)}
    assert held == {*json_schema("model")["properties"][group]["properties"]} - {"whole_hand"}
    assert held <= set[str]().union(*(attributes_read(REPOSITORY / place) for place in places))


@pytest.mark.parametrize("group", GROUPS)
def test_a_key_that_nobody_holds_stops_every_model(group: str) -> None:
    config = read_config(config_path("whole-hand", "model", Path()), "model")
    config[group]["made_up"] = 1
    with pytest.raises(TypeError, match="made_up"):
        model_from_config(config, "")


def test_every_family_is_fuzzed() -> None:
    assert {stream.settings.family for stream in streams(1).values()} == {*FAMILIES}


def test_the_guide_names_every_family() -> None:
    page = (DOCS / "recording.md").read_text("utf-8")
    assert [family.title for family in FAMILIES.values() if family.title not in page] == []


def test_a_mapping_may_name_every_format_that_needs_one() -> None:
    named = json_schema("mapping")["properties"]["format"]["enum"]
    assert sorted(named) == sorted(MAPPED)


def test_every_recording_format_is_fuzzed() -> None:
    assert {*READ_ALONE, *MAPPED} <= set(RECORDINGS)


def test_a_study_may_ask_for_every_export_format_and_no_other() -> None:
    asked = json_schema("study")["properties"]["exports"]["items"]["enum"]
    assert sorted(asked) == sorted(FORMATS)


def test_the_guide_has_a_row_for_every_export_format() -> None:
    page = (DOCS / "exports.md").read_text("utf-8")
    assert [name for name in FORMATS if f"| `{name}` |" not in page] == []


def test_the_guide_explains_every_section_of_the_report() -> None:
    page = (DOCS / "reading-a-report.md").read_text("utf-8").lower()
    templates = (REPOSITORY / "stages" / "report").rglob("*.j2")
    heads = {
        head for path in templates for head in re.findall(r"<h2[^>]*>([^<{]+)</h2>", path.read_text("utf-8"))
    }
    assert sorted(head for head in heads if head.lower() not in page) == []
