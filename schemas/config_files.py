"""YAML configuration files: read, checked against their JSON Schema, defaults filled in.

The schemas are closed: a typo is refused by name. `docs/configuration.md` is made from them.
"""

from __future__ import annotations

import difflib
import hashlib
import json
import math
import os
from collections.abc import Hashable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from schemas.errors import InputError

SCHEMA_FOLDER = Path(__file__).parent / "json"
CONFIG_FOLDER = Path(__file__).parent.parent / "config"
FOUND_RIGHT = "SHUKOTSU_FOUND_RIGHT"
"""Environment variable: digests of configurations, each with its schema, that were found right."""


class _StrictLoader(yaml.CSafeLoader):  # type: ignore[misc, unused-ignore]
    """YAML in which a key given twice is an error and not a silent last word."""


def _mapping_without_twins(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, Hashable):
            raise yaml.constructor.ConstructorError(
                None, None, f"{key!r} cannot be a key", key_node.start_mark
            )
        if key in seen:
            raise yaml.constructor.ConstructorError(
                None, None, f"the key {key!r} is given twice", key_node.start_mark
            )
        seen.add(key)
    return loader.construct_mapping(node, deep=True)


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_without_twins)


def json_schema(kind: str) -> dict[str, Any]:
    """Give the JSON Schema of a kind of configuration file: study, layout or model."""
    loaded: dict[str, Any] = json.loads((SCHEMA_FOLDER / f"{kind}.schema.json").read_text("utf-8"))
    return loaded


def read_config(path: Path, kind: str, *, with_defaults: bool = True) -> dict[str, Any]:
    """Read a configuration file of that kind (study, layout, model), by default with defaults filled in.

    Raises InputError where the file is absent, is not YAML, or does not match its schema.
    """
    try:
        loaded = yaml.load(path.read_text("utf-8"), Loader=_StrictLoader)
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such {kind} file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as text ({error})") from error
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a date that no calendar has
        raise InputError(f"{path}: not valid YAML: {_one_line(str(error))}") from error
    checked = check_config(loaded, kind, str(path))
    return checked if with_defaults else dict(loaded)


def check_config(loaded: object, kind: str, where: str) -> dict[str, Any]:
    """Check a loaded configuration against its schema and fill in the defaults; `where` names the file.

    What the process that started this one has found right, see `tell_children`, is not checked again.
    """
    schema = json_schema(kind)
    digest = hashlib.sha256(repr((schema, loaded)).encode("utf-8", "surrogatepass")).hexdigest()
    if digest not in _found_right():
        _refuse_unless_right(loaded, schema, where)
        _found_right().add(digest)
    assert isinstance(loaded, dict)
    filled: dict[str, Any] = _with_defaults(loaded, schema, schema)
    return filled


def tell_children() -> None:
    """Let processes that this one starts know what was found right: to import the checker takes them longer
    than reading their configuration.
    """
    os.environ[FOUND_RIGHT] = " ".join(sorted(_found_right()))


@cache
def _found_right() -> set[str]:
    return set(os.environ.get(FOUND_RIGHT, "").split())


def _refuse_unless_right(loaded: object, schema: dict[str, Any], where: str) -> None:
    import jsonschema  # slow to import, and mostly not needed

    validator = jsonschema.Draft202012Validator(schema)
    errors = sorted(validator.iter_errors(loaded), key=lambda e: [str(part) for part in e.absolute_path])
    sentences = list(dict.fromkeys(_sentence(error) for error in errors)) or _not_finite(loaded)
    if sentences:
        raise InputError(f"{where}: " + "; ".join(sentences[:5]))


def shipped(kind: str) -> list[str]:
    """Names of the layouts or models that ship; `kind` is layout or model."""
    return sorted(path.stem for path in (CONFIG_FOLDER / f"{kind}s").glob("*.yaml"))


def config_path(name: str, kind: str, folder: Path) -> Path:
    """Find a layout or model: the name of one that ships, or a path relative to `folder`.

    Raises InputError that lists what there is.
    """
    if name in shipped(kind):
        return CONFIG_FOLDER / f"{kind}s" / f"{name}.yaml"
    path = folder / name
    if path.is_file():
        return path
    near = _nearest(name, shipped(kind))
    raise InputError(
        f"{kind} {name!r} is neither a {kind} that ships ({', '.join(shipped(kind))}) "
        f"nor a file in {folder}{near}"
    )


def _nearest(word: str, known: list[str]) -> str:
    close = difflib.get_close_matches(word, known, 1)
    return f"; did you mean {close[0]!r}?" if close else ""


def _sentence(error: Any) -> str:
    place = ".".join(str(part) for part in error.absolute_path)
    prefix = f"{place}: " if place else ""
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", {}))
        odd = sorted(str(key) for key in set(error.instance) - set(known))
        guesses = "".join(_nearest(key, known) for key in odd[:1])
        return f"{prefix}unknown key {', '.join(map(repr, odd))}; known are {', '.join(known)}{guesses}"
    if error.validator == "required":
        absent = [key for key in error.validator_value if key not in error.instance]
        return f"{prefix}the key {', '.join(map(repr, absent))} is missing"
    return f"{prefix}{_one_line(error.message)}"


def _not_finite(value: Any, place: str = "") -> list[str]:
    """Name every .nan and .inf, which JSON Schema lets pass as numbers."""
    if isinstance(value, float) and not math.isfinite(value):
        return [f"{place}: is {value}; expected a finite number"]
    parts: list[tuple[object, Any]] = []
    if isinstance(value, dict):
        parts = list(value.items())
    elif isinstance(value, list):
        parts = list(enumerate(value))
    return [
        text for key, part in parts for text in _not_finite(part, f"{place}.{key}" if place else str(key))
    ]


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _with_defaults(value: Any, schema: dict[str, Any], root: dict[str, Any]) -> Any:
    if "$ref" in schema:
        schema = {**root["$defs"][schema["$ref"].rsplit("/", 1)[-1]], **schema}
    if not isinstance(value, dict):
        return value
    properties: dict[str, Any] = schema.get("properties", {})
    filled = {key: part["default"] for key, part in properties.items() if "default" in part} | value
    return {key: _with_defaults(part, sub, root) for key, part, sub in _parts(filled, schema)}


def _parts(filled: dict[str, Any], schema: dict[str, Any]) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    others = schema.get("additionalProperties")
    for key, part in filled.items():
        fallback = others if isinstance(others, dict) else {}
        yield key, part, schema.get("properties", {}).get(key, fallback)
