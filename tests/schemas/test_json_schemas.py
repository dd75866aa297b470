"""The JSON Schemas are closed and say what every key means."""

from collections.abc import Iterator
from typing import Any

import pytest

from schemas.config_files import json_schema

KINDS = ("study", "layout", "model", "mapping")


def groups(schema: dict[str, Any], path: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every object in a schema, with where it stands."""
    if schema.get("type") == "object":
        yield path, schema
    for name, part in schema.get("properties", {}).items():
        yield from groups(part, f"{path}.{name}")
    if isinstance(schema.get("additionalProperties"), dict):
        yield from groups(schema["additionalProperties"], f"{path}.*")


@pytest.mark.parametrize("kind", KINDS)
def test_closed_and_described(kind: str) -> None:
    """No key passes unread: objects list their keys, or say what keys of any name hold."""
    found = dict(groups(json_schema(kind), kind))
    assert found
    for path, schema in found.items():
        others = schema.get("additionalProperties")
        assert others is False or isinstance(others, dict), path
        for name, part in schema.get("properties", {}).items():
            assert part.get("description", "").endswith("."), f"{path}.{name} has no description"
