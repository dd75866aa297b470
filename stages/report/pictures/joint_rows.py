"""Pictures with a row a joint: ranges of its angles, and the singular values of its centre's system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stages.report.palette import HUES, INK, PAPER, SOFT
from stages.report.pictures.picture import Array, Picture
from stages.report.pictures.scale import Scale
from stages.report.wording import say, word

_WIDTH, _LEFT, _RIGHT, _TOP, _BOTTOM, _ROW = 400.0, 88.0, 386.0, 6.0, 36.0, 17.0
_LEAST_SPAN_DEG = 20.0
_LEAST_SINGULAR_VALUE, _LARGEST_SINGULAR_VALUE = 1e-4, 2.0
"""Below the least a singular value is the solver's own rounding, far below what any receiver resolves."""
_BAR = HUES["plain"][0]
"""Neither a digit's colour nor a model's, nor one that says whether to believe a joint."""

Range = tuple[float, float, float, float, float]
"""Of an angle, degrees: the least, both ends of its range, the median between them, and the greatest."""


def range_picture(title: str, joints: Sequence[str], ranges: Mapping[str, Range]) -> Markup:
    """One angle's range by joint, least to most and its range (skeleton.angle_range), with the median.

    `title` is the text alternative.
    """
    low = min((own[0] for own in ranges.values()), default=0.0)
    high = max((own[-1] for own in ranges.values()), default=0.0)
    pad = max(0.0, _LEAST_SPAN_DEG - (high - low)) / 2 + 0.02 * (high - low)
    scale = Scale(low - pad, high + pad)
    picture = _rows(title, joints, scale, "deg")
    if scale.low <= 0.0 <= scale.high:
        zero = float(_across(scale, 0.0))
        picture.line([(zero, _TOP), (zero, _TOP + _ROW * len(joints))], SOFT)
    for joint, values in ranges.items():
        least, first, median, last, most = _across(scale, values).tolist()
        y = _middle(joints.index(joint))
        picture.line([(least, y), (most, y)], SOFT, 1.2)
        picture.line([(first, y), (last, y)], _BAR, 7.0)
        picture.line([(median, y - 0.35 * _ROW), (median, y + 0.35 * _ROW)], INK, 2.0)
    return picture.markup()


def singular_value_picture(title: str, joints: Sequence[str], values: Sequence[Sequence[float]]) -> Markup:
    """Each joint's six singular values, largest first, on a logarithmic scale; the sixth is a diamond."""
    known = np.maximum(np.array(values, float).reshape(len(joints), 6), _LEAST_SINGULAR_VALUE)
    scale = Scale(10.0 ** np.floor(np.log10(known.min(initial=0.1))), _LARGEST_SINGULAR_VALUE, "log")
    picture = _rows(title, joints, scale, say("singular value"))
    y = [_middle(row) for row in range(len(joints))]
    for place in range(6):
        shape, face, edge = "o", "none" if place < 3 else _BAR, SOFT if place < 3 else PAPER
        if place == 5:
            shape, face, edge = "D", INK, INK
        picture.marks(np.column_stack([_across(scale, known[:, place]), y]), shape, 7.0, face, edge)
    return picture.markup()


def _rows(title: str, joints: Sequence[str], scale: Scale, unit: str) -> Picture:
    """A picture with a named row a joint, the first on top, above an axis."""
    foot = _TOP + _ROW * len(joints)
    picture = Picture(title, _WIDTH, foot + _BOTTOM)
    picture.number_axis(scale, (_LEFT, _RIGHT), _TOP, foot, unit)
    picture.line([(_LEFT, foot), (_RIGHT, foot)], SOFT)
    for row, joint in enumerate(joints):
        picture.text(_LEFT - 5, _middle(row), word(joint), "end", middle=True)
    return picture


def _middle(row: int) -> float:
    return _TOP + (row + 0.5) * _ROW


def _across(scale: Scale, values: npt.ArrayLike) -> Array:
    return np.asarray(_LEFT + scale.share(values) * (_RIGHT - _LEFT))
