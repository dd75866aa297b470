"""The whole pipeline recovers a simulated hand exactly if it fulfils all assumptions of the paper.

The simulator and the estimator share no code except quaternions. If one assumption is dropped, the error that
appears is due to it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from small_study import HandResults, Row, import_recording, run_hand

from shukotsu.hand.rotations import Array, angle, conjugate, multiply
from shukotsu.simulate.random_hand import BONES
from shukotsu.simulate.realism import Realism
from shukotsu.simulate.recording import write_recording
from shukotsu.simulate.simulation import Simulated, simulate
from shukotsu.tables.catalogue import METACARPALS
from shukotsu.tables.poses import RecordingName
from shukotsu.tables.typed_table import column_array, read_table

N_FRAMES = 400
FINGERS = ("index", "middle", "ring", "little")
Run = Callable[..., tuple[HandResults, Simulated]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Function that simulates a hand and runs it through the pipeline, once for each distinct hand."""
    done: dict[Any, tuple[HandResults, Simulated]] = {}

    def simulate_and_run(
        realism: Realism,
        model: str = "paper-fig4",
        *,
        hand: str = "right",
        task: str = "rom",
        forearm: bool = False,
        seed: int = 3,
    ) -> tuple[HandResults, Simulated]:
        key = (realism, model, hand, task, forearm, seed)
        if key not in done:
            folder = tmp_path_factory.mktemp("hand")
            simulated = simulate(RecordingName("01", hand, task), seed, realism, N_FRAMES, forearm=forearm)
            write_recording(folder / "recording.parquet", simulated)
            poses = import_recording(folder / "recording.parquet", folder / "poses.parquet", hand=hand)
            done[key] = run_hand(poses, model, folder), simulated
        return done[key]

    return simulate_and_run


def vector(row: Row, prefix: str, suffix: str = "_mm") -> Array:
    return np.array([row[f"{prefix}{axis}{suffix}"] for axis in "xyz"])


def centre_errors_mm(results: HandResults, simulated: Simulated) -> dict[str, float]:
    """Return each joint centre's distance from the truth in mm, the larger of p and q."""
    joints = results.joints()
    return {
        name: max(
            np.linalg.norm(vector(joints[name], "child_") - true.child_mm),
            np.linalg.norm(vector(joints[name], "parent_") - true.parent_mm),
        )
        for name, true in simulated.truth.joints.items()
        if name in joints and name != "wrist"
    }


def posture_errors_deg(
    results: HandResults, simulated: Simulated, digits: tuple[str, ...]
) -> dict[str, Array]:
    """Return, by digit, the error (T,) in deg of the metacarpal's change of posture since frame 1."""
    table = read_table(results.path("metacarpals"), METACARPALS)
    named = np.array(table.column("digit").to_pylist())
    errors = {}
    for digit in digits:
        q = np.stack([column_array(table, f"q{part}")[named == digit] for part in "wxyz"], -1)
        true = simulated.truth.bone_quaternion[:, BONES.index(f"{digit}_metacarpal")]
        change, true_change = multiply(q, conjugate(q[0])), multiply(true, conjugate(true[0]))
        errors[digit] = np.degrees(angle(multiply(conjugate(true_change), change)))
    return errors


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hand", "task", "forearm"),
    [
        ("right", "rom", False),
        ("left", "opposition", True),
        pytest.param("right", "opposition", True, marks=pytest.mark.slow),
        pytest.param("left", "rom", False, marks=pytest.mark.slow),
    ],
)
def test_an_exact_hand_is_recovered(run: Run, hand: str, task: str, forearm: bool) -> None:
    """Centres and tips are within 1e-6 mm, axes and metacarpal postures within 1e-6 deg."""
    results, simulated = run(Realism.exact(), hand=hand, task=task, forearm=forearm)
    errors = centre_errors_mm(results, simulated)
    assert len(errors) == 15
    assert max(errors.values()) < 1e-6
    joints = results.joints()
    for name, true in simulated.truth.joints.items():
        if name in joints and true.parent_segment and joints[name]["axis_child_x"] is not None:
            for side, axis in (("child", true.axis_child), ("parent", true.axis_parent)):
                sine = np.linalg.norm(np.cross(vector(joints[name], f"axis_{side}_", ""), axis))
                assert np.degrees(np.arcsin(min(sine, 1.0))) < 1e-6, (name, side)
    assert np.linalg.norm(vector(joints["wrist"], "child_") - simulated.truth.joints["wrist"].child_mm) < 1e-6
    for digit, error in posture_errors_deg(results, simulated, ("thumb", *FINGERS)).items():
        assert error.max() < 1e-6, digit
    for binding in ("first-frame", "least-squares"):
        for digit, row in results.errors(binding).items():
            assert row["n_frames"] == N_FRAMES
            assert row["max_mm"] < 1e-6, (binding, digit)


def test_metacarpals_at_rest_explain_all_of_table_1(run: Run) -> None:
    """If everything else is exact, Table 1's tip error is that of the metacarpals' wrong direction."""
    results, simulated = run(Realism.exact(), "paper-fig3-rest")
    mcp = simulated.truth.bone_position_mm
    wrist = mcp[:, BONES.index("hand")]
    for digit in FINGERS:
        v = mcp[:, BONES.index(f"{digit}_proximal")] - wrist
        at_rest = np.linalg.norm(v, axis=-1, keepdims=True) * np.array([1.0, 0.0, 0.0])
        expected = np.linalg.norm(at_rest - v, axis=-1)
        row = results.errors()[digit]
        assert row["mean_mm"] == pytest.approx(expected.mean(), abs=1e-6)
        assert row["min_mm"] == pytest.approx(expected.min(), abs=1e-6)
        assert row["mean_mm"] > 50


def test_noise_alone_moves_no_centre_by_a_millimetre(run: Run) -> None:
    """With tracker noise but no skin motion, every centre is within 1 mm of the truth."""
    results, simulated = run(replace(Realism.exact(), noise=1.0))
    assert max(centre_errors_mm(results, simulated).values()) < 1.0
