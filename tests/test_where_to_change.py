"""What docs/architecture.md says of common changes is all: where a file is forgotten, a test here fails."""

from __future__ import annotations

import ast
import re
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from fuzzing.sample_files import RECORDINGS
from fuzzing.tracker_streams import streams

from schemas.config_files import json_schema
from schemas.model import HandFitting, SkeletonModel
from stages.capture.formats.readers import FORMATS as READ_ALONE
from stages.capture.formats.readers import MAPPED
from stages.export.registry import FORMATS
from trackers.families import FAMILIES

REPOSITORY = Path(__file__).resolve().parent.parent
DOCS = REPOSITORY / "docs"

READ_AS = {"model": "name", "whole_hand": "fitting"}
"""Keys of a model file that the model holds by another name."""


def leaves(schema: dict[str, Any]) -> set[str]:
    """Names of a schema's keys that hold a value and no group."""
    names = set()
    for name, part in schema.get("properties", {}).items():
        names |= leaves(part) if part.get("type") == "object" else {name}
    return names


def attributes_read(folder: Path) -> set[str]:
    """Every name that code of a folder reads of some object."""
    trees = (ast.parse(path.read_text("utf-8")) for path in folder.rglob("*.py"))
    return {node.attr for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)}


def loaded(place: str) -> Any:
    """What `module:object` names."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def test_a_key_of_a_model_is_held_by_the_model() -> None:
    held = {field.name for of in (SkeletonModel, HandFitting) for field in fields(of)} - {"fitting"}
    keys = {READ_AS.get(name, name) for name in leaves(json_schema("model"))} - {"fitting"}
    assert keys == held


def test_what_a_model_holds_is_read_by_a_stage_or_the_skeleton() -> None:
    read = attributes_read(REPOSITORY / "stages") | attributes_read(REPOSITORY / "skeleton")
    read |= attributes_read(REPOSITORY / "schemas")  # a plan says which recordings calibrate a model
    held = {field.name for of in (SkeletonModel, HandFitting) for field in fields(of)}
    assert held <= read


@pytest.mark.parametrize("name", FAMILIES)
def test_the_code_of_a_family_is_where_its_record_says(name: str) -> None:
    family = FAMILIES[name]
    for place in (
        *map(":".join, family.decoders.values()),
        family.driver,
        family.emulated_device,
        family.items,
    ):
        assert place is None or loaded(place) is not None


def test_a_package_of_a_tracker_has_a_family() -> None:
    packages = {path.parent.name for path in (REPOSITORY / "trackers").glob("*/driver.py")} - {"record"}
    assert packages == {family.driver.split(".")[1] for family in FAMILIES.values()}


def test_every_family_and_mode_is_fuzzed() -> None:
    known = {(stream.settings.family, stream.settings.mode) for stream in streams(1).values()}
    decoded = {(name, mode) for name, family in FAMILIES.items() for mode in family.decoders}
    assert decoded - known <= {("patriot", "ascii")}  # which is LIBERTY's


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


@pytest.mark.parametrize("name", FORMATS)
def test_an_export_format_has_its_writer_and_a_test(name: str) -> None:
    assert callable(FORMATS[name].writers.write)
    tests = (
        path.read_text("utf-8") for path in (REPOSITORY / "tests" / "stages" / "export").glob("test_*.py")
    )
    module = FORMATS[name].module.rpartition(".")[2]
    assert any(re.search(rf"\b{module}\b", text) for text in tests)


def test_a_writer_of_files_is_an_export_format() -> None:
    folder = REPOSITORY / "stages" / "export"
    writers = {path.stem for path in folder.glob("*.py") if "\ndef write(\n" in path.read_text("utf-8")}
    writers |= {path.stem for path in folder.glob("*.py") if "\ndef write(motion" in path.read_text("utf-8")}
    assert writers == {form.module.rpartition(".")[2] for form in FORMATS.values()}


def test_the_guide_explains_every_section_of_the_report() -> None:
    page = (DOCS / "reading-a-report.md").read_text("utf-8").lower()
    templates = (REPOSITORY / "stages" / "report").rglob("*.j2")
    heads = {
        head for path in templates for head in re.findall(r"<h2[^>]*>([^<{]+)</h2>", path.read_text("utf-8"))
    }
    assert sorted(head for head in heads if head.lower() not in page) == []
