"""The palette's colours can be distinguished by colour-blind readers."""

from itertools import combinations

import numpy as np
import pytest

from shukotsu.report.palette import DIGIT_HUES, HUES, MODEL_HUES

VISION = {
    "usual": np.eye(3),
    "protan": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deutan": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritan": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}
"""Matrices on linear RGB: Machado, Oliveira, Fernandes, IEEE Trans. Vis. Comput. Graph. 15, 2009,
severity 1.
"""
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour: str, vision: str) -> np.ndarray:
    """Return the CIELAB coordinates of a colour as seen with a colour vision."""
    rgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(np.asarray(VISION[vision]) @ linear, 0, 1) / (0.9505, 1.0, 1.089)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
@pytest.mark.parametrize("hues", [DIGIT_HUES, MODEL_HUES], ids=["digits", "models"])
def test_colours_differ_to_colour_blind_readers(hues: tuple[str, ...], theme: int, vision: str) -> None:
    """They differ by over 15 units of CIELAB, several times the just noticeable difference."""
    seen = {hue: lab(HUES[hue][theme], vision) for hue in hues}
    assert min(np.linalg.norm(seen[a] - seen[b]) for a, b in combinations(hues, 2)) > 15
