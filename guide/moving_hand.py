"""Command line that draws a fitted hand moving: one round of a recording, from the results of a study."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from guide.flesh import Flesh, flesh_of
from guide.hand_drawing import HandDrawing
from guide.picture_card import Drawing
from guide.views import View, whole
from schemas.catalogue import BONE_LENGTHS, BONE_POSES
from schemas.errors import InputError
from schemas.tables import column_array, read_table
from skeleton.rotations import Array, conjugate, multiply, rotate
from stages.simulate.random_hand import BONES

MODEL, TASK = "whole-hand", "opposition"
_FRAMES, _SECONDS = 36, 6.0
_TOWARDS = (0.1, 0.42, -1.0)
_MARGIN_PX, _SCALE = 16.0, 1.5
_ENLARGED = 1.5
"""As a page shows it."""
_TITLE = "A fitted hand, moving"
_DESCRIPTION = (
    "The right hand of the demo study's first subject as the model whole-hand has it: its thumb touches the "
    "other fingertips in turn."
)


def fitted_hand(results: Path, subject: str, hand: str) -> Flesh:
    """One round of opposition as the fit of a study's subject poses it, evenly in time, in the hand's frame.

    Raises InputError where a table is missing or is none.
    """
    folder = results / f"sub-{subject}" / "fits" / hand / MODEL
    table = read_table(folder / "bone_poses.parquet", BONE_POSES)
    rows = (column_array(table, "task") == TASK) & (column_array(table, "made_without") == "")
    segment = column_array(table, "segment")[rows]
    values = {
        name: column_array(table, name)[rows] for name in ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    }
    pose = np.stack(list(values.values()), -1)
    if not len(pose):
        raise InputError(f"{folder}: no bones are posed in {TASK}; run the demo study first (make demo)")
    palm = pose[segment == "hand"]
    chosen = _round(
        np.stack(
            [pose[segment == f"{digit}_distal"][:, :3] - palm[:, :3] for digit in ("index", "little")], 1
        )
    )
    back = conjugate(palm[chosen, 3:])
    origins = np.zeros((len(chosen), len(BONES), 3))
    turns = np.zeros((len(chosen), len(BONES), 4))
    turns[..., 0] = 1.0  # the forearm, which wears no receiver, stays with the hand
    for index, bone in enumerate(BONES):
        own = pose[segment == bone]
        if len(own):
            origins[:, index] = rotate(back, own[chosen, :3] - palm[chosen, :3])
            turns[:, index] = multiply(back, own[chosen, 3:])
    return flesh_of(origins, turns, length_mm=_lengths_mm(folder))


def _round(tips_mm: Array) -> Array:
    """Frames of a round, evenly, its end as its beginning; the first is that of the widest open hand.

    tips_mm : (T, 2, 3) how two fingertips lie from the hand.
    """
    quarter = len(tips_mm) // 4
    starts, ends = np.arange(0, quarter // 2, 8), np.arange(int(0.8 * quarter), int(1.4 * quarter), 8)
    apart = np.linalg.norm(tips_mm[starts][:, None] - tips_mm[ends][None], axis=-1).sum(-1)
    start, end = np.unravel_index(np.argmin(apart), apart.shape)
    frames = np.linspace(starts[start], ends[end], _FRAMES, endpoint=False).astype(int)
    reach_mm = np.linalg.norm(tips_mm[frames], axis=-1).sum(-1)
    return np.asarray(np.roll(frames, -int(np.argmax(reach_mm))))


def _lengths_mm(folder: Path) -> Array:
    table = read_table(folder / "fitted_bones.parquet", BONE_LENGTHS)
    kept = column_array(table, "made_without") == ""
    bones, lengths = column_array(table, "bone")[kept], column_array(table, "length_mm")[kept]
    known = dict(zip(bones, lengths, strict=True))
    return np.array([float(known.get(bone, 0.0)) for bone in BONES])


def moving_hand(hand: Flesh) -> str:
    """The picture's file."""
    view = View.seen(_TOWARDS, (1.0, 0.0, 0.0), _SCALE, (0.0, 0.0))
    low, high = whole(view, hand)
    width = float(np.ceil(high[0] - low[0] + 2 * _MARGIN_PX))
    at = _MARGIN_PX - low[0], _MARGIN_PX - low[1]
    height = float(np.ceil(at[1] + 70 * _SCALE))
    drawing = Drawing("hand-moving", _TITLE, _DESCRIPTION, width, height, "en", enlarged=_ENLARGED)
    with drawing.clipped():
        HandDrawing(drawing, View.seen(_TOWARDS, (1.0, 0.0, 0.0), _SCALE, at), hand, _SECONDS).draw()
        drawing.fade(0, height - 84, width, 86)
    return drawing.svg()


def main(argv: list[str] | None = None) -> int:
    """Run the command; give its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m guide.moving_hand",
        description="Draw the demo study's first right hand, moving, as the model whole-hand has it.",
    )
    parser.add_argument("results", type=Path, help="folder of the demo study's results: results/demo")
    parser.add_argument("--out", type=Path, required=True, help="the picture: docs/hand-moving.svg")
    arguments = parser.parse_args(argv)
    try:
        picture = moving_hand(fitted_hand(arguments.results, "01", "right"))
        arguments.out.write_text(picture, "utf-8", newline="\n")
    except (InputError, OSError) as error:
        print(f"guide.moving_hand: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
