"""A posed hand as a matplotlib picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from shukotsu.errors import InputError, guess
from shukotsu.posed_hand import PosedHand
from shukotsu.stages.report.palette import RULE, digit_looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VIEWS = ("3d", "back", "side")


def plot_hand(posed: PosedHand, at: int = 0, *, view: str = "3d", ax: Axes | None = None) -> Axes:
    """Draw a hand at one of its frames, a colour a digit, in mm in the frame of its own bone.

    at : place in the first dimension of its arrays. view : 3d, or flat from the back of the hand or from the
    thumb's side, distal up. ax : where to draw; None makes a figure, for 3d one that can be turned.
    Raises InputError where the hand has no pose at that frame, or view is none of these.
    """
    if view not in VIEWS:
        raise InputError(f"view {view!r}; {guess(view, VIEWS)}")
    places = _drawn(posed, at, view)
    ax = _new_axes(view) if ax is None else ax
    looks = digit_looks(list(dict.fromkeys(filter(None, posed.digits))))
    for index, parent in enumerate(posed.parents):
        if parent < 0:
            continue
        ends = places[[parent, index]].T
        first = posed.digits[parent] != posed.digits[index]
        colour = RULE if first else looks[posed.digits[index]].colour
        ax.plot(*ends, color=colour, linewidth=1.5 if first else 3, solid_capstyle="round")
    for digit, look in looks.items():
        own = [i for i, (name, of) in enumerate(zip(posed.joints, posed.digits, strict=True)) if of == digit]
        ax.plot(*places[own].T, "o", color=look.colour, markersize=4, label=digit)
    _dress(ax, view)
    return ax


def _drawn(posed: PosedHand, at: int, view: str) -> Any:
    """Places (J, 3) of the joints, or (J, 2) in a flat view."""
    places = posed.in_hand_mm()[at]
    if not np.isfinite(places).any():
        raise InputError(f"the hand has no pose at frame {int(posed.frame[at])}; choose another")
    thumbs_side = 1.0 if posed.hand == "right" else -1.0
    if view == "back":
        return np.stack([-places[:, 1], places[:, 0]], -1)
    if view == "side":
        return np.stack([thumbs_side * places[:, 2], places[:, 0]], -1)
    return places


def _new_axes(view: str) -> Axes:
    import matplotlib.pyplot as plt

    axes: Axes = plt.figure().add_subplot(projection="3d" if view == "3d" else None)
    return axes


def _dress(ax: Any, view: str) -> None:
    flat = {"back": ("across", "distal"), "side": ("dorsal", "distal")}
    names = flat.get(view, ("distal", "y", "dorsal"))
    for axis, name in zip("xyz", names, strict=False):
        getattr(ax, f"set_{axis}label")(f"{name} [mm]")
    ax.set_aspect("equal")
    ax.legend(loc="center left", bbox_to_anchor=(1.1, 0.5), frameon=False)
