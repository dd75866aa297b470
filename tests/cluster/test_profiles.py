"""The clusters' profiles know every rule, agree with each other, and can be run from anywhere."""

import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
PROFILES = REPOSITORY / "config" / "profiles"
NAMES = ["slurm", "cluster-generic"]


def profile(name: str) -> dict[str, Any]:
    read: dict[str, Any] = yaml.safe_load((PROFILES / name / "config.yaml").read_text("utf-8"))
    return read


@pytest.mark.parametrize("name", NAMES)
def test_every_rule_has_a_group(name: str) -> None:
    """A rule without one would be a batch job for each of its jobs."""
    rules = set(re.findall(r"^rule (\w+):", (REPOSITORY / "Snakefile").read_text("utf-8"), re.MULTILINE))
    assert set(profile(name)["groups"]) == rules - {"all"}
    assert set(profile(name)["set-resources"]) <= rules


def test_both_ask_for_the_same() -> None:
    slurm, generic = map(profile, NAMES)
    own = {"cluster-generic-submit-cmd", "cluster-generic-status-cmd", "cluster-generic-cancel-cmd"}
    assert {key for key in slurm.keys() | generic.keys() if slurm.get(key) != generic.get(key)} == own


@pytest.mark.parametrize("name", NAMES)
def test_the_laptops_settings_hold_too(name: str) -> None:
    assert profile("laptop").items() <= profile(name).items()


@pytest.mark.parametrize("name", NAMES)
def test_the_status_command_is_beside_it_and_can_be_run(name: str) -> None:
    script = PROFILES / name / profile(name)["cluster-generic-status-cmd"]
    assert os.access(script, os.X_OK)


@pytest.mark.parametrize("name", NAMES)
def test_no_value_is_too_long_for_a_file_name(name: str) -> None:
    """Snakemake looks whether a value names a file beside the profile, and fails where none can be."""
    for value in profile(name).values():
        assert all(len(part.encode()) < 255 for part in str(value).split("/")) or isinstance(value, dict)
