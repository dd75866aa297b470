"""The cluster profiles name every rule and have an executable status command."""

import os
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

REPOSITORY = Path(__file__).resolve().parents[2]
PROFILES = REPOSITORY / "profiles"
NAMES = ["slurm", "cluster-generic"]


def profile(name: str) -> dict[str, Any]:
    read: dict[str, Any] = yaml.safe_load((PROFILES / name / "config.yaml").read_text("utf-8"))
    return read


@pytest.mark.parametrize("name", NAMES)
def test_every_rule_has_a_group(name: str) -> None:
    """Without a group, each job of a rule would be a separate batch job."""
    rules = set(
        re.findall(
            r"^(?:use rule \w+ as|rule) (\w+)", (REPOSITORY / "Snakefile").read_text("utf-8"), re.MULTILINE
        )
    )
    assert set(profile(name)["groups"]) == rules - {"all"}
    assert set(profile(name)["set-resources"]) <= rules


@pytest.mark.parametrize("name", NAMES)
def test_the_status_command_is_beside_the_profile_and_executable(name: str) -> None:
    script = PROFILES / name / profile(name)["cluster-generic-status-cmd"]
    assert os.access(script, os.X_OK)
