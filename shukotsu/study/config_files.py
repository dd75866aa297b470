"""Read YAML files, check configurations against their JSON Schemas and fill in the defaults.

The schemas allow no unknown keys, so a misspelt key is reported by name. `docs/configuration.md` is
generated from the schemas.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Hashable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import yaml

from shukotsu.errors import InputError, nearest, shorten
from shukotsu.resources import PACKAGE, ROOT
from shukotsu.study.file_formats import MAPPED
from shukotsu.tables import limits
from shukotsu.tables.text_files import read_text, slash_hint

CONFIG_FOLDER = ROOT / "config"
Constants = TypeVar("Constants")

REFERENCE = "prior-only"
"""Name of the model that uses no data, the average hand; the workflow adds it to every study's models."""


class _StrictLoader(yaml.CSafeLoader):  # type: ignore[misc, unused-ignore]
    """YAML 1.2; a duplicate key is an error instead of silently overriding the first.

    PyYAML's default is YAML 1.1, which reads 012 as ten, 1:30 as ninety and `no` as false.
    """


_StrictLoader.yaml_implicit_resolvers = {}


class _Dumper(yaml.SafeDumper):
    """YAML dumper that quotes text which YAML 1.1 or 1.2 would parse as another type."""


_CORE_SCHEMA = {
    "null": ("~|null|Null|NULL|", "~nN"),
    "bool": ("true|True|TRUE|false|False|FALSE", "tTfF"),
    "int": ("[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    "float": (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
    "merge": ("<<", "<"),
}
"""Pattern and possible first letters of each type of plain scalar (YAML 1.2.2, section 10.3.2).

Only the merge key is from YAML 1.1.
"""

for _tag, (_pattern, _letters) in _CORE_SCHEMA.items():
    for _class in (_StrictLoader, _Dumper):
        _firsts = [*_letters, *([""] if _tag == "null" else [])]
        _class.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"(?:{_pattern})\Z"), _firsts)


_StrictLoader.add_constructor(
    "tag:yaml.org,2002:int", lambda _, node: int(node.value, {"0o": 8, "0x": 16}.get(node.value[:2], 10))
)
_StrictLoader.add_constructor(
    "tag:yaml.org,2002:float",
    lambda _, node: float(node.value.lower().replace(".inf", "inf").replace(".nan", "nan")),
)


def _mapping_of_unique_keys(loader: _StrictLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: list[Any] = []
    for key_node, _ in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, Hashable) or key in seen:
            what = f"the key {key!r} is given twice" if key in seen else f"{key!r} cannot be a key"
            raise yaml.constructor.ConstructorError(None, None, what, key_node.start_mark)
        seen.append(key)
    return loader.construct_mapping(node, deep=True)


_StrictLoader.add_constructor(yaml.resolver.BaseResolver.DEFAULT_MAPPING_TAG, _mapping_of_unique_keys)


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of configuration file: study, layout, model or mapping.

    A property with `names_of` gets the names in that registry as its permitted values: `recordings` means the
    formats that can be read by a mapping (`study/file_formats.py`), any other name a group of
    `export/formats.yaml`.
    """

    def with_names(part: dict[str, Any]) -> dict[str, Any]:
        if (registry := part.get("names_of")) == "recordings":
            part["enum"] = [*MAPPED]
            part["description"] += f" {'; '.join(map(': '.join, MAPPED.items()))}."
        elif registry:
            part["enum"] = [*part.get("enum", ()), *export_constants()[registry]]
        return part

    text = (ROOT / "schemas" / "json" / f"{kind}.schema.json").read_text("utf-8")
    loaded: dict[str, Any] = json.loads(text, object_hook=with_names)
    return loaded


def read_yaml(path: Path, kind: str) -> Any:
    """Read a YAML file without checking it against a schema.

    Raises InputError if the file does not exist, is not YAML or repeats a key.
    """
    return loaded_yaml(read_text(path, f"a {kind} file", limits.CONFIG_BYTES), str(path))


def loaded_yaml(text: str, where: str) -> Any:
    """Parse YAML text like `read_yaml`; `where` names its source in error messages."""
    try:
        _check_nesting(text)
        loader = _StrictLoader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _count_values(node, {})
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        raise InputError(f"{where}: not valid YAML: {_place_and_problem(error, text)}") from error
    except (yaml.YAMLError, ValueError) as error:  # ValueError: a number's tag on other text
        raise InputError(f"{where}: not valid YAML: {error}") from error


def read_constants(path: Path) -> dict[str, Any]:
    """Read a YAML file of constants that is part of the program; lists become tuples."""

    def fixed(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: fixed(part) for name, part in value.items()}
        return tuple(map(fixed, value)) if isinstance(value, list) else value

    return dict(fixed(read_yaml(path, "constants")))


@cache
def export_constants() -> dict[str, Any]:
    """Return the groups of `export/formats.yaml` (formats, rigs, words) with their entries."""
    return read_constants(PACKAGE / "export" / "formats.yaml")


def constants(
    kind: type[Constants], path: Path, numbers: dict[str, Any], apart: str, **derived: float
) -> Constants:
    """Build a dataclass of constants from a file's numbers; a field `X_RAD` is converted from `X_DEG`.

    apart : pattern of entries that belong to no field. derived : values of fields that have no entry. Raises
    InputError if another field has no entry, or another entry no field.
    """
    entries = {
        name: name if name in numbers else re.sub("_RAD$", "_DEG", name)
        for name in kind.__annotations__
        if name not in derived
    }
    class_ = f"class {kind.__name__} in {kind.__module__}"
    if missing := [name for name, entry in entries.items() if entry not in numbers]:
        raise InputError(f"{path}: {missing[0]} of {class_} is missing; add an entry {entries[missing[0]]}")
    if odd := [name for name in numbers if name not in entries.values() and not re.fullmatch(apart, name)]:
        raise InputError(f"{path}: {odd[0]} is not in {class_}; add a field {odd[0]} there")
    values = {name: numbers[e] if e == name else math.radians(numbers[e]) for name, e in entries.items()}
    return kind(**values, **derived)


def yaml_text(content: Any) -> str:
    """Format mappings, lists and values as YAML that has the same meaning in versions 1.1 and 1.2."""
    return str(yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100))


def as_yaml_1_1(path: Path) -> Any:
    """Read a file as YAML 1.1, as Snakemake does, for comparison with `read_yaml`.

    Raises InputError if the file does not exist or is not YAML.
    """
    try:
        return yaml.safe_load(read_text(path, "a configuration", limits.CONFIG_BYTES))
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f"{path}: not valid YAML: {error}") from error


def _check_nesting(text: str) -> None:
    """Raise YAMLError if lists and mappings are nested too deeply for the C parser."""
    depth = 0
    event: Any
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > limits.CONFIG_DEPTH:
            problem = f"lists and groups are nested deeper than {limits.CONFIG_DEPTH}"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)


def _count_values(node: yaml.Node, counted: dict[int, int]) -> int:
    """Return the number of values in a node, with aliases expanded.

    Raises YAMLError if there are too many, or if an alias contains itself.
    """
    if id(node) in counted:
        return counted[id(node)]
    counted[id(node)] = limits.CONFIG_VALUES  # until it is counted: an alias inside itself exceeds the limit
    parts = node.value if isinstance(node, yaml.CollectionNode) else ()
    inside = [part for pair in parts for part in pair] if isinstance(node, yaml.MappingNode) else parts
    total = 1 + sum(_count_values(part, counted) for part in inside)
    if total > limits.CONFIG_VALUES:
        raise yaml.MarkedYAMLError(
            problem=f"expands to more than {limits.CONFIG_VALUES} values", problem_mark=node.start_mark
        )
    counted[id(node)] = total
    return total


def _place_and_problem(error: yaml.MarkedYAMLError, text: str) -> str:
    """Return the parser's description of the problem with its line and column, counted from 1."""
    mark = error.problem_mark or error.context_mark
    where = f" (line {mark.line + 1}, column {mark.column + 1})" if mark is not None else ""
    problem = error.problem or error.context or "damaged"
    lines = text.splitlines()
    line = lines[mark.line] if mark is not None and mark.line < len(lines) else ""
    tab = "; indent with spaces, not tabs" if "\t" in line[: len(line) - len(line.lstrip())] else ""
    return f"{problem}{where}{tab}"


def read_config(path: Path, kind: str, *, with_defaults: bool = True) -> dict[str, Any]:
    """Read a configuration file and check it against the schema of its kind: study, layout or model.

    with_defaults : whether to fill in the defaults of keys that the file omits.
    Raises InputError if the file does not exist, is not YAML, or does not match its schema.
    """
    loaded = read_yaml(path, kind)
    checked = check_config(loaded, kind, str(path))
    return checked if with_defaults else dict(loaded)


def check_config(loaded: object, kind: str, where: str) -> dict[str, Any]:
    """Check a loaded configuration against its schema and fill in the defaults.

    where : name of the file for messages. Raises InputError if the configuration does not match.
    """
    import jsonschema  # slow to import

    if not isinstance(loaded, dict):
        kinds = {type(None): "nothing", str: "a text", list: "a list"}
        what = kinds.get(type(loaded), "a value")
        raise InputError(f"{where}: contains {what} instead of keys; expected a {kind} file (`key: value`)")
    if fault := next(_odd_values(loaded), ""):
        raise InputError(f"{where}: {fault}")
    schema = json_schema(kind)
    errors = jsonschema.Draft202012Validator(schema).iter_errors(loaded)
    if (error := jsonschema.exceptions.best_match(errors)) is not None:
        raise InputError(f"{where}: {_sentence(error)}")
    filled: dict[str, Any] = _with_defaults(loaded, schema, schema)
    return filled


def shipped_names(kind: str) -> list[str]:
    """Return the names of the layouts or models that ship with the program; `kind` is layout or model."""
    return sorted(path.stem for path in (CONFIG_FOLDER / f"{kind}s").glob("*.yaml"))


def config_path(name: str, kind: str, folder: Path, where: str = "") -> Path:
    """Find the file of a layout or model by the name of one that ships, or by a path relative to `folder`.

    where : start of the message, such as the study file and a colon, if the name stands in a file. Raises
    InputError with a list of those that ship if there is neither.
    """
    if (kind, name) == ("model", REFERENCE):
        return CONFIG_FOLDER / "references" / f"{name}.yaml"
    if name in shipped_names(kind):
        return CONFIG_FOLDER / f"{kind}s" / f"{name}.yaml"
    path = folder / name
    if os.path.isfile(path):  # noqa: PTH113 -- also False, not an error, for an impossible file name
        return path
    near = nearest(name, shipped_names(kind)) or slash_hint(name)
    raise InputError(
        f"{where}{kind} {shorten(name, 60)!r} is neither a {kind} that ships "
        f"({', '.join(shipped_names(kind))}) nor a file in {folder}{near}"
    )


_IN_WORDS = {
    "^[A-Za-z0-9][A-Za-z0-9._-]*$": "a name of letters A to Z, digits, '.', '_' and '-' that begins with a "
    "letter or a digit",
    "^[a-z][a-z0-9_]*$": "a name of small letters, digits and '_' that begins with a letter",
    r"^(text|bool|int8|int64|double)(\[[0-9]+\])?$": "text, bool, int8, int64, double or double[6]",
    "^[XYZ]{3}$": "three of the letters X, Y and Z",
    "object": "a group, lines of `key: value`",
    "array": "a list",
    "string": "a text",
    "number": "a number",
    "integer": "a whole number",
    "boolean": "true or false",
    "null": "nothing",
    **dict.fromkeys(("minimum", "minItems", "minProperties", "minLength"), "at least"),
    **dict.fromkeys(("maximum", "maxItems", "maxLength"), "at most"),
    "exclusiveMinimum": "more than",
}
"""Descriptions, for messages, of the patterns, types and bounds in the schemas."""


def _sentence(error: Any) -> str:
    """Describe an error that jsonschema found: the key, its value, and what was expected."""
    path, instance, rule, value = error.absolute_path, error.instance, error.validator, error.validator_value
    text = repr(instance) if isinstance(instance, str) else json.dumps(instance, default=str)
    actual = "is empty" if instance is None else f"is {shorten(text, 100)}"
    if rule == "additionalProperties":
        keys = list(error.schema.get("properties", {}))
        unknown = set(instance) - set(keys)
        odd = sorted(key if isinstance(key, str) else json.dumps(key, default=str) for key in unknown)
        fault = f"unknown key {', '.join(map(repr, odd))}; known are {', '.join(keys)}{nearest(odd[0], keys)}"
    elif rule == "required":
        fault = f"the key {', '.join(repr(key) for key in value if key not in instance)} is missing"
    elif rule == "enum":
        fault = f"{actual}; expected one of {', '.join(map(str, value))}"
    elif rule == "type":
        kinds = [value] if isinstance(value, str) else value
        fault = f"{actual}; expected {' or '.join(_IN_WORDS[kind] for kind in kinds)}"
    elif rule == "pattern":
        fault = f"{actual}; expected {_IN_WORDS.get(value, value)}"
    elif rule in _IN_WORDS:
        size = f"has {len(instance)}" if isinstance(instance, str | list | dict) else actual
        letters = " letters" if isinstance(instance, str) else ""
        meaning = error.schema.get("description") if isinstance(instance, list | dict) else None
        bound = f"{size}{letters}; expected {_IN_WORDS[rule]} {value}"
        fault = ": ".join(filter(None, (bound, meaning)))
    elif rule == "uniqueItems":
        fault = f"{actual}, which has an entry twice"
    else:
        fault = shorten(error.message, 200)
    return ": ".join(filter(None, (".".join(map(str, path)), fault)))


def _odd_values(value: Any, where: str = "") -> Iterator[str]:
    """Describe values that JSON Schema cannot refuse: .nan, .inf, huge numbers and control characters."""
    if isinstance(value, float) and not math.isfinite(value):
        yield f"{where}: is {value}; expected a finite number"
    if isinstance(value, int) and abs(value) > limits.LARGEST_WHOLE:
        yield f"{where}: is a number of more than {len(str(limits.LARGEST_WHOLE)) - 1} digits"
    if isinstance(value, str) and any(ord(c) < 32 and c not in "\n\t" for c in value):
        yield f"{where}: contains a control character"
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        yield from _odd_values(part, f"{where}.{key}" if where else str(key))


def _with_defaults(value: Any, schema: dict[str, Any], root: dict[str, Any]) -> Any:
    if "$ref" in schema:
        schema = {**root["$defs"][schema["$ref"].rsplit("/", 1)[-1]], **schema}
    if not isinstance(value, dict):
        return value
    properties: dict[str, Any] = schema.get("properties", {})
    filled = {key: part["default"] for key, part in properties.items() if "default" in part} | value
    others = schema.get("additionalProperties") or {}
    return {key: _with_defaults(part, properties.get(key, others), root) for key, part in filled.items()}
