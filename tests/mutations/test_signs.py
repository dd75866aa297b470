"""Every wrong sign planted in the paper's equations, in a copy of the program, makes a test fail."""

import os
import shutil
import sys
from multiprocessing import get_context
from pathlib import Path

import pytest
from hypothesis import Phase, settings
from studies.running import REPOSITORY, copy_of_the_program

MOMENTS, SOLUTION = (f"shukotsu/paper/{name}.py" for name in ("moments", "joint_solution"))
POSTURE = "shukotsu/paper/posture.py"

SIGNS = {
    "Eq. 3, stacked, parent's half": (SOLUTION, "-matrix(parent_quaternion)", "matrix(parent_quaternion)"),
    "Eq. 3, stacked, right side": (
        SOLUTION,
        "(parent_position_mm - child_position_mm)",
        "(child_position_mm - parent_position_mm)",
    ),
    "Eq. 3, moments, child seen from parent": (
        MOMENTS,
        "position_mm[:, child] - position_mm[:, parent]",
        "position_mm[:, parent] - position_mm[:, child]",
    ),
    "Eq. 3, moments, offset from the first pose": (
        SOLUTION,
        "moments.reference_mm[joint] + mean[9:]",
        "moments.reference_mm[joint] - mean[9:]",
    ),
    "Eq. 3, closed, normal equations": (
        SOLUTION,
        "right = -(V.T @ normal.C_Dd)",
        "right = V.T @ normal.C_Dd",
    ),
    "Eq. 3, closed, gap": (SOLUTION, "offset = p - self.M @ q - self.u", "offset = p + self.M @ q - self.u"),
    "Eq. 8, order of the cross product": (POSTURE, "= cross(start, vector)", "= cross(vector, start)"),
    "Eq. 9, sine": (
        POSTURE,
        "np.arctan2(np.sqrt(_dot(axis, axis)), ",
        "np.arctan2(-np.sqrt(_dot(axis, axis)), ",
    ),
    "Eq. 9, cosine": (POSTURE, "_dot(vector, start))", "-_dot(vector, start))"),
    "Eq. 10, vector part": ("shukotsu/hand/rotations.py", "np.sin(half) * axis", "-np.sin(half) * axis"),
    "Eq. 10, scalar part": (
        "shukotsu/hand/rotations.py",
        "np.broadcast_to(np.cos(half)",
        "np.broadcast_to(-np.cos(half)",
    ),
    "Fig. 8, sign of the twist": (
        POSTURE,
        " cross(normal_metacarpal, across)",
        " cross(across, normal_metacarpal)",
    ),
    "Fig. 7, component across": (POSTURE, "normal_proximal - along *", "normal_proximal + along *"),
    "order of swing and twist": (
        POSTURE,
        "multiply(about_axis(unit(vector), twist_rad), swung)",
        "multiply(swung, about_axis(unit(vector), twist_rad))",
    ),
    "plane, direction of the slide": (
        "shukotsu/paper/plane.py",
        "(np.array(plane.point_mm) - point_mm)",
        "(point_mm - np.array(plane.point_mm))",
    ),
}


GUARDS = {
    "rotations.py": "hand/test_rotations.py",
    "joint_solution.py": "paper/test_joint_solution.py",
    "moments.py": "paper/test_joint_solution.py",
    "plane.py": "paper/test_plane.py",
    "posture.py": "paper/test_posture.py",
}
"""Modules of the paper's equations with their tests."""
# One failing example is enough, so it is not shrunk.
first_failure = settings(settings.get_profile("steady"), phases=(Phase.explicit, Phase.generate))
settings.register_profile("first", first_failure)


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program and of the tests of the equations."""
    folder = copy_of_the_program(tmp_path_factory.mktemp("mutated") / "copy")
    for name in (
        "pyproject.toml",
        *(f"tests/{name}" for name in ("conftest.py", "chains.py", *GUARDS.values())),
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(REPOSITORY / name, folder / name)
    return folder


def run_guard(folder: Path, guard: str) -> None:
    """Run tests of the copy in this process and exit with their result."""
    for name in [name for name in sys.modules if name.partition(".")[0] in ("shukotsu", "tests", "chains")]:
        del sys.modules[name]
    os.chdir(folder)
    sys.path[:0] = [str(folder)]
    sys.dont_write_bytecode = True
    options = ("-x", "-q", "-p", "no:cacheprovider", "-m", "not slow", "--hypothesis-profile", "first")
    os._exit(pytest.main([*options, f"tests/{guard}"]))


def guard_passes(folder: Path, guard: str) -> bool:
    """Return whether the tests pass for the copy, in a forked process that has already imported other
    packages.
    """
    process = get_context("fork").Process(target=run_guard, args=(folder, guard))
    process.start()
    process.join()
    assert process.exitcode in (0, 1)
    return process.exitcode == 0


@pytest.mark.slow
@pytest.mark.parametrize("guard", dict.fromkeys(GUARDS.values()))
def test_the_tests_pass_without_a_mutation(copy: Path, guard: str) -> None:
    assert guard_passes(copy, guard)


@pytest.mark.slow
@pytest.mark.parametrize("sign", SIGNS)
def test_a_wrong_sign_is_found(copy: Path, sign: str) -> None:
    name, right, wrong = SIGNS[sign]
    path = copy / name
    text = path.read_text("utf-8")
    assert text.count(right) == 1, f"{sign}: {name} no longer holds {right!r} once"
    try:
        path.write_text(text.replace(right, wrong), "utf-8")
        assert not guard_passes(copy, GUARDS[path.name])
    finally:
        path.write_text(text, "utf-8")
