"""The chains of a hand as arrays, all branches one after the other, as compiled code reads them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from shukotsu.skeleton.rotations import Array
from shukotsu.stages.fit_hand.kernel import LEAVE, MARK, MOVE, RETURN, ROTATE, TRANSLATE, FlatChains, Plan
from shukotsu.stages.fit_hand.operations import Branch, Index, Operation

_KINDS = {
    "rotate": ROTATE,
    "translate": TRANSLATE,
    "turn": MOVE,
    "mark": MARK,
    "leave": LEAVE,
    "return": RETURN,
}


@lru_cache(maxsize=64)
def flat_chains(
    branches: tuple[Branch, ...],
    receivers: tuple[tuple[tuple[int, int], ...], ...],
    shared: tuple[int, ...] = (),
) -> FlatChains:
    """Lay out branches with their receivers, pairs (mark in the branch, receiver in frames).

    shared : unknowns that move no chain but are seen by every receiver; the last of each branch's.
    """
    operations = [operation for branch in branches for operation in branch.operations]
    terms = [_terms(operation) for operation in operations]
    first_operation = _from(len(branch.operations) for branch in branches)
    first_mark = _from(len(branch.marks) for branch in branches)
    in_branch = np.repeat(np.arange(len(branches)), np.diff(first_operation))
    flat = np.array([term for own in terms for term in own], float).reshape(-1, 3)
    coefficient, (unknown, state) = flat[:, 0].copy(), flat[:, 1:].T.astype(int)
    of_branch = np.repeat(in_branch, [len(own) for own in terms])
    measured = [(b, mark, s) for b, own in enumerate(receivers) for mark, s in own]
    upstream = [first_operation[b] + np.flatnonzero(branches[b].upstream[mark]) for b, mark, _ in measured]
    terms_from = _from(map(len, terms))
    x_column = _columns(of_branch, unknown, [branch.unknowns for branch in branches])
    y_column = _columns(of_branch, state, [branch.states for branch in branches])
    by_unknown = np.pad(_touched(upstream, terms_from, x_column), ((0, 0), (0, len(shared))))
    for row, (b, *_) in zip(by_unknown, measured, strict=True):
        row[len(branches[b].unknowns) :][: len(shared)] = True
    return FlatChains(
        _plan(branches, first_operation, first_mark),
        1 + sum(kind == "leave" for branch in branches for kind, *_ in branch.plan),
        np.array([operation.rotates for operation in operations], bool),
        np.array([any(s >= 0 for *_, s in own) for own in terms], bool),
        np.array([operation.constant for operation in operations], float),
        terms_from,
        coefficient,
        unknown.copy(),
        state.copy(),
        x_column,
        y_column,
        np.array([first_mark[b] + mark for b, mark, _ in measured], int),
        np.array([s for *_, s in measured], int),
        _from(map(len, upstream)),
        np.concatenate([np.zeros(0, int), *upstream]),
        _touched(upstream, terms_from, y_column),
        by_unknown,
        _from(map(len, receivers)),
        _from(len(branch.states) for branch in branches),
        np.concatenate([branch.states for branch in branches]).astype(int),
        _from(len(branch.unknowns) + len(shared) for branch in branches),
        np.concatenate([np.append(branch.unknowns, shared) for branch in branches]).astype(int),
    )


def _terms(operation: Operation) -> list[tuple[float, int, int]]:
    """Coefficient, unknown and state of every term, -1 where a factor is left out."""
    return [
        (
            term.coefficient,
            -1 if term.unknown is None else term.unknown,
            -1 if term.state is None else term.state,
        )
        for term in operation.terms
    ]


def _from(lengths: Iterable[int]) -> Index:
    """Return where each part begins, and the last ends, when they are put one after the other."""
    return np.cumsum([0, *lengths])


def _plan(branches: Sequence[Branch], first_operation: Index, first_mark: Index) -> Plan:
    """Every branch left and returned from at the root."""
    steps: list[tuple[int, int, Array]] = []
    for branch, operation, mark in zip(branches, first_operation, first_mark, strict=False):
        steps.append((LEAVE, 0, np.zeros(12)))
        for kind, index, given in branch.plan:
            first = operation if kind in ("rotate", "translate") else mark if kind == "mark" else 0
            constant = np.zeros(12)
            constant[: given.size] = given.ravel()
            steps.append((_KINDS[kind], int(first) + index, constant))
        steps.append((RETURN, 0, np.zeros(12)))
    kinds, places, constants = zip(*steps, strict=True)
    return Plan(np.array(kinds, int), np.array(places, int), np.array(constants))


def _columns(of_branch: Index, index: Index, own: Sequence[Index]) -> Index:
    """Place (K,) of each term's factor among its branch's own, -1 where it has none."""
    places = [{int(i): place for place, i in enumerate(indices)} for indices in own]
    return np.array([places[b].get(int(i), -1) for b, i in zip(of_branch, index, strict=True)], int)


def _touched(upstream: Sequence[Index], terms_from: Index, column: Index) -> npt.NDArray[np.bool_]:
    """Whether each receiver (N, columns) is moved by what is in that column."""
    out = np.zeros((len(upstream), int(column.max(initial=-1)) + 1), bool)
    for own, operations in zip(out, upstream, strict=True):
        for o in operations:
            columns = column[terms_from[o] : terms_from[o + 1]]
            own[columns[columns >= 0]] = True
    return out
