"""Chains of elementary operations, and the derivatives of the poses that they reach.

A bone is reached from the root by rotations about, and translations along, constant axes. The amount of each
is linear in the unknowns of the hand (x), in the joint angles of a frame (y), or in products of one of each.
Then every derivative is a cross product: per unit of its amount, a rotation with origin t_i and axis w, both
in the root's frame, moves a point at t by w x (t - t_i) and turns it by w; a translation moves it by w.

On paper: docs/whole-hand.md, section 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shukotsu.arrays import Index as Index
from shukotsu.hand.rotations import Array, cross

NOTHING: Array = np.empty(0)


@dataclass(frozen=True)
class Term:
    """A term coefficient * x[unknown] * y[state] of an amount; a factor whose index is None is omitted."""

    coefficient: float
    unknown: int | None = None
    state: int | None = None


@dataclass(frozen=True)
class Operation:
    """A rotation (rad) or translation (mm) by the sum of its terms, on a unit axis in the frame reached."""

    rotates: bool
    axis: Array
    constant: float = 0.0
    terms: tuple[Term, ...] = ()


@dataclass(frozen=True)
class Turn:
    """A constant rotation matrix (3, 3)."""

    rotation: Array


@dataclass(frozen=True)
class Mark:
    """A name for the frame reached here, for instance of a bone or a receiver."""

    name: str


@dataclass(frozen=True)
class Side:
    """A side branch; the steps after it continue from the frame in which it starts."""

    steps: tuple[Step, ...]


Step = Operation | Turn | Mark | Side


@dataclass(frozen=True)
class Reached:
    """Poses of M marks, and axis and origin of O operations, over F frames in the root's frame.

    rotation : (M, F, 3, 3), position_mm : (M, F, 3) of the marks. axis, origin_mm : (O, F, 3) of the
    operations.
    """

    rotation: Array
    position_mm: Array
    axis: Array
    origin_mm: Array


class Branch:
    """A chain of steps from the root with its side branches, prepared for evaluation.

    Attributes
    ----------
    plan : list of (str, int, array)
        Kind of each step in order, index of its operation or mark, and its constant axis or rotation.
    marks : tuple of str
        Names of the M marks.
    operations : tuple of Operation
        The O operations.
    upstream : array of bool, shape (M, O)
        Which operations precede a mark.
    unknowns, states : array of int
        Indices into x and y on which the operations depend.

    """

    def __init__(self, steps: Sequence[Step]) -> None:
        self.plan: list[tuple[str, int, Array]] = []
        operations: list[Operation] = []
        upstream: dict[str, list[int]] = {}
        self._lay_out(steps, [], operations, upstream)
        self.marks = tuple(upstream)
        self.operations = tuple(operations)
        self._rotates = np.array([operation.rotates for operation in operations], bool)
        self.upstream = np.zeros((len(upstream), len(operations)), bool)
        for mark, before in enumerate(upstream.values()):
            self.upstream[mark, before] = True
        terms = [(index, term) for index, operation in enumerate(operations) for term in operation.terms]
        self._set_terms(terms)

    def _lay_out(
        self,
        steps: Sequence[Step],
        before: list[int],
        operations: list[Operation],
        upstream: dict[str, list[int]],
    ) -> None:
        """Append steps to the plan; before : indices of the operations that precede them."""
        before = list(before)
        for step in steps:
            if isinstance(step, Operation):
                before.append(len(operations))
                self.plan.append(("rotate" if step.rotates else "translate", len(operations), step.axis))
                operations.append(step)
            elif isinstance(step, Turn):
                self.plan.append(("turn", 0, step.rotation))
            elif isinstance(step, Mark):
                self.plan.append(("mark", len(upstream), NOTHING))
                upstream[step.name] = list(before)
            else:
                self.plan.append(("leave", 0, NOTHING))
                self._lay_out(step.steps, before, operations, upstream)
                self.plan.append(("return", 0, NOTHING))

    def _set_terms(self, terms: Sequence[tuple[int, Term]]) -> None:
        """Distribute all terms (operation, term) to the matrices of the derivatives."""
        unknowns = {term.unknown for _, term in terms if term.unknown is not None}
        states = {term.state for _, term in terms if term.state is not None}
        self.unknowns: Index = np.array(sorted(unknowns), int)
        self.states: Index = np.array(sorted(states), int)
        x_at = {int(index): i for i, index in enumerate(self.unknowns)}
        y_at = {int(index): i for i, index in enumerate(self.states)}
        n_operations = len(self._rotates)
        self._by_unknown = np.zeros((n_operations, len(self.unknowns)))
        self._by_state = np.zeros((n_operations, len(self.states)))
        products = []
        for o, term in terms:
            if term.unknown is None and term.state is not None:
                self._by_state[o, y_at[term.state]] += term.coefficient
            elif term.unknown is not None and term.state is None:
                self._by_unknown[o, x_at[term.unknown]] += term.coefficient
            elif term.unknown is not None and term.state is not None:
                products.append((o, x_at[term.unknown], y_at[term.state], term.coefficient))
        self._product_at: Index = np.array([p[:3] for p in products], int).reshape(-1, 3)
        self._product = np.array([p[3] for p in products])
        select = np.zeros((len(products), len(self.unknowns)))
        select[np.arange(len(products)), self._product_at[:, 1]] = self._product
        self._by_unknown_and_product = np.concatenate([self._by_unknown, select])

    def receivers(self, names: Sequence[str]) -> tuple[tuple[int, int], ...]:
        """Return the marks that are receivers of `names`, as pairs of mark and index into `names`."""
        numbers = {f"receiver {name}": i for i, name in enumerate(names)}
        return tuple((mark, numbers[name]) for mark, name in enumerate(self.marks) if name in numbers)

    def per_state(self, x: Array) -> Array:
        """Compute the derivative of every operation's amount by the branch's own states.

        Parameters
        ----------
        x : array, shape (G,)
            The hand's unknowns.

        Returns
        -------
        array, shape (O, s)
            Derivatives, mm or rad per rad.

        """
        by_state = self._by_state.copy()
        o, g, s = self._product_at.T
        np.add.at(by_state, (o, s), self._product * x[self.unknowns][g])
        return np.asarray(by_state)

    def by_operation(self, reached: Reached, marks: Sequence[int]) -> Array:
        """Differentiate marks' poses by the operations' amounts (docs/whole-hand.md, section 2).

        Parameters
        ----------
        reached : Reached
            Poses that this branch reached.
        marks : sequence of int
            Indices of M marks.

        Returns
        -------
        array, shape (M, F, 6, O)
            Three rows of position, mm, and three of rotation, rad, in the root's frame.

        """
        out = np.zeros((len(marks), reached.axis.shape[1], 6, len(self._rotates)))
        for i, mark in enumerate(marks):
            turning, sliding = (self.upstream[mark] & self._rotates, self.upstream[mark] & ~self._rotates)
            axis, origin_mm = reached.axis[turning], reached.origin_mm[turning]
            out[i, :, :3, turning] = cross(axis, reached.position_mm[mark] - origin_mm)
            out[i, :, 3:, turning] = axis
            out[i, :, :3, sliding] = reached.axis[sliding]
        return out

    def by_unknown(self, by_operation: Array, y: Array) -> Array:
        """Compute derivatives by the branch's own unknowns from those by its operations' amounts.

        Parameters
        ----------
        by_operation : array, shape (..., F, 6, O)
            Derivatives as returned by `by_operation`.
        y : array, shape (F, S)
            Joint angles, rad.

        Returns
        -------
        array, shape (..., F, 6, g)
            Three rows of position, mm, and three of rotation, rad.

        """
        o, _, s = self._product_at.T
        products = by_operation[..., o] * y[:, self.states][:, s][:, None, :]
        return np.asarray(np.concatenate([by_operation, products], -1) @ self._by_unknown_and_product)
