"""The moving hand: one recording's motion, packed into a page that plays it without any other program.

Every number is stored as a multiple of its block's step, so its error is at most half a step. The multiples
of a channel are stored as differences between frames, with the sign in the lowest bit, and all lowest bytes
come first; the high bytes are then nearly all zero and compress to almost nothing. `viewer.js` reads what
`pack_blocks` writes.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from shukotsu.arrays import Array
from shukotsu.hand.rotations import continuous
from shukotsu.report import hand_motion
from shukotsu.report.belief import BELIEFS
from shukotsu.report.figures.drawing import hand_panel, page_picture
from shukotsu.report.hand_motion import HandMotion, JointAxis, ShownSkeleton
from shukotsu.translation import N_, tr, word

POSITION_STEP_MM = 0.05
"""Step of positions; the error of a point is at most sqrt(3) / 2 steps, 0.044 mm."""
ROTATION_STEP = 1 / 8192
"""Step of a unit quaternion's parts; the error of a receiver's orientation is at most 0.014 degrees."""
ERROR_STEP_MM = 0.01
TIME_STEP_S = 1e-5
FARTHEST_SHOWN_MM = 10_000.0
"""Points farther away than this become gaps since they cannot be shown; a tracker's range is about 2 m."""
NOMINAL_HZ = 240.0
"""Frames per second at which a recording without device times is played."""
_EXTENT_FRAMES = 200
_NEAR_MM = 45.0


@dataclass(frozen=True)
class NumberBlock:
    """Numbers of one kind, (T, N, W), stored to within step / 2; a gap if any of the W numbers is NaN."""

    name: str
    step: float
    values: Array


@dataclass(frozen=True)
class View:
    """One moving hand as `viewer.html.j2` shows it.

    title : description for screen readers. digits : their names in the page's language. shown : indices of
    the motion's skeletons that are shown at first. still, still_caption : picture for readers without
    scripts, with its caption. data : the input of `viewer.js`. remark : a further remark, or empty. replayed
    : whether any skeleton has tip errors.
    """

    title: str
    motion: HandMotion
    digits: tuple[str, ...]
    shown: tuple[int, ...]
    still: Markup
    still_caption: str
    data: Markup
    remark: str
    replayed: bool


def view_of(
    title: str,
    motion: HandMotion,
    extra: Sequence[NumberBlock] = (),
    extra_header: Mapping[str, Any] | None = None,
) -> View:
    """Pack a hand's motion for the template, with data for other scripts of the page.

    extra, extra_header : as in `motion_text`.
    """
    shown = hand_motion.shown_first(motion)
    first = motion.skeletons[shown[0]]
    frame = hand_motion.still_frame(motion, first)
    remarks = []
    if motion.every > 1:
        remarks.append(tr("One frame in {every} of the recording is shown.", every=motion.every))
    if not np.isfinite(motion.time_s).any():
        text = N_("The recording has no device time; it is shown at {NOMINAL_HZ:g} frames per second.")
        remarks.append(tr(text, NOMINAL_HZ=NOMINAL_HZ))
    return View(
        title=title,
        motion=motion,
        digits=tuple(map(word, motion.digits)),
        shown=shown,
        still=page_picture(hand_panel(title, motion, first, frame)),
        still_caption=tr("{models}, frame {frame}", models=first.model, frame=motion.frame[frame]),
        data=Markup(motion_text(motion, extra, extra_header)),
        remark=" ".join(remarks),
        replayed=any(np.isfinite(each.tip_error_mm).any() for each in motion.skeletons),
    )


def motion_text(
    motion: HandMotion, extra: Sequence[NumberBlock] = (), extra_header: Mapping[str, Any] | None = None
) -> str:
    """Return the motion as a JSON object, with a header and base64 data, that is safe in a script element.

    extra : further blocks of the motion's T frames, which scripts find as `viewer.blocks[name]`. extra_header
    : JSON data, which scripts find as `viewer.header.extra`.
    """
    header = _header(motion)
    data, header["blocks"] = pack_blocks([*_blocks(motion), *extra])
    header["extra"] = dict(extra_header or {})
    header["data"] = base64.b64encode(data).decode("ascii")
    text = json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")


def pack_blocks(blocks: Sequence[NumberBlock]) -> tuple[bytes, list[dict[str, Any]]]:
    """Return the concatenated blocks, compressed by zlib, and a description of each for the reader.

    A block consists of byte planes (N, W, T) of coded differences, the lowest byte first; code 0 is a gap.
    """
    raw, parts = [], []
    for block in blocks:
        valid = np.asarray(np.isfinite(block.values).all(-1, keepdims=True))
        steps = np.rint(np.where(valid, block.values, 0.0) / block.step).astype(np.int64)
        last = np.maximum.accumulate(np.where(valid, np.arange(len(steps))[:, None, None], 0), axis=0)
        change = np.diff(np.take_along_axis(steps, last, axis=0), axis=0, prepend=0)  # gaps change nothing
        code = np.where(valid, 1 + ((change << 1) ^ (change >> 63)), 0)
        planes = max(1, -(-int(code.max(initial=0)).bit_length() // 8))
        code_bytes = np.ascontiguousarray(code.transpose(1, 2, 0), "<i8").view(np.uint8).reshape(-1, 8)
        raw += [code_bytes[:, plane].tobytes() for plane in range(planes)]
        shape = dict(zip(("frames", "count", "width"), block.values.shape, strict=True))
        parts.append({"name": block.name, "step": block.step, **shape, "planes": planes})
    compressor = zlib.compressobj(strategy=zlib.Z_RLE)  # of differences, smaller than by default, and faster
    return compressor.compress(b"".join(raw)) + compressor.flush(), parts


def playing_times_s(time_s: Array) -> Array:
    """Return the time at which each frame is shown (T,), s, from 0 and never decreasing.

    It is the device time, interpolated for frames without one. A recording without device times is played at
    NOMINAL_HZ.
    """
    index = np.arange(len(time_s), dtype=float)
    timed = np.isfinite(time_s)
    if not timed.any():
        return np.asarray(index / NOMINAL_HZ)
    filled = np.maximum.accumulate(np.interp(index, index[timed], time_s[timed]))
    return np.asarray(filled - filled[0])


def _blocks(motion: HandMotion) -> list[NumberBlock]:
    blocks = [
        NumberBlock("time", TIME_STEP_S, motion.begins_s + playing_times_s(motion.time_s)[:, None, None]),
        NumberBlock("frame", 1.0, motion.frame.astype(float)[:, None, None]),
        NumberBlock("receivers", POSITION_STEP_MM, _near(motion.receiver_mm)),
        NumberBlock("rotations", ROTATION_STEP, continuous(motion.receiver_quaternion)),
    ]
    for index, skeleton in enumerate(motion.skeletons):
        if skeleton.on_receivers is None:
            blocks.append(NumberBlock(f"points{index}", POSITION_STEP_MM, _near(skeleton.position_mm)))
        blocks.append(NumberBlock(f"errors{index}", ERROR_STEP_MM, _near(skeleton.tip_error_mm[..., None])))
    return blocks


def _near(values: Array) -> Array:
    """Return values with NaN for points that are too far away to be shown."""
    return np.where(np.abs(values) <= FARTHEST_SHOWN_MM, values, np.nan)


def _header(motion: HandMotion) -> dict[str, Any]:
    middle, half = _extent(motion)
    based = np.isfinite(motion.receiver_mm[:, motion.base]).all(-1)
    return {
        "hand": motion.hand,
        "digits": [word(digit) for digit in motion.digits],
        "receivers": motion.receivers,
        "base": motion.base,
        "firstBase": int(np.argmax(based)),
        "upright": motion.upright.ravel().tolist(),
        "middle": middle.round(1).tolist(),
        "half": half.round(1).tolist(),
        "shown": hand_motion.shown_first(motion),
        "skeletons": [_skeleton(motion, skeleton) for skeleton in motion.skeletons],
    }


def _extent(motion: HandMotion) -> tuple[Array, Array]:
    """Return centre and half size (3,), mm, of the space that the hand fills in the view, with a margin.

    They are computed from a part of the frames, without extreme points, and without joints far from all
    receivers, which would make the hand appear small.
    """
    frames = np.arange(0, len(motion.frame), max(1, len(motion.frame) // _EXTENT_FRAMES))

    def in_view(world_mm: Array) -> Array:
        points = hand_motion.view_points(motion, frames, world_mm[frames]).reshape(-1, 3)
        return points[np.isfinite(points).all(-1)]

    receivers = in_view(motion.receiver_mm)
    low, high = np.percentile(receivers, [2, 98], axis=0)
    points = np.concatenate([receivers, *(in_view(skeleton.position_mm) for skeleton in motion.skeletons)])
    near = ((points >= low - _NEAR_MM) & (points <= high + _NEAR_MM)).all(-1)
    low, high = np.percentile(points[near], [2, 98], axis=0)
    return (low + high) / 2, np.maximum(20.0, (high - low) / 2) * 1.15 + 4.0


def _skeleton(motion: HandMotion, skeleton: ShownSkeleton) -> dict[str, Any]:
    carried = skeleton.on_receivers
    seats = [  # the index of a point's receiver, and the point in its frame, mm
        (motion.receivers.index(point.segment), [round(float(part), 3) for part in point.point_mm])
        if point.segment in motion.receivers and np.linalg.norm(point.point_mm) <= FARTHEST_SHOWN_MM
        else None
        for point in carried or ()
    ]
    return {
        "model": skeleton.model,
        "place": skeleton.model_index,
        "points": skeleton.points,
        "tips": [skeleton.points.index(f"{digit}_tip") for digit in motion.digits],
        "sd": [round(float(sd), 2) if np.isfinite(sd) else None for sd in skeleton.sd_mm],
        "belief": [BELIEFS.index(belief) for belief in skeleton.believed],
        "bones": [(b.start, b.end, b.digit, b.level, b.shared) for b in skeleton.bones],
        "axes": [_axis(motion, axis) for axis in skeleton.axes if axis.segment in motion.receivers],
        "seats": None if carried is None else seats,
    }


def _axis(motion: HandMotion, axis: JointAxis) -> dict[str, Any]:
    cut = axis.plane_segment in motion.receivers
    return {
        "point": axis.point,
        "receiver": motion.receivers.index(axis.segment),
        "axis": axis.axis,
        "plane": motion.receivers.index(axis.plane_segment) if cut else None,
        "normal": axis.normal,
    }
