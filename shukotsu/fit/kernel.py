"""Compiled loops over frames: chains, residuals, their derivatives, and the elimination of states and roots.

Every array has its frames last, so that the inner loops run over neighbours in memory and become vector
instructions. Names are those of `operations` and `normal_equations`, which say what is computed. m : rows of
a branch's residuals, six of each receiver; columns of derivatives : root, then unknowns.

Numba keeps compiled code until this file changes, so constants and types that it reads are defined here.

On paper: docs/whole-hand.md, sections 4 to 6.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np
import numpy.typing as npt

from shukotsu.fit.operations import Index
from shukotsu.hand.rotations import Array

ROTATE, TRANSLATE, MOVE, MARK, LEAVE, RETURN = range(6)
"""Kinds of a plan's steps."""

_SMALL = 1e-3
_NO_TURN = 1e-9
_SOME_ROOT = 1e-9
"""Precision of a root that no receiver shows."""

_FIRST_DAMPING, _DAMPING_STEP = 1e-3, 10.0

_Function = TypeVar("_Function", bound=Callable[..., Any])

kept: dict[str, Path | None] = {}
"""Folders in which functions' machine code is kept, by name; None where it cannot be."""


def _compile(function: _Function, signature: str | None = None) -> _Function:
    """Compile when first called, or for a signature now; keep the machine code on disk where that can be."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    kept.setdefault(function.__name__)
    try:
        folder = Path(numba.njit(cache=True, **options)(function).stats.cache_path)
        kept[function.__name__] = folder
        for index in folder.glob(f"kernel.{function.__name__}-*.nbi"):
            with suppress(OSError):  # another process was first
                if index.stat().st_mtime < Path(__file__).stat().st_mtime:  # it may name types that are gone
                    index.unlink()
        return cast(_Function, numba.njit(signature, cache=True, **options)(function))
    except RuntimeError:  # neither this folder nor the user's cache may be written
        return cast(_Function, numba.njit(signature, **options)(function))


def _inner(function: _Function) -> _Function:
    """Compile for compiled callers alone, which keep the machine code within theirs."""
    options: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(_Function, numba.njit(**options)(function))


def _inline(function: _Function) -> _Function:
    """Compile only as a part of what calls it."""
    return cast(_Function, numba.njit(inline="always", error_model="numpy")(function))


class Plan(NamedTuple):
    """Steps: kind (P,); number (P,) of the operation or mark; constant (P, 12), axis or whole pose."""

    kind: Index
    number: Index
    constant: Array


class FlatChains(NamedTuple):
    """B branches with O operations, K terms, M marks and N measured receivers, numbered throughout.

    depth : side branches within each other at most. rotates, moves : (O,) whether an operation rotates, and
    depends on states. terms_from : (O + 1,) where an operation's terms begin; coefficient, unknown, state :
    (K,), -1 where left out; x_column, y_column : (K,) their places in their branch. mark, receiver : (N,).
    upstream_from : (N + 1,) where the operations `upstream` begin that move a receiver; by_state (N, most s),
    by_unknown (N, most g) : whether a branch's do. receivers_from, states_from, unknowns_from : (B + 1,).
    """

    plan: Plan
    depth: int
    rotates: npt.NDArray[np.bool_]
    moves: npt.NDArray[np.bool_]
    amount: Array
    terms_from: Index
    coefficient: Array
    unknown: Index
    state: Index
    x_column: Index
    y_column: Index
    mark: Index
    receiver: Index
    upstream_from: Index
    upstream: Index
    by_state: npt.NDArray[np.bool_]
    by_unknown: npt.NDArray[np.bool_]
    receivers_from: Index
    states_from: Index
    states: Index
    unknowns_from: Index
    unknowns: Index


class Amounts(NamedTuple):
    """What operations amount to: steady (O,) and so much of the state of each term more (K,)."""

    steady: Array
    slope: Array


class BranchPoses(NamedTuple):
    """States y (S, F) and root (3, 3, F), root_mm (3, F)."""

    y: Array
    root: Array
    root_mm: Array


class MeasuredPoses(NamedTuple):
    """Poses of S receivers, valid (S, F), their sd (S, 2); turned : (S, K, 3, F) by the last K unknowns."""

    rotation: Array
    position_mm: Array
    valid: npt.NDArray[np.bool_]
    sd: Array
    turned: Array


class Prior(NamedTuple):
    """Priors of states, mean (S,) and precision (B, most s, most s); temper and limit of residuals."""

    mean: Array
    precision: Array
    temper: float
    huber: float


class ReachedFrames(NamedTuple):
    """Where chains reach: axis, origin_mm (O, 3, F), rotation (M, 3, 3, F), position_mm (M, 3, F)."""

    axis: Array
    origin_mm: Array
    rotation: Array
    position_mm: Array


class ResidualArrays(NamedTuple):
    """r (N, 6, F), their robust weight (N, F), the cost (F,) of residuals and states' priors."""

    r: Array
    weight: Array
    cost: Array


class EliminatedStates(NamedTuple):
    """A branch's states: inverse (s, s, F), by_rest (s, columns, F) and rhs (s, F) of `Elimination`."""

    inverse: Array
    by_rest: Array
    rhs: Array


@_inner
def _copy(values: Array, out: Array) -> None:
    """Copy (n, F)."""
    for i in range(len(out)):
        for f in range(out.shape[1]):
            out[i, f] = values[i, f]


@_inner
def _copy_matrices(values: Array, out: Array) -> None:
    """Copy (n, m, F)."""
    for i in range(len(out)):
        _copy(values[i], out[i])


def _fill(value: float, out: Array) -> None:
    """Set all of (n, F)."""
    for i in range(len(out)):
        for f in range(out.shape[1]):
            out[i, f] = value


# Compiled now: half a second of what numba then reads is shared by all forks of the warm process.
_fill = _compile(_fill, "void(float64, float64[:, ::1])")


@_inner
def _rotate(R: Array, constant: Array, angle: Array, axis: Array) -> None:
    """Rotate about a constant axis; axis (3, F) : give it in the root's frame."""
    a, b, c = constant[0], constant[1], constant[2]
    n = R.shape[2]
    sine, versine = np.empty(n), np.empty(n)
    for f in range(n):
        sine[f] = math.sin(angle[f])
        versine[f] = 1.0 - math.cos(angle[f])
    for i in range(3):
        for f in range(n):
            x, y, z = R[i, 0, f], R[i, 1, f], R[i, 2, f]
            along = a * x + b * y + c * z
            s, v = sine[f], versine[f]
            axis[i, f] = along
            R[i, 0, f] = x - s * (b * z - c * y) + v * (along * a - x)
            R[i, 1, f] = y - s * (c * x - a * z) + v * (along * b - y)
            R[i, 2, f] = z - s * (a * y - b * x) + v * (along * c - z)


@_inner
def _translate(R: Array, t: Array, constant: Array, distance: Array, axis: Array) -> None:
    """Translate along a constant axis; axis (3, F) : give it in the root's frame."""
    a, b, c = constant[0], constant[1], constant[2]
    for i in range(3):
        for f in range(R.shape[2]):
            along = a * R[i, 0, f] + b * R[i, 1, f] + c * R[i, 2, f]
            axis[i, f] = along
            t[i, f] += along * distance[f]


@_inner
def _move(R: Array, t: Array, constant: Array) -> None:
    """Move by a constant pose (12,): rotation row by row, translation."""
    p, q, r = constant[9], constant[10], constant[11]
    for i in range(3):
        for f in range(R.shape[2]):
            x, y, z = R[i, 0, f], R[i, 1, f], R[i, 2, f]
            t[i, f] += x * p + y * q + z * r
            R[i, 0, f] = x * constant[0] + y * constant[3] + z * constant[6]
            R[i, 1, f] = x * constant[1] + y * constant[4] + z * constant[7]
            R[i, 2, f] = x * constant[2] + y * constant[5] + z * constant[8]


@_inner
def _amount(chains: FlatChains, amounts: Amounts, o: int, y: Array, out: Array) -> None:
    """Amount (F,) of an operation."""
    for f in range(len(out)):
        out[f] = amounts.steady[o]
    for k in range(chains.terms_from[o], chains.terms_from[o + 1]):
        state = chains.state[k]
        if state >= 0:
            for f in range(len(out)):
                out[f] += amounts.slope[k] * y[state, f]


@_compile
def reach(chains: FlatChains, plan: Plan, amounts: Amounts, at: BranchPoses, reached: ReachedFrames) -> None:
    """Go through all chains."""
    R, t = at.root.copy(), at.root_mm.copy()
    left_R = np.empty((chains.depth, *R.shape))
    left_t = np.empty((chains.depth, *t.shape))
    amount = np.empty(R.shape[2])
    depth = 0
    for step in range(len(plan.kind)):
        kind, number, constant = plan.kind[step], plan.number[step], plan.constant[step]
        if kind == ROTATE:
            _amount(chains, amounts, number, at.y, amount)
            _copy(t, reached.origin_mm[number])
            _rotate(R, constant, amount, reached.axis[number])
        elif kind == TRANSLATE:
            _amount(chains, amounts, number, at.y, amount)
            _copy(t, reached.origin_mm[number])
            _translate(R, t, constant, amount, reached.axis[number])
        elif kind == MOVE:
            _move(R, t, constant)
        elif kind == MARK:
            _copy_matrices(R, reached.rotation[number])
            _copy(t, reached.position_mm[number])
        elif kind == LEAVE:
            _copy_matrices(R, left_R[depth])
            _copy(t, left_t[depth])
            depth += 1
        else:
            depth -= 1
            _copy_matrices(left_R[depth], R)
            _copy(left_t[depth], t)


@_inner
def _residual(
    rotation: Array, position_mm: Array, seen: Array, seen_mm: Array, sd: Array, f: int, r: Array
) -> None:
    """Residuals (6, F) of one receiver in one frame."""
    x = position_mm[0, f] - seen_mm[0, f]
    y = position_mm[1, f] - seen_mm[1, f]
    z = position_mm[2, f] - seen_mm[2, f]
    for i in range(3):
        r[i, f] = (seen[0, i, f] * x + seen[1, i, f] * y + seen[2, i, f] * z) / sd[0]
    a = b = c = trace = 0.0
    for k in range(3):
        s0, s1, s2 = seen[k, 0, f], seen[k, 1, f], seen[k, 2, f]
        r0, r1, r2 = rotation[k, 0, f], rotation[k, 1, f], rotation[k, 2, f]
        a += s2 * r1 - s1 * r2
        b += s0 * r2 - s2 * r0
        c += s1 * r0 - s0 * r1
        trace += s0 * r0 + s1 * r1 + s2 * r2
    a, b, c = a / 2, b / 2, c / 2
    sine = math.sqrt(a * a + b * b + c * c)
    factor = 1.0
    if sine > _NO_TURN:
        factor = math.atan2(sine, (trace - 1) / 2) / sine
    r[3, f], r[4, f], r[5, f] = a * factor / sd[1], b * factor / sd[1], c * factor / sd[1]


@_compile
def residuals(
    chains: FlatChains,
    reached: ReachedFrames,
    at: BranchPoses,
    seen: MeasuredPoses,
    prior: Prior,
    out: ResidualArrays,
) -> None:
    """Residuals of every receiver, zero where not valid, and what each frame costs."""
    for f in range(len(out.cost)):
        out.cost[f] = 0.0
    for b in range(len(chains.states_from) - 1):
        states = chains.states[chains.states_from[b] : chains.states_from[b + 1]]
        for i in range(len(states)):
            for j in range(len(states)):
                precision = prior.precision[b, i, j]
                if precision != 0.0:
                    for f in range(len(out.cost)):
                        off = (at.y[states[i], f] - prior.mean[states[i]]) * (
                            at.y[states[j], f] - prior.mean[states[j]]
                        )
                        out.cost[f] += precision * off / 2
    for n in range(len(chains.mark)):
        mark, s = chains.mark[n], chains.receiver[n]
        r, sd = out.r[n], seen.sd[s]
        for f in range(len(out.cost)):
            if not seen.valid[s, f]:
                for i in range(6):
                    r[i, f] = 0.0
                out.weight[n, f] = 1.0
                continue
            _residual(
                reached.rotation[mark],
                reached.position_mm[mark],
                seen.rotation[s],
                seen.position_mm[s],
                sd,
                f,
                r,
            )
            square = 0.0
            for i in range(6):
                square += r[i, f] * r[i, f]
            norm = math.sqrt(square)
            out.weight[n, f] = min(1.0, prior.huber / max(norm, prior.huber))
            rho = prior.huber * (norm - prior.huber / 2) if norm > prior.huber else square / 2
            out.cost[f] += prior.temper * rho


@_inner
def _to_residuals(
    seen: Array, valid: npt.NDArray[np.bool_], r: Array, weight: Array, sd: Array, temper: float
) -> tuple[Array, Array]:
    """Map a receiver's velocity and angular velocity to its weighted residuals, (3, 3, F) each."""
    n = len(weight)
    by_velocity, by_turn = np.empty((3, 3, n)), np.empty((3, 3, n))
    J = np.empty((3, 3))
    for f in range(n):
        scale = math.sqrt(temper * weight[f]) if valid[f] else 0.0
        x, y, z = r[3, f] * sd[1], r[4, f] * sd[1], r[5, f] * sd[1]
        square = x * x + y * y + z * z
        factor = 1 / 12
        if square >= _SMALL**2:
            angle = math.sqrt(square)
            factor = 1 / square - (1 + math.cos(angle)) / (2 * angle * math.sin(angle))
        J[0, 0], J[0, 1], J[0, 2] = (
            1 - factor * (y * y + z * z),
            z / 2 + factor * x * y,
            factor * x * z - y / 2,
        )
        J[1, 0], J[1, 1], J[1, 2] = (
            factor * x * y - z / 2,
            1 - factor * (x * x + z * z),
            x / 2 + factor * y * z,
        )
        J[2, 0], J[2, 1], J[2, 2] = (
            y / 2 + factor * x * z,
            factor * y * z - x / 2,
            1 - factor * (x * x + y * y),
        )
        for i in range(3):
            for j in range(3):
                by_velocity[i, j, f] = seen[j, i, f] * scale / sd[0]
                turn = J[i, 0] * seen[j, 0, f] + J[i, 1] * seen[j, 1, f] + J[i, 2] * seen[j, 2, f]
                by_turn[i, j, f] = turn * scale / sd[1]
    return by_velocity, by_turn


@_inner
def _transform(matrix: Array, vector: Array) -> None:
    """Multiply vectors (3, F) by matrices (3, 3, F) in place."""
    for f in range(vector.shape[1]):
        x, y, z = vector[0, f], vector[1, f], vector[2, f]
        vector[0, f] = matrix[0, 0, f] * x + matrix[0, 1, f] * y + matrix[0, 2, f] * z
        vector[1, f] = matrix[1, 0, f] * x + matrix[1, 1, f] * y + matrix[1, 2, f] * z
        vector[2, f] = matrix[2, 0, f] * x + matrix[2, 1, f] * y + matrix[2, 2, f] * z


@_inner
def _cross(a: Array, b: Array, c: Array, out: Array) -> None:
    """Cross product of a with b - c, (3, F) each."""
    for f in range(out.shape[1]):
        x, y, z = b[0, f] - c[0, f], b[1, f] - c[1, f], b[2, f] - c[2, f]
        out[0, f] = a[1, f] * z - a[2, f] * y
        out[1, f] = a[2, f] * x - a[0, f] * z
        out[2, f] = a[0, f] * y - a[1, f] * x


@_inner
def _add(values: Array, factor: float, out: Array) -> None:
    """Add so many times (3, F)."""
    for i in range(3):
        for f in range(out.shape[1]):
            out[i, f] += factor * values[i, f]


@_inner
def _add_each(values: Array, factor: float, times: Array, out: Array) -> None:
    """Add so many times (3, F), in each frame as many times more (F,)."""
    for i in range(3):
        for f in range(out.shape[1]):
            out[i, f] += factor * times[f] * values[i, f]


@_inner
def _by_terms(
    chains: FlatChains, amounts: Amounts, o: int, y: Array, by: Array, row: int, J_y: Array, J: Array
) -> None:
    """Add by (3, F), derivatives by an operation's amount, to three rows of those by states and unknowns."""
    for k in range(chains.terms_from[o], chains.terms_from[o + 1]):
        state, unknown = chains.state[k], chains.unknown[k]
        if state >= 0:
            _add(by, amounts.slope[k], J_y[chains.y_column[k], row : row + 3])
        if len(J) > 6 and unknown >= 0:
            out = J[6 + chains.x_column[k], row : row + 3]
            if state >= 0:
                _add_each(by, chains.coefficient[k], y[state], out)
            else:
                _add(by, chains.coefficient[k], out)


@_compile
def jacobian(
    chains: FlatChains,
    amounts: Amounts,
    reached: ReachedFrames,
    at: BranchPoses,
    seen: MeasuredPoses,
    current: ResidualArrays,
    temper: float,
    b: int,
    J_y: Array,
    J: Array,
) -> None:
    """A branch's derivatives by states J_y (s, m, F), root and unknowns J (columns, m, F), or root."""
    first, n_receivers = chains.receivers_from[b], chains.receivers_from[b + 1] - chains.receivers_from[b]
    free_x = len(J) > 6
    velocity = np.empty(at.root_mm.shape)
    for column in range(len(J_y)):
        _fill(0.0, J_y[column])
    for column in range(len(J)):
        _fill(0.0, J[column])
    for i in range(n_receivers):
        n, row = first + i, 6 * i
        top, low = slice(row, row + 3), slice(row + 3, row + 6)
        position_mm = reached.position_mm[chains.mark[n]]
        for u in range(chains.upstream_from[n], chains.upstream_from[n + 1]):
            o = chains.upstream[u]
            if not (free_x or chains.moves[o]):
                continue
            axis = reached.axis[o]
            if chains.rotates[o]:
                _cross(axis, position_mm, reached.origin_mm[o], velocity)
                _by_terms(chains, amounts, o, at.y, velocity, row, J_y, J)
                _by_terms(chains, amounts, o, at.y, axis, row + 3, J_y, J)
            else:
                _by_terms(chains, amounts, o, at.y, axis, row, J_y, J)
        for k in range(3):
            for j in range(3):
                for f in range(J.shape[2]):
                    J[k, row + j, f] = J[3 + k, row + 3 + j, f] = at.root[j, k, f]
            _cross(J[k, top], position_mm, at.root_mm, J[3 + k, top])
        s = chains.receiver[n]
        if free_x:
            n_turned = seen.turned.shape[1]
            for k in range(n_turned):
                _copy(seen.turned[s, k], J[len(J) - n_turned + k, low])
        by_velocity, by_turn = _to_residuals(
            seen.rotation[s], seen.valid[s], current.r[n], current.weight[n], seen.sd[s], temper
        )
        for column in range(len(J_y)):
            if chains.by_state[n, column]:
                _transform(by_velocity, J_y[column, top])
                _transform(by_turn, J_y[column, low])
        for column in range(len(J)):
            if column < 6 or chains.by_unknown[n, column - 6]:
                _transform(by_velocity, J[column, top])
                _transform(by_turn, J[column, low])


@_inner
def _add_product(a: Array, b: Array, rows: slice, factor: float, out: Array) -> None:
    """Add so many times the sum over rows of products of (m, F), to (F,)."""
    for k in range(rows.start, rows.stop):
        for f in range(len(out)):
            out[f] += factor * a[k, f] * b[k, f]


@_inner
def _inverse_cholesky(A: Array, inverse: Array) -> None:
    """Inverses of the lower Cholesky factors of (n, n, F), of which the lower triangles are used up."""
    n, n_frames = len(A), A.shape[2]
    for j in range(n):
        _fill(0.0, inverse[j])
        for i in range(j, n):
            for k in range(j):
                for f in range(n_frames):
                    A[i, j, f] -= A[i, k, f] * A[j, k, f]
            if i == j:
                for f in range(n_frames):
                    inverse[j, j, f] = 1.0 / math.sqrt(A[j, j, f])
            for f in range(n_frames):
                A[i, j, f] *= inverse[j, j, f]
    for i in range(n):
        for j in range(i):
            for k in range(j, i):
                for f in range(n_frames):
                    inverse[i, j, f] -= A[i, k, f] * inverse[k, j, f]
            for f in range(n_frames):
                inverse[i, j, f] *= inverse[i, i, f]


@_inner
def _by_lower(inverse: Array, B: Array, out: Array) -> None:
    """Lower triangles (n, n, F) times (n, F)."""
    _fill(0.0, out)
    for i in range(len(inverse)):
        for j in range(i + 1):
            for f in range(out.shape[1]):
                out[i, f] += inverse[i, j, f] * B[j, f]


@_compile
def eliminate(
    chains: FlatChains,
    current: ResidualArrays,
    at: BranchPoses,
    prior: Prior,
    damping: Array,
    b: int,
    J_y: Array,
    J: Array,
    out: EliminatedStates,
) -> Array:
    """Eliminate a branch's states; give its weighted residuals (m, F)."""
    first, last = chains.receivers_from[b], chains.receivers_from[b + 1]
    states = chains.states[chains.states_from[b] : chains.states_from[b + 1]]
    n_states, n_frames = len(J_y), J_y.shape[2]
    r = np.empty((6 * (last - first), n_frames))
    A, B = np.zeros((n_states, n_states, n_frames)), np.zeros((n_states, n_frames))
    for i in range(last - first):
        for k in range(6):
            for f in range(n_frames):
                r[6 * i + k, f] = current.r[first + i, k, f] * math.sqrt(
                    prior.temper * current.weight[first + i, f]
                )
    for i in range(n_states):
        for j in range(n_states):
            precision = prior.precision[b, i, j]
            if precision != 0.0:
                for f in range(n_frames):
                    A[i, j, f] = precision
                    B[i, f] += precision * (at.y[states[j], f] - prior.mean[states[j]])
        for n in range(first, last):
            rows = slice(6 * (n - first), 6 * (n - first) + 6)
            if chains.by_state[n, i]:
                _add_product(J_y[i], r, rows, 1.0, B[i])
                for j in range(i + 1):
                    if chains.by_state[n, j]:
                        _add_product(J_y[i], J_y[j], rows, 1.0, A[i, j])
        for f in range(n_frames):
            A[i, i, f] *= 1.0 + damping[f]
    _inverse_cholesky(A, out.inverse)
    _by_lower(out.inverse, B, out.rhs)
    for column in range(len(J)):
        _fill(0.0, B)
        for n in range(first, last):
            if column < 6 or chains.by_unknown[n, column - 6]:
                rows = slice(6 * (n - first), 6 * (n - first) + 6)
                for i in range(n_states):
                    if chains.by_state[n, i]:
                        _add_product(J_y[i], J[column], rows, 1.0, B[i])
        _by_lower(out.inverse, B, out.by_rest[column])
    return r


@_compile
def add_to_root(
    chains: FlatChains,
    b: int,
    J: Array,
    r: Array,
    part: EliminatedStates,
    H_rr: Array,
    H_xr: Array,
    g_r: Array,
) -> None:
    """Add what a branch says of roots (6, 6, F), also by unknowns (G, 6, F), and their gradient (6, F)."""
    first, last = chains.receivers_from[b], chains.receivers_from[b + 1]
    unknowns = chains.unknowns[chains.unknowns_from[b] : chains.unknowns_from[b + 1]]
    every, states = slice(0, len(r)), slice(0, len(part.rhs))
    for i in range(6):
        _add_product(J[i], r, every, 1.0, g_r[i])
        _add_product(part.by_rest[i], part.rhs, states, -1.0, g_r[i])
        for j in range(i + 1):
            _add_product(J[i], J[j], every, 1.0, H_rr[i, j])
            _add_product(part.by_rest[i], part.by_rest[j], states, -1.0, H_rr[i, j])
        for column in range(6, len(J)):
            out = H_xr[unknowns[column - 6], i]
            for n in range(first, last):
                if chains.by_unknown[n, column - 6]:
                    _add_product(J[i], J[column], slice(6 * (n - first), 6 * (n - first) + 6), 1.0, out)
            _add_product(part.by_rest[i], part.by_rest[column], states, -1.0, out)


@_inner
def _solve_root(H_rr: Array, g_r: Array, damping: Array, inverse: Array, rhs: Array) -> None:
    """Eliminate roots: inverse (6, 6, F) and rhs (6, F) of `Reduced`."""
    for i in range(6):
        for f in range(len(damping)):
            H_rr[i, i, f] = H_rr[i, i, f] * (1.0 + damping[f]) + _SOME_ROOT
    _inverse_cholesky(H_rr, inverse)
    _by_lower(inverse, g_r, rhs)


@_compile
def reduce_roots(
    H_rr: Array, H_xr: Array, g_r: Array, damping: Array, inverse: Array, rhs: Array, by_x: Array
) -> None:
    """Eliminate roots; by_x (G, 6, F) : how they move with the unknowns, as in `Reduced`."""
    _solve_root(H_rr, g_r, damping, inverse, rhs)
    for g in range(len(H_xr)):
        _by_lower(inverse, H_xr[g], by_x[g])


@_inner
def _by_upper(inverse: Array, B: Array, out: Array) -> None:
    """Transposed lower triangles (n, n, F) times (n, F)."""
    _fill(0.0, out)
    for i in range(len(inverse)):
        for j in range(i, len(inverse)):
            for f in range(out.shape[1]):
                out[i, f] += inverse[j, i, f] * B[j, f]


@_compile
def step_states(states: npt.NDArray[np.int64], part: EliminatedStates, rest: Array, y: Array) -> None:
    """Take the step of a branch's states that goes with that of root and unknowns, rest (columns, F)."""
    rhs, step = part.rhs.copy(), np.empty(part.rhs.shape)
    for column in range(len(rest)):
        for i in range(len(rhs)):
            for f in range(rhs.shape[1]):
                rhs[i, f] += part.by_rest[column, i, f] * rest[column, f]
    _by_upper(part.inverse, rhs, step)
    for i in range(len(states)):
        for f in range(rhs.shape[1]):
            y[states[i], f] -= step[i, f]


@_compile
def step_root(d_root: Array, root: Array, root_mm: Array) -> None:
    """Move roots by d_root (6, F), mm and rotation vector in their own axes."""
    E, row = np.empty((3, 3)), np.empty(3)
    for f in range(d_root.shape[1]):
        for i in range(3):
            for k in range(3):
                root_mm[i, f] += root[i, k, f] * d_root[k, f]
        x, y, z = d_root[3, f], d_root[4, f], d_root[5, f]
        square = x * x + y * y + z * z
        angle = math.sqrt(square)
        once, twice = 1.0, 0.5
        if angle > 0.0:
            once, twice = math.sin(angle) / angle, 2.0 * (math.sin(angle / 2) / angle) ** 2
        E[0, 0], E[0, 1], E[0, 2] = (
            1 - twice * (square - x * x),
            twice * x * y - once * z,
            twice * x * z + once * y,
        )
        E[1, 0], E[1, 1], E[1, 2] = (
            twice * x * y + once * z,
            1 - twice * (square - y * y),
            twice * y * z - once * x,
        )
        E[2, 0], E[2, 1], E[2, 2] = (
            twice * x * z - once * y,
            twice * y * z + once * x,
            1 - twice * (square - z * z),
        )
        for i in range(3):
            for k in range(3):
                row[k] = root[i, 0, f] * E[0, k] + root[i, 1, f] * E[1, k] + root[i, 2, f] * E[2, k]
            for k in range(3):
                root[i, k, f] = row[k]


@_inner
def _stay(R: Array, t: Array) -> None:
    """Make a pose (3, 3, 1), (3, 1) that moves nothing."""
    for i in range(3):
        t[i, 0] = 0.0
        for j in range(3):
            R[i, j, 0] = 1.0 if i == j else 0.0


@_compile
def condense(chains: FlatChains, amounts: Amounts) -> Plan:
    """The plan with what stays between moving operations as one constant move."""
    plan = chains.plan
    kind, number, constant = (
        np.empty_like(plan.kind),
        np.empty_like(plan.number),
        np.empty_like(plan.constant),
    )
    R, t, amount, no_axis = np.empty((3, 3, 1)), np.empty((3, 1)), np.empty(1), np.empty((3, 1))
    n, pending = 0, False
    _stay(R, t)
    for step in range(len(plan.kind)):
        what, o = plan.kind[step], plan.number[step]
        if what == MOVE or (what in (ROTATE, TRANSLATE) and not chains.moves[o]):
            amount[0] = amounts.steady[o]
            if what == MOVE:
                _move(R, t, plan.constant[step])
            elif what == ROTATE:
                _rotate(R, plan.constant[step], amount, no_axis)
            else:
                _translate(R, t, plan.constant[step], amount, no_axis)
            pending = True
            continue
        if pending:
            kind[n], number[n] = MOVE, 0
            for i in range(3):
                constant[n, 9 + i] = t[i, 0]
                for j in range(3):
                    constant[n, 3 * i + j] = R[i, j, 0]
            _stay(R, t)
            n, pending = n + 1, False
        kind[n], number[n] = what, o
        for i in range(12):
            constant[n, i] = plan.constant[step, i]
        n += 1
    return Plan(kind[:n], number[:n], constant[:n])


class Room(NamedTuple):
    """Where a block of frames is posed: the point tried, residuals at the current one; roots' step."""

    tried: BranchPoses
    reached: ReachedFrames
    current: ResidualArrays
    J_y: Array
    J: Array
    inverse: Array
    by_rest: Array
    rhs: Array
    H_rr: Array
    H_xr: Array
    g_r: Array
    root_inverse: Array
    root_rhs: Array
    d_root: Array


@_inline
def _step(
    chains: FlatChains,
    amounts: Amounts,
    seen: MeasuredPoses,
    prior: Prior,
    damping: Array,
    at: BranchPoses,
    room: Room,
) -> None:
    """Try the step from a point where `reach` and `residuals` were, x being fixed."""
    for i in range(6):
        _fill(0.0, room.H_rr[i])
    _fill(0.0, room.g_r)
    for b in range(len(chains.states_from) - 1):
        n_states = chains.states_from[b + 1] - chains.states_from[b]
        part = EliminatedStates(room.inverse[b, :n_states], room.by_rest[b], room.rhs[b, :n_states])
        J_y = room.J_y[:n_states]
        jacobian(chains, amounts, room.reached, at, seen, room.current, prior.temper, b, J_y, room.J)
        r = eliminate(chains, room.current, at, prior, damping, b, J_y, room.J, part)
        add_to_root(chains, b, room.J, r, part, room.H_rr, room.H_xr, room.g_r)
    _solve_root(room.H_rr, room.g_r, damping, room.root_inverse, room.root_rhs)
    _by_upper(room.root_inverse, room.root_rhs, room.d_root)
    for i in range(6):
        for f in range(len(damping)):
            room.d_root[i, f] = -room.d_root[i, f]
    _copy(at.y, room.tried.y)
    _copy_matrices(at.root, room.tried.root)
    _copy(at.root_mm, room.tried.root_mm)
    for b in range(len(chains.states_from) - 1):
        states = chains.states[chains.states_from[b] : chains.states_from[b + 1]]
        part = EliminatedStates(room.inverse[b, : len(states)], room.by_rest[b], room.rhs[b, : len(states)])
        step_states(states, part, room.d_root, room.tried.y)
    step_root(room.d_root, room.tried.root, room.tried.root_mm)


@_inline
def _take(f: int, tried: BranchPoses, at: BranchPoses) -> None:
    """Copy one frame of poses."""
    for i in range(len(at.y)):
        at.y[i, f] = tried.y[i, f]
    for i in range(3):
        at.root_mm[i, f] = tried.root_mm[i, f]
        for j in range(3):
            at.root[i, j, f] = tried.root[i, j, f]


@_inline
def _evaluate(
    chains: FlatChains,
    plan: Plan,
    amounts: Amounts,
    seen: MeasuredPoses,
    prior: Prior,
    at: BranchPoses,
    room: Room,
) -> None:
    reach(chains, plan, amounts, at, room.reached)
    residuals(chains, room.reached, at, seen, prior, room.current)


@_compile
def pose(
    chains: FlatChains,
    plan: Plan,
    amounts: Amounts,
    seen: MeasuredPoses,
    prior: Prior,
    steps: int,
    least_gain: float,
    at: BranchPoses,
    room: Room,
) -> None:
    """Fit states and roots, in place, x fixed, each frame while a step gains least_gain; plan : condensed."""
    n_going = n = len(room.current.cost)
    goes_on, damping, cost = np.ones(n, np.bool_), np.empty(n), np.empty(n)
    _evaluate(chains, plan, amounts, seen, prior, at, room)
    for f in range(n):
        cost[f], damping[f] = room.current.cost[f], _FIRST_DAMPING
    for _ in range(steps):
        _step(chains, amounts, seen, prior, damping, at, room)
        _evaluate(chains, plan, amounts, seen, prior, room.tried, room)
        back = False
        for f in range(n):
            if goes_on[f] and room.current.cost[f] <= cost[f]:
                goes_on[f] = cost[f] - room.current.cost[f] > least_gain * cost[f]
                n_going -= not goes_on[f]
                cost[f] = room.current.cost[f]
                damping[f] /= _DAMPING_STEP
                _take(f, room.tried, at)
            elif goes_on[f]:
                damping[f] *= _DAMPING_STEP
                back = True
        if not n_going:
            break
        if back:
            _evaluate(chains, plan, amounts, seen, prior, at, room)
