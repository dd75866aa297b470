"""4x4 matrices as text: in every arrangement, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recording_files
from recording_files import ARM, of

from shukotsu.errors import InputError
from shukotsu.schemas.layout import Layout
from shukotsu.skeleton.rotations import matrix, unit
from shukotsu.stages.capture.formats.matrices import read_matrices
from shukotsu.stages.capture.inspect_file import describe
from shukotsu.stages.capture.samples import Samples

RNG = np.random.default_rng(8)
QUATERNIONS = unit(RNG.normal(size=(6, 4)))
POSITIONS = np.round(RNG.normal(size=(6, 3)), 4)


def config(*segments: str, **keys: Any) -> dict[str, Any]:
    names = segments or ("hand",)
    return {"format": "matrices", "position_unit": "m", "receivers": {s: {} for s in names}} | keys


def read(path: Path, told: dict[str, Any] | None = None, layout: Layout = ARM) -> Samples:
    return recording_files.read(path, layout, told or config())


def matrices() -> np.ndarray:
    whole = np.tile(np.eye(4), (6, 1, 1))
    whole[:, :3, :3], whole[:, :3, 3] = matrix(QUATERNIONS), POSITIONS
    return whole


def four_lines(some: np.ndarray, between: str = "\n", end: str = "\n") -> str:
    blocks = ["".join(" ".join(f"{v:.9f}" for v in row) + end for row in one) for one in some]
    return between.join(blocks)


def refuse(path: Path, message: str, told: dict[str, Any] | None = None) -> None:
    recording_files.refuse(path, message, ARM, told or config())


@pytest.mark.parametrize(
    "text",
    [
        four_lines(matrices()),
        four_lines(matrices(), between=""),
        four_lines(matrices(), end="\r\n"),
        "\n\n" + four_lines(matrices()) + "\n\n",
        "".join("\t".join(f"{v:.9f}" for v in one.ravel()) + "\n" for one in matrices()),
    ],
    ids=["blank-line", "no-blank-line", "crlf", "more-blanks", "sixteen-a-line"],
)
def test_one_file_however_it_is_laid_out(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.traj").write_bytes(text.encode())
    samples = read(tmp_path / "a.traj", config(rate_hz=100))
    np.testing.assert_array_equal(samples.frame, np.arange(6))
    np.testing.assert_allclose(samples.time_s, np.arange(6) / 100)
    np.testing.assert_allclose(samples.numbers[:, :3], POSITIONS * 1000, atol=1e-9)
    np.testing.assert_allclose(matrix(samples.numbers[:, 3:]), matrix(QUATERNIONS), atol=1e-8)


def test_several_receivers_a_sample_and_a_fixed_segment(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(four_lines(matrices()))
    samples = read(tmp_path / "a.txt", config("forearm", "hand", fixed=["scapula"], rate_hz=50))
    forearm, hand, bench = (of(samples, segment) for segment in ("forearm", "hand", "scapula"))
    np.testing.assert_allclose(samples.numbers[forearm, :3], POSITIONS[::2] * 1000, atol=1e-9)
    np.testing.assert_allclose(samples.numbers[hand, :3], POSITIONS[1::2] * 1000, atol=1e-9)
    np.testing.assert_array_equal(samples.numbers[bench], [[0, 0, 0, 1, 0, 0, 0]] * 3)
    for own in (forearm, hand, bench):
        np.testing.assert_array_equal(samples.frame[own], [0, 1, 2])
        np.testing.assert_allclose(samples.time_s[own], [0, 0.02, 0.04])
    assert samples.place(int(np.flatnonzero(hand)[1])) == f"{tmp_path}/a.txt: line 16"
    refuse(tmp_path / "a.txt", "has 6 matrices; expected a multiple of 4", config(*ARM.measured))


def changed(change: Any) -> str:
    """The matrices with the second one changed."""
    some = matrices()
    some[1] = some[1] @ change if np.ndim(change) else some[1].T
    return four_lines(some)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no matrix"),
        (changed(None), "a.txt: line 6: the last row of the matrix is "),
        (changed(np.diag([-1.0, 1, 1, 1])), "a.txt: line 6: the rotation is mirrored"),
        (changed(np.diag([1.1, 1.1, 1.1, 1])), "a.txt: line 6: the matrix is no rotation"),
        ("1 0 0 0\n0 1 0 0\n0 0 1 0\n", "a.txt: line 4: the matrix that begins in line 1 has 3 lines"),
        ("1 0 0 0\n0 1 0 0\n\n0 0 1 0\n0 0 0 1", "line 3: the matrix that begins in line 1 has 2 lines"),
        ("1 0 0\n", "a.txt: line 1: has 3 numbers; expected four, or sixteen"),
        ("1 0 0 0\n" + "0 " * 16, "a.txt: line 2: has 16 numbers"),
        ("1 0 0 0\n0 1,0 0 0\n0 0 1 0\n0 0 0 1", "line 2: is '1,0'; expected a number with a decimal point"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    refuse(tmp_path / "a.txt", message)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "bytes.txt").write_bytes(b"\xff\xfe\x00")
    refuse(tmp_path / "bytes.txt", "is UTF-16 text; expected matrices as text")
    refuse(tmp_path / "no.txt", "no such file")
    refuse(tmp_path / "no.txt", "receivers: segment 'hnad' is not in layout arm", config("hnad"))
    with pytest.raises(InputError, match=r"needs a mapping .* inspect .*no.txt --write-mapping mapping.yaml"):
        read_matrices(tmp_path / "no.txt", ARM, None)


def test_names_with_digits_of_any_kind(tmp_path: Path) -> None:
    """Numbers in names count by their value; a raised two is no number."""
    for index, name in enumerate(("2.txt", "10.txt", "²3.txt")):
        (tmp_path / name).write_text(four_lines(matrices()[index : index + 1]))
    found = read(tmp_path, config(matrices={"pattern": "*.txt"})).numbers[:, :3]
    np.testing.assert_allclose(sorted(found.tolist()), sorted((POSITIONS[:3] * 1000).tolist()), atol=1e-5)
    assert describe(tmp_path, ARM).lines[0].startswith("3 matrices")
