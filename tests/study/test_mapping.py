"""Mappings: the guide's examples are valid, and contradictions are refused with their key."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from small_study import put

from shukotsu.errors import InputError
from shukotsu.study.mapping import FileMapping, mapping_from_config, read_mapping

PAGE = Path(__file__).resolve().parents[2] / "docs" / "mappings.md"
EXAMPLES = re.findall(r"```yaml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)

WIDE: dict[str, Any] = {
    "format": "csv",
    "position_unit": "cm",
    "orientation": {"kind": "quaternion", "order": "wxyz"},
    "receivers": {"hand": {"position": ["x", "y", "z"], "orientation": ["w", "a", "b", "c"]}},
    "csv": {},
}
LONG: dict[str, Any] = {
    "format": "csv",
    "position_unit": "cm",
    "orientation": {"kind": "euler", "axes": "ZYX", "unit": "deg"},
    "receivers": {"hand": {"value": 1}},
    "csv": {"rows": "long", "receiver": "r", "position": ["x", "y", "z"], "orientation": ["a", "b", "c"]},
}
C3D: dict[str, Any] = {
    "format": "c3d",
    "position_unit": "m",
    "receivers": {"hand": {"markers": ["A", "B", "C"]}},
}


@pytest.mark.parametrize("text", EXAMPLES, ids=lambda text: text.splitlines()[0])
def test_the_guides_mappings_are_valid(tmp_path: Path, text: str) -> None:
    (tmp_path / "mapping.yaml").write_text(text, "utf-8")
    mapping = read_mapping(tmp_path / "mapping.yaml")
    assert mapping.format == yaml.safe_load(text)["format"]


def check(config: dict[str, Any]) -> FileMapping:
    return mapping_from_config(config, "mapping.yaml")


@pytest.mark.parametrize("config", [WIDE, LONG, C3D])
def test_defaults_are_filled_in_and_units_converted_to_mm(config: dict[str, Any]) -> None:
    mapping = check(config)
    assert mapping.mm_per_unit == {"cm": 10, "m": 1000, "mm": 1}[config["position_unit"]]
    assert mapping.fixed == ()
    if mapping.orientation is not None:
        assert mapping.orientation["rotates"] == "receiver-to-transmitter"
    assert check({**C3D, "position_unit": "inch"}).mm_per_unit == 25.4


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (put(put(WIDE, "rate_hz", "CHECK"), "orientation.order", "CHECK"),
         "orientation.order, rate_hz still say CHECK: put the truth there"),
        (put(WIDE, "position_unit", "miles"), "position_unit: is 'miles'; expected one of"),
        (put(C3D, "receivers.hand.markers", ["CHECK", "CHECK2", "CHECK3"]),
         "mapping.yaml: receivers.hand.markers still says CHECK: put the truth there"),
        (put(C3D, "receivers.hand.markers", ["GloveR1", "GloveR2"]),
         "receivers.hand.markers: has 2; expected 3 or more of a rigid cluster"),
        (put(LONG, "csv.position", ["x", "y"]),
         "csv.position: has 2; expected at least 3: long: columns"),
        (put(WIDE, "receivers.hand.orientation", ["a"]),
         "receivers.hand.orientation: has 1; expected at least 3: csv with one row per frame"),
        (put(C3D, "receivers.Right-Hand", {}),
         "receivers: 'Right-Hand' is not a valid segment name; names are lower case letters, digits and "
         "underscores; did you mean 'right_hand'?"),
        (put(WIDE, "position_axes", ["x", "-x", "z"]),
         "position_axes: is x, -x, z; expected each of x, y and z once"),
        (put(C3D, "position_axes", ["x", "z", "-y"]),
         "position_axes: a C3D file has positions and rotations in one frame; leave it out"),
        (put(WIDE, "position_unit", None), "the key 'position_unit' is missing"),
        (put(WIDE, "orientation", None),
         "the key 'orientation' is missing: state how the file represents"),
        (put(WIDE, "orientation.order", None), "orientation: quaternion needs the key 'order'"),
        (put(WIDE, "orientation.axes", "ZYX"), "orientation.axes: does not belong to quaternion"),
        (put(LONG, "orientation.axes", "ZZX"), "orientation.axes: ZZX rotates twice in a row about"),
        (put(WIDE, "receivers.hand.position", None), "receivers.hand: the key 'position' is missing"),
        (put(WIDE, "receivers.hand.orientation", ["a", "b", "c"]),
         "receivers.hand.orientation: has 3 columns; quaternion means 4"),
        (put(WIDE, "receivers.hand.markers", ["a", "b", "c"]),
         "receivers.hand.markers: does not belong to csv with"),
        (put(WIDE, "csv.receiver", "r"), "csv.receiver: is for long rows"),
        (put(WIDE, "csv.quality", "q"), "csv.quality: is for long rows"),
        (put(WIDE, "csv.time", "t"), "csv.time: needs csv.time_unit"),
        (put(WIDE, "csv.time_unit", "s"), "csv.time_unit: no time column is named"),
        (put(WIDE, "receivers.hand.quality", "q"), "receivers.hand.quality: needs csv.quality_above or"),
        (put(WIDE, "csv.quality_above", 3), "csv.quality_above: no quality column is named"),
        (put(WIDE, "csv.decimal", ","), "csv.decimal: the comma cannot both"),
        (put(WIDE, "csv.header", False),
         "receivers.hand.position: 'x' is a name; without a header give numbers"),
        (put(WIDE, "csv.in_step", False), "csv.in_step: receivers that are not in step need a time column"),
        (put(WIDE, "fixed", ["hand"]), "fixed: hand has a receiver too"),
        (put(WIDE, "xdf", {}), "xdf: is for another format"),
        (put(LONG, "csv.receiver", None), "csv: long rows need the key 'receiver'"),
        (put(LONG, "receivers.hand.value", None), "receivers.hand: the key 'value' is missing"),
        (put(LONG, "receivers.wrist", {"value": "1"}), "hand and wrist both have value"),
        (put(LONG, "csv.orientation", list("abcd")), "csv.orientation: has 4 columns; euler means 3"),
        (put(C3D, "orientation", {"kind": "matrix"}), "orientation: a C3D file needs none"),
        (put(C3D, "receivers.hand.rotation", "hand"), "receivers.hand: needs either 'markers' or 'rotation'"),
        (put(C3D, "receivers.hand.markers", None), "receivers.hand: needs either 'markers' or 'rotation'"),
        (put(C3D, "receivers.hand.markers", list("ABA")), "receivers.hand.markers: 'A' is named twice"),
        (put(C3D, "receivers.CHECK_1", {}), "receivers.CHECK_1 still says CHECK"),
        (put(C3D, "c3d.first_frame", 0), "c3d.first_frame: is 0; expected at least 1"),
    ],
)  # fmt: skip
def test_contradictory_keys_of_a_mapping_are_refused(config: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        check(config)
    assert str(caught.value).startswith("mapping.yaml: ")
    assert "\n" not in str(caught.value)
