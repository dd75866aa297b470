"""The plane: known centres to 1e-6 mm, one slide for both halves, five and six values alike."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import chain_layout, moments_of, random_chain
from chains import gap_rms_mm as gap_by_hand
from hypothesis import given, settings
from hypothesis import strategies as st

from schemas.catalogue import JOINT_SOLUTIONS
from schemas.errors import InputError
from schemas.layout import FINGER_MM, Joint, Plane
from schemas.model import read_model
from schemas.parts import Part, parts_writer
from schemas.tables import Provenance
from schemas.verdict import NO, doubts_of, judged_joint
from skeleton.rotations import unit
from stages.project_planes.__main__ import main
from stages.project_planes.place import place_joint
from stages.project_planes.plane import Projection, centre_sd_mm, project
from stages.solve_joints.closed import JointSolution, solve_closed
from stages.solve_joints.solution_rows import solution_row

SEEDS = st.integers(0, 2**32 - 1)
LAYOUT = chain_layout(random_chain(0, 2))
SAGITTAL = np.array([0.0, 1.0, 0.0])


def cut(found: JointSolution, *, parent: bool = False, normal: np.ndarray = SAGITTAL) -> Projection | None:
    return project(
        found.p_mm,
        found.q_mm,
        found.null_parent,
        found.null_child,
        found.covariance_mm2,
        np.radians(found.axis_sd_deg),
        plane_point_mm=np.zeros(3),
        plane_normal=normal,
        plane_in_parent=parent,
    )


@given(SEEDS)
@settings(max_examples=30)
def test_exact_hinges_end_at_their_centres(seed: int) -> None:
    """Hinges, exact planes, no noise: both halves to 1e-6 mm."""
    chain = random_chain(seed, 4)
    moments = moments_of(chain)
    for j in range(3):
        found = cut(solve_closed(moments, j, 5))
        assert found is not None
        np.testing.assert_allclose(found.p_mm, chain.p_mm[j], atol=1e-6)
        np.testing.assert_allclose(found.q_mm, chain.q_mm[j], atol=1e-6)


@given(SEEDS, st.booleans())
@settings(max_examples=30)
def test_five_and_six_values_end_in_the_same_point(seed: int, parent: bool) -> None:
    """With noise and joints that are no hinges: the two solutions differ along the axis alone."""
    chain = random_chain(seed, 2, off_axis_rad=0.1, noise_mm=0.2, in_plane=False)
    moments = moments_of(chain)
    five, six = (cut(solve_closed(moments, 0, values), parent=parent) for values in (5, 6))
    assert five is not None
    assert six is not None
    np.testing.assert_allclose(five.p_mm, six.p_mm, atol=1e-7)
    np.testing.assert_allclose(five.q_mm, six.q_mm, atol=1e-7)


@given(SEEDS)
@settings(max_examples=30)
def test_both_halves_slide_alike(seed: int) -> None:
    """The plane in one frame is met there, and p and q move by the same multiple of the null vector."""
    chain = random_chain(seed, 2, off_axis_rad=0.1, in_plane=False)
    found = solve_closed(moments_of(chain), 0, 5)
    at = cut(found)
    assert at is not None
    assert at.q_mm[1] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(at.p_mm - found.p_mm, at.slide_mm * found.null_parent, atol=1e-9)
    np.testing.assert_allclose(at.q_mm - found.q_mm, at.slide_mm * found.null_child, atol=1e-9)


def test_a_parallel_axis_has_no_centre() -> None:
    """An axis in the plane never meets it; one close to it is told by its angle."""
    chain = random_chain(2, 2)
    found = solve_closed(moments_of(chain), 0, 5)
    across = np.cross(found.null_child, [0.3, 0.1, 0.9])
    assert cut(found, normal=across) is None
    five = np.radians(5)
    near = cut(found, normal=np.cos(five) * unit(across) + np.sin(five) * found.null_child)
    assert near is not None
    assert near.axis_plane_deg == pytest.approx(5, abs=1e-6)


def solved_row(seed: int, **options: float) -> tuple[Joint, dict[str, object], object]:
    chain = random_chain(seed, 2, 300, in_plane=False, **options)
    found = solve_closed(moments_of(chain), 0, 5)
    return chain.joints[0], solution_row(chain.joints[0], found), chain


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("shift", [None, np.array([3.0, -2.0, 5.0])])
def test_gap_of_the_placed_centre(seed: int, shift: np.ndarray | None) -> None:
    """gap_rms_mm after plane and correction is the gap measured frame by frame."""
    joint, row, chain = solved_row(seed, off_axis_rad=0.1, noise_mm=0.2)
    placed = place_joint(joint, LAYOUT, row, read_model("paper-fig4-corrected"), shift)
    p = np.array([placed[f"parent_{axis}_mm"] for axis in "xyz"])
    q = np.array([placed[f"child_{axis}_mm"] for axis in "xyz"])
    assert placed["gap_rms_mm"] == pytest.approx(gap_by_hand(chain.poses, 0, p, q), rel=1e-6)
    assert placed["gap_rms_free_mm"] <= placed["gap_rms_mm"] + 1e-9
    if shift is not None:
        assert placed["correction_mm"] == pytest.approx(np.linalg.norm(shift))
        plain = place_joint(joint, LAYOUT, row, read_model("paper-fig4"), None)
        moved = q - [plain[f"child_{axis}_mm"] for axis in "xyz"]
        np.testing.assert_allclose(moved, shift, atol=1e-12)


def test_what_speaks_against_a_centre_is_noted() -> None:
    """Little motion, an axis near the plane and an uncertain axis are each named; a good one: its error."""
    model = read_model("paper-fig4")
    joint, row, _ = solved_row(1)
    assert [*doubts_of(judged_joint(place_joint(joint, LAYOUT, row, model, None), FINGER_MM))] == [
        "uncertain"
    ]
    joint, row, _ = solved_row(1, range_rad=0.02, off_axis_rad=0.01)
    weak = judged_joint(place_joint(joint, LAYOUT, row, model, None), FINGER_MM)
    assert weak["status"] == "weak"
    assert {"moved-too-little", "axis-uncertain"} < {*doubts_of(weak)}
    joint, row, _ = solved_row(1)
    axis = np.array([row[f"null_child_{k}"] for k in "xyz"])
    slanted = Plane("child", (0.0, 0.0, 0.0), tuple(np.cross(axis, [1, 2, 3]) + 0.3 * axis))
    near = place_joint(replace(joint, plane=slanted), LAYOUT, row, model, None)
    assert "axis-near-plane" in doubts_of(near)


def test_a_failed_joint_stays_failed() -> None:
    joint, _, _ = solved_row(1)
    failed = solution_row(joint, "the joint did not move")
    placed = place_joint(joint, LAYOUT, failed, read_model("paper-fig4"), None)
    assert placed["status"] == "failed"
    assert placed["message"] == "the joint did not move"
    assert "child_x_mm" not in placed


def test_sd_predicts_the_scatter_of_placed_centres() -> None:
    """Over 200 repetitions with white noise, the placed centre scatters by what sd_mm says."""
    chain = random_chain(3, 2, 400, range_rad=0.5)
    centres, stated = [], []
    for seed in range(200):
        noise = np.random.default_rng(seed).normal(size=chain.poses.position_mm.shape) * 0.5
        poses = replace(chain.poses, position_mm=chain.poses.position_mm + noise)
        at = cut(solve_closed(moments_of(chain, poses), 0, 5))
        assert at is not None
        centres.append(np.concatenate([at.p_mm, at.q_mm]))
        stated.append(centre_sd_mm(at.covariance_mm2))
    scatter = np.sqrt(max(np.var(centres, 0)[:3].sum(), np.var(centres, 0)[3:].sum()))
    assert np.mean(stated) == pytest.approx(scatter, rel=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_a_joint_without_a_plane_is_the_six_unknown_fit(seed: int) -> None:
    """With frame none the centre is that of solve_closed with six values, its gap the smallest there is."""
    chain = random_chain(seed, 2, 300, off_axis_rad=0.3, noise_mm=0.2, in_plane=False)
    moments = moments_of(chain)
    joint = replace(chain.joints[0], plane=Plane("none", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    placed = place_joint(
        joint, LAYOUT, solution_row(joint, solve_closed(moments, 0, 5)), read_model("paper-fig4"), None
    )
    six = solve_closed(moments, 0, 6)
    np.testing.assert_allclose([placed[f"child_{k}_mm"] for k in "xyz"], six.q_mm, atol=1e-8)
    np.testing.assert_allclose([placed[f"parent_{k}_mm"] for k in "xyz"], six.p_mm, atol=1e-8)
    assert placed["gap_rms_mm"] == pytest.approx(six.gap_rms_mm, rel=1e-9)
    assert placed["axis_plane_deg"] is None
    assert placed["dof"] == 3
    assert np.linalg.norm(six.q_mm - chain.q_mm[0]) < 4 * placed["sd_mm"] + 0.5


def test_a_hinge_without_a_plane_is_open_along_its_axis() -> None:
    """Its frames place it across the axis; the doubt says where they do not."""
    chain = random_chain(1, 2, 300, noise_mm=0.2)
    joint = replace(chain.joints[0], plane=Plane("none", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    row = solution_row(joint, solve_closed(moments_of(chain), 0, 5))
    placed = place_joint(joint, LAYOUT, row, read_model("paper-fig4"), None)
    assert "uncertain-in-one-direction" in doubts_of(judged_joint(placed, FINGER_MM))


def test_receivers_that_disagree_are_told() -> None:
    """A gap that no skin makes (here a wrong quaternion order) is named."""
    chain = random_chain(1, 2, 300)
    swapped = replace(chain.poses, quaternion=np.roll(chain.poses.quaternion, -1, -1))
    joint = chain.joints[0]
    found = solve_closed(moments_of(chain, swapped), 0, 5)
    placed = place_joint(joint, LAYOUT, solution_row(joint, found), read_model("paper-fig4"), None)
    assert judged_joint(placed, FINGER_MM)["verdict"] == NO
    assert "halves-disagree" in doubts_of(judged_joint(placed, FINGER_MM))


def test_joints_of_another_layout_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A hand's joints with the arm's layout: one sentence, exit code 2, nothing written."""
    _, row, _ = solved_row(1)
    with parts_writer(tmp_path / "joints.parquet", JOINT_SOLUTIONS, Provenance()) as writer:
        writer.rows(Part("right", "rigid", "", "01"), [{**row, "joint": "thumb_cmc"}])
    words = ["--joints", str(tmp_path / "joints.parquet"), "--layout", "arm", "--model", "rigid"]
    assert main([*words, "--out", str(tmp_path / "out.parquet")]) == 2
    assert "joint thumb_cmc is not in layout arm" in capsys.readouterr().err
    assert not (tmp_path / "out.parquet").exists()


# --- models whose planes cut nothing: the centre of the joint solve is final -------------------------------


@pytest.mark.parametrize("doubts", [{}, {"placed-by-anatomy": {"range_deg": 3.0}}])
def test_a_final_centre_is_kept(doubts: dict[str, dict[str, float]]) -> None:
    chain = random_chain(3, 2, off_axis_rad=0.2, noise_mm=0.3, in_plane=False)
    row = solution_row(chain.joints[0], replace(solve_closed(moments_of(chain), 0, 6), doubts=doubts))
    placed = place_joint(chain.joints[0], LAYOUT, row, read_model("anatomical"), None)
    for half in ("parent", "child"):
        for axis in "xyz":
            assert placed[f"{half}_{axis}_mm"] == row[f"{half}_{axis}_mm"]
    assert placed["gap_rms_mm"] == row["gap_rms_mm"]
    assert placed["slide_mm"] == 0
    assert placed["axis_plane_deg"] is None
    assert placed["sd_mm"] == centre_sd_mm(np.reshape(row["covariance_mm2"], (6, 6)))
    assert (placed["status"], doubts_of(placed)) == ("ok", doubts)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("joints: {solver: anatomical}", "planes.cut: is true; the solver anatomical gives final centres"),
        ("planes: {cut: false, corrections: true}", "planes.corrections: is true, but planes.cut: false"),
    ],
)
def test_a_model_that_contradicts_itself_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    (tmp_path / "mine.yaml").write_text(f"model: mine\ndescription: Mine.\n{text}\n")
    with pytest.raises(InputError, match=reason):
        read_model("mine.yaml", tmp_path)
