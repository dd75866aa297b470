"""Layouts: the shipped ones are as documented, and contradictions are refused."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from small_study import put

from shukotsu.errors import InputError
from shukotsu.study.config_files import shipped_names
from shukotsu.study.layout import Layout, read_layout

FINGER: dict[str, Any] = {
    "layout": "finger",
    "description": "A hand with one finger.",
    "segments": {"hand": {"receiver": 1}, "metacarpal": {"measured": False}, "tip": {"receiver": 2}},
    "joints": {
        "cmc": {"parent": "hand", "child": "metacarpal"},
        "mcp": {"parent": "metacarpal", "child": "tip", "dof": 2},
    },
    "digits": {"finger": {"segments": ["metacarpal", "tip"], "metacarpal": True}},
    "wrist": {"joint": "cmc", "nominal_mm": [-35, 0, -14]},
}


def read(tmp_path: Path, config: dict[str, Any]) -> Layout:
    (tmp_path / "finger.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    return read_layout("finger.yaml", tmp_path)


def test_smaller_layouts_are_the_same_hand_with_fewer_receivers() -> None:
    hand = read_layout("liberty16")
    tips = {"hand", *(digit.tip for digit in hand.digits.values())}
    for name, worn in (("tips-and-hand", tips), ("two-hands-7", tips | {"thumb_metacarpal"})):
        layout = read_layout(name)
        assert layout.matches(hand)
        assert hand.matches(layout)
        assert set(layout.expected) == worn
        assert {layout.segments[s].receiver for s in worn} == set(range(1, len(worn) + 1))
    both = read_layout("two-hands-7")
    assert both.of_hand("right") == both
    assert {both.of_hand("left").segments[s].receiver for s in both.expected} == set(range(8, 15))
    assert not read_layout("arm").matches(hand)


def test_liberty16_has_the_joints_and_digits_of_a_hand() -> None:
    layout = read_layout("liberty16")
    assert [layout.segments[s].receiver for s in layout.measured] == list(range(1, 18))
    assert [s for s in layout.measured if layout.segments[s].optional] == ["forearm"]
    assert list(layout.digits) == ["thumb", "index", "middle", "ring", "little"]
    assert len(layout.joints) == 20
    index = layout.digits["index"]
    assert (index.base, index.tip, index.metacarpal) == ("hand", "index_distal", True)
    assert index.joints == ("index_cmc", "index_mcp", "index_pip", "index_dip")
    assert layout.joints["index_mcp"].parent_receiver == "hand"
    assert "index_cmc" not in {joint.name for joint in layout.solvable}
    assert layout.wrist is not None
    assert (layout.wrist.joint, layout.wrist.segment) == ("wrist", "hand")


def test_a_plane_is_the_childs_sagittal_one_by_default(tmp_path: Path) -> None:
    plane = read(tmp_path, FINGER).joints["mcp"].plane
    assert (plane.frame, plane.point_mm, plane.normal) == ("child", (0, 0, 0), (0, 1, 0))
    config = put(FINGER, "joints.mcp.plane", {"frame": "parent", "point_mm": [1, 2, 3]})
    config["segments"]["hand"]["receiver_axes"] = {"lateral": [0, 0, 1], "dorsal": [0, -1, 0]}
    plane = read(tmp_path, config).joints["mcp"].plane
    assert (plane.frame, plane.point_mm, plane.normal) == ("parent", (1, 2, 3), (0, 0, 1))


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("segments.tip.receiver", 1, "segments hand and tip both name receiver 1"),
        ("segments.tip.left_receiver", 1, "segments hand and tip both name receiver 1"),
        ("segments.tip.reciever", 1, r"segments\.tip: unknown key 'reciever'; .*did you mean 'receiver'"),
        ("segments.Tip", {}, "segments: is 'Tip'; expected a name of small letters"),
        ("receiver_axes", {"distal": [0, 1, 0]}, "segments.hand: .*distal and lateral are not"),
        ("receiver_axes", {"distal": [1, 0]}, "receiver_axes.distal: has 2; expected at least 3"),
        ("receiver_axes", {"distal": [2, 0, 0]}, "unit vectors at right angles; distal has length 2"),
        ("segments.tip.receiver_axes", {"dorsal": [1, 0, 0]}, "segments.tip: .*distal and dorsal are not"),
        ("joints.mcp.child", "tap", "joints.mcp.child: no segment is called 'tap'"),
        ("joints.cmc.parent", "arm", "joints.cmc.parent: no segment is called 'arm'"),
        ("joints.more", {"parent": "hand", "child": "tip"}, "joints.more: segment tip has two parents"),
        ("joints.more", {"parent": "tip", "child": "hand"}, "segment [a-z]+ is among its own parents"),
        ("joints.mcp.dof", 4, "joints.mcp.dof: is 4; expected at most 3"),
        ("joints.mcp.plane", {"normal": [0, 0, 0]}, r"joints\.mcp\.plane\.normal: has no length"),
        ("segments.hand", {"measured": False}, "joints.cmc: no segment above metacarpal carries a receiver"),
        ("digits.finger.segments", ["hand", "tip"], "digits.finger: no joint has 'hand' as its child"),
        ("digits.finger.segments", ["tip", "metacarpal"], "metacarpal does not hang from tip"),
        ("digits.finger.segments", ["metacarpal"], "digits.finger: a metacarpal needs a phalanx after it"),
        ("digits.finger.metacarpal", False, "metacarpal carries no receiver, so metacarpal must be true"),
        ("segments.tip", {"measured": False}, "digits.finger: tip carries no receiver; only the first may"),
        ("wrist.joint", "wrist", "wrist.joint: no joint is called 'wrist'"),
        ("wrist", None, "a digit starts with an unmeasured segment, so the layout needs a wrist"),
        ("digits", None, "the key 'digits' is missing"),
    ],
)
def test_a_contradiction_in_a_layout_is_refused(tmp_path: Path, path: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(tmp_path, put(FINGER, path, value))
    assert str(caught.value).startswith(str(tmp_path / "finger.yaml"))


def test_the_wanted_error_of_a_joint_depends_on_the_limb(tmp_path: Path) -> None:
    """A hand is recognised by its wrist or the names of its fingers; a layout may set any value."""
    wanted_mm = {name: read_layout(name).wanted_mm for name in shipped_names("layout")}
    assert wanted_mm.pop("arm") == 10.0
    assert {*wanted_mm.values()} == {2.0}
    assert read(tmp_path, FINGER).wanted_mm == 2.0
    assert read(tmp_path, FINGER | {"wanted_mm": 0.5}).wanted_mm == 0.5
    knee = {name: FINGER[name] for name in ("layout", "description")}
    knee |= {
        "segments": {"thigh": {}, "shank": {}},
        "joints": {"knee": {"parent": "thigh", "child": "shank"}},
    }
    assert read(tmp_path, knee | {"digits": {"leg": {"segments": ["shank"]}}}).wanted_mm == 10.0
    assert read(tmp_path, knee | {"digits": {"index": {"segments": ["shank"]}}}).wanted_mm == 2.0
