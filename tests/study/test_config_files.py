"""Configuration files: refusals of mistakes, defaults, and the dialect of YAML."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from shukotsu.errors import InputError
from shukotsu.study import config_files

MODEL = "model: mine\ndescription: A test.\n"


def read(tmp_path: Path, text: str, kind: str = "model") -> dict[str, Any]:
    path = tmp_path / "mine.yaml"
    path.write_text(text, "utf-8")
    return config_files.read_config(path, kind)


def test_defaults_are_filled_in_at_every_level(tmp_path: Path) -> None:
    config = read(tmp_path, MODEL + "joints: {singular_values: 6}\n")
    assert config["joints"] == {"solver": "closed", "singular_values": 6, "calibration": "evaluated"}
    assert config["planes"] == {"cut": True, "parallel_limit_deg": 20, "corrections": False}
    assert config["metacarpals"]["rest_direction"] == [1, 0, 0]
    assert "paper_table" not in config


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("joint: {}", "unknown key 'joint'; known are model, .*; did you mean 'joints'"),
        ("joints: {slover: closed}", "joints: unknown key 'slover'; .*; did you mean 'solver'"),
        ("~: 1", "unknown key 'null'; known are model"),
        ("joints: {singular_values: 7}", r"joints\.singular_values: is 7; expected one of 5, 6$"),
        ("planes: {corrections: 1}", r"planes\.corrections: is 1; expected true or false$"),
        ("planes: {parallel_limit_deg: 91}", r"planes\.parallel_limit_deg: is 91; expected at most 90$"),
        ("planes: {parallel_limit_deg: .nan}", r"planes\.parallel_limit_deg: is nan; expected a finite"),
        ("metacarpals: {rest_direction: [1, -.inf, 0]}", r"rest_direction\.1: is -inf; expected a finite"),
        ("metacarpals: {rest_direction: [1, 0]}", r"metacarpals\.rest_direction: has 2; expected at least 3"),
        ("planes:", "planes: is empty; expected a group, lines of `key: value`$"),
        ("own_cmc: [a, a]", r'own_cmc: is \["a", "a"\], which has an entry twice$'),
        ("description: again", "not valid YAML: the key 'description' is given twice .*line 3"),
        ("joints: {solver: closed, solver: closed}", "the key 'solver' is given twice"),
        ("? [a, b]\n: 1", r"not valid YAML: \['a', 'b'\] cannot be a key"),
        ("paper_table: 2020-13-45", "paper_table: is '2020-13-45'; expected"),
        ("joints: [", "not valid YAML: "),
        ("wrist: !!python/name:os.system", "not valid YAML: could not determine a constructor"),
    ],
)
def test_a_mistake_in_a_file_is_refused_with_its_key(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, MODEL + text)
    assert str(caught.value).startswith(f"{tmp_path / 'mine.yaml'}: ")
    assert "\n" not in str(caught.value)


def test_a_layout_is_found_by_shipped_name_or_path(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").touch()
    assert config_files.config_path("mine.yaml", "layout", tmp_path) == tmp_path / "mine.yaml"
    assert config_files.config_path("arm", "layout", tmp_path).is_file()
    assert "liberty16" in config_files.shipped_names("layout")
    with pytest.raises(InputError, match=r"nor a file in .*; folders are separated by / and not by \\"):
        config_files.config_path("data\\arm.yaml", "layout", tmp_path)
    with pytest.raises(InputError, match=r"layout 'libery16' is neither .*did you mean 'liberty16'\?"):
        config_files.config_path("libery16", "layout", tmp_path)


def _properties(schema: Any) -> list[tuple[str, dict[str, Any]]]:
    if not isinstance(schema, dict | list):
        return []
    parts = schema if isinstance(schema, list) else [*schema.values()]
    named = [] if isinstance(schema, list) else [*schema.get("properties", {}).items()]
    return named + [pair for part in parts for pair in _properties(part)]


@pytest.mark.parametrize("kind", ["study", "layout", "model", "mapping"])
def test_schemas_describe_every_key_and_forbid_others(kind: str) -> None:
    schema = config_files.json_schema(kind)
    assert schema["additionalProperties"] is False
    for name, part in _properties(schema):
        assert part.get("description", "").endswith("."), name
        assert part.get("type") != "object" or "additionalProperties" in part, name


TEXTS = ("1:30", "no", "On", "y", "1_000", "0b11", "2020-01-01", "190:20:30.15")
VALUES = {"012": 12, "0o17": 15, "0x1F": 31, "1e3": 1000.0, "-.5": -0.5, "+12": 12, "1.": 1.0}
WORDS = {"~": None, "": None, "null": None, "true": True, "False": False, "'12'": "12", "!!str 12": "12"}
TWO_VERSIONS = {**dict(zip(TEXTS, TEXTS, strict=True)), **VALUES, **WORDS}


def test_yaml_is_read_as_1_2_and_written_for_1_1_and_1_2() -> None:
    """A text that we write is the same text to a reader of YAML 1.1."""
    for text, value in TWO_VERSIONS.items():
        loaded = config_files.loaded_yaml(f"key: {text}", "a.yaml")["key"]
        assert (loaded, type(loaded)) == (value, type(value)), text
        assert config_files.loaded_yaml(config_files.yaml_text({"key": value}), "a.yaml") == {"key": value}
        assert yaml.safe_load(config_files.yaml_text({"key": value})) == {"key": value}
    for text in TWO_VERSIONS:
        assert (
            config_files.loaded_yaml(config_files.yaml_text([text]), "")
            == yaml.safe_load(config_files.yaml_text([text]))
            == [text]
        )


@dataclass(frozen=True)
class Numbers:
    """A class of constants: two are looked up, one of them in degrees, and one is computed."""

    LENGTH_MM: float
    TURN_RAD: float
    SHARE: float


def test_constants_and_the_fields_of_their_class_must_agree() -> None:
    def read(**numbers: float) -> Numbers:
        return config_files.constants(Numbers, Path("hand.yaml"), numbers, "BONES|SHARE_.*", SHARE=0.5)

    assert read(LENGTH_MM=1.0, TURN_DEG=90.0, BONES=2.0, SHARE_IN_3=3.0) == Numbers(1.0, math.pi / 2, 0.5)
    assert read(LENGTH_MM=1.0, TURN_RAD=3.0) == Numbers(1.0, 3.0, 0.5)
    where = f"class Numbers in {__name__}"
    for numbers, message in (
        ({"TURN_DEG": 1.0}, f"LENGTH_MM of {where} is missing; add an entry LENGTH_MM"),
        ({"LENGTH_DEG": 1.0, "TURN_DEG": 1.0}, f"LENGTH_MM of {where} is missing; add an entry LENGTH_MM"),
        ({"LENGTH_MM": 1.0}, f"TURN_RAD of {where} is missing; add an entry TURN_DEG"),
        ({"LENGTH_MM": 1.0, "TURN_DEG": 1.0, "X": 1.0}, f"X is not in {where}; add a field X there"),
    ):
        with pytest.raises(InputError) as refused:
            read(**numbers)
        assert refused.value.message == f"hand.yaml: {message}"
