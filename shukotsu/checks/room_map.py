"""Where in a room the tracker may be trusted: errors by cells of a grid, from a bar that went through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shukotsu.checks.rigid_bar import Bar, Bools, Deviations, Integers
from shukotsu.errors import InputError
from shukotsu.skeleton.rotations import Array

CELL_MM = 50.0

TRUSTED = (1.0, 1.0)
"""mm and deg of a receiver in 3-D, noise and all: what the fit of a hand allows any (0.5 mm and 0.6 deg a
component)."""

LEAST_S, LEAST_VISITS = 0.15, 2
"""In a cell, of both receivers together, for it to say anything."""

FEWEST_CELLS, MOST_CELLS, MOST_UNKNOWN = 12, 40_000, 0.1
"""Of a map that says anything; of a room; and the share of a trusted box in which data may lack."""

_ROUNDS = 15


@dataclass(frozen=True)
class RoomMap:
    """Cells of a box that holds where a bar was, a grid of shape (X, Y, Z).

    first_mm : (3,) centre of the first cell. n_frames : (X, Y, Z) poses of either receiver. error, error_sd,
    noise : (2, X, Y, Z), mm and deg, rms of one receiver in 3-D; NaN where data are few.
    """

    first_mm: Array
    cell_mm: float
    bar_mm: float
    n_frames: Integers
    error: Array
    error_sd: Array
    noise: Array

    @property
    def known(self) -> Bools:
        """Say which cells have enough data."""
        return np.asarray(np.isfinite(self.error[0]))

    @property
    def trusted(self) -> Bools:
        """Say where error and noise together are within TRUSTED."""
        within = np.hypot(self.error, self.noise) <= np.reshape(TRUSTED, (2, 1, 1, 1))  # of NaN it is not
        return np.asarray(within.all(0))

    @property
    def centres_mm(self) -> Array:
        """Centres (X, Y, Z, 3) of the cells."""
        return np.asarray(self.first_mm + self.cell_mm * np.moveaxis(np.indices(self.n_frames.shape), 0, -1))


def room_map(bar: Bar, found: Deviations, cell_mm: float = CELL_MM) -> RoomMap:
    """Give the map of where a bar was. Raises InputError where that is hardly anywhere, or everywhere.

    The two receivers are taken to err independently; each has the share in a deviation that its cell has in
    the mean squares of both cells. The bar's length shows the error along it alone, which is taken to be as
    large each way: three times its square is that of a place.
    """
    index = np.floor(bar.position_mm / cell_mm).astype(np.int64)
    first = index.reshape(-1, 3).min(0)
    shape = tuple((index.reshape(-1, 3).max(0) - first + 1).tolist())
    if np.prod(np.array(shape, float)) > MOST_CELLS:
        size = " x ".join(f"{n * cell_mm / 1e3:.1f}" for n in shape)
        raise InputError(f"the bar was in a space of {size} m; look whether positions are in mm")
    cell = np.ravel_multi_index(tuple(np.moveaxis(index - first, -1, 0)), shape)
    n_cells = int(np.prod(shape))
    n_frames = np.bincount(cell.ravel(), minlength=n_cells)
    n_visits = np.bincount(cell[0], minlength=n_cells)
    n_visits += np.bincount(cell[1:][np.diff(cell, axis=0) != 0], minlength=n_cells)
    enough = (n_frames * bar.period_s >= LEAST_S) & (n_visits >= LEAST_VISITS)
    if enough.sum() < FEWEST_CELLS:
        raise InputError(
            f"the bar was hardly moved: {enough.sum()} cells of {cell_mm:.0f} mm have data; expected "
            f"{FEWEST_CELLS} or more: move it slowly, turning it, through all the space where hands will be"
        )
    in_a_row = (np.abs(np.diff(bar.time_s) / bar.period_s - 1) < 0.5).astype(int)
    rows = np.flatnonzero(in_a_row[1:] & in_a_row[:-1])
    parts = []
    for own in (np.sqrt(3.0) * found.longer_mm, found.turned_deg):
        noise = _shared((np.diff(own, 2, axis=0)[rows] ** 2).sum(1) / 6.0, cell[rows + 1], n_cells)
        square = _shared((own**2).sum(1), cell, n_cells)
        sd = np.sqrt(square / (2.0 * np.maximum(1, n_visits)))  # as many draws as visits
        each = (np.sqrt(np.maximum(0.0, square - noise)), sd, np.sqrt(noise))
        parts.append([np.where(enough, one, np.nan).reshape(shape) for one in each])
    numbers = [np.stack(both) for both in zip(*parts, strict=True)]
    return RoomMap((first + 0.5) * cell_mm, cell_mm, found.length_mm, n_frames.reshape(shape), *numbers)


def _shared(squares: Array, cell: Integers, n_cells: int) -> Array:
    """Mean squares (C,) by cell, of which those (T,) of two receivers in cells (T, 2) are the sums: variances
    by expectation and maximisation.
    """
    count = np.maximum(1, np.bincount(cell.ravel(), minlength=n_cells))
    own = np.repeat(squares[:, None] / 2, 2, axis=1)
    for _ in range(_ROUNDS):
        each = (np.bincount(cell.ravel(), own.ravel(), n_cells) / count + 1e-12)[cell]
        both = each.sum(1, keepdims=True)
        own = (each / both) ** 2 * squares[:, None] + each * each[:, ::-1] / both
    return np.asarray(np.bincount(cell.ravel(), own.ravel(), n_cells) / count)


def trusted_box(room: RoomMap) -> tuple[Array, Array] | None:
    """Give two corners (3,), mm, of the largest box in which nothing is known to be off and few cells lack
    data; None where there is none.
    """
    bad, unknown = (
        np.pad(own, ((1, 0),) * 3).astype(np.int64).cumsum(0).cumsum(1).cumsum(2)
        for own in (room.known & ~room.trusted, ~room.known)
    )
    (xs, ys, zs), best, corners = (np.triu_indices(n + 1, 1) for n in room.n_frames.shape), 0, None
    for x0, x1 in zip(*xs, strict=True):
        for y0, y1 in zip(*ys, strict=True):
            n_cells = (x1 - x0) * (y1 - y0) * (zs[1] - zs[0])
            if n_cells.max() <= best:
                continue
            columns = (own[x1, y1] - own[x0, y1] - own[x1, y0] + own[x0, y0] for own in (bad, unknown))
            n_bad, n_unknown = (column[zs[1]] - column[zs[0]] for column in columns)
            fits = np.where((n_bad == 0) & (n_unknown <= MOST_UNKNOWN * n_cells), n_cells, 0)
            at = int(np.argmax(fits))
            if fits[at] > best:
                best, corners = int(fits[at]), ((x0, y0, zs[0][at]), (x1, y1, zs[1][at]))
    if corners is None:
        return None
    low_mm, high_mm = (room.first_mm + room.cell_mm * (np.array(own) - 0.5) for own in corners)
    return low_mm, high_mm
