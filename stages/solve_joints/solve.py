"""Every joint of a hand, from one streaming pass over its calibration recordings."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from schemas.layout import Joint, Layout
from schemas.model import SkeletonModel
from schemas.poses import Poses, ReceiverSeries, frame_count, read_poses, receiver_series
from stages.solve_joints.anatomical import HandFit, HandSample, fit_hand, solutions
from stages.solve_joints.closed import JointSolution, is_solvable, solve_closed
from stages.solve_joints.moments import JointMoments, RelativePoses, relative_poses
from stages.solve_joints.stacked import solve_stacked

KEPT_SOLUTIONS = 8
"""Hands whose solution is kept for other models with the same settings."""

KEPT_BYTES = 64 * 10**6
"""Of the sums over the last recordings; longer recordings are gone through again."""

_Key = tuple[object, ...]
_solved: OrderedDict[_Key, dict[str, JointSolution | str]] = OrderedDict()
_streamed: dict[_Key, Streamed] = {}


def solve_recordings(
    paths: Sequence[Path],
    layout: Layout,
    model: SkeletonModel,
    hand: str = "right",
    hand_length_mm: float | None = None,
) -> dict[str, JointSolution | str]:
    """Solve every joint between two receivers; a joint without an answer has the reason instead.

    hand, hand_length_mm : whose anatomy to expect, for the solver `anatomical` alone. The arrays cannot be
    written to: models that differ in nothing that the solution depends on get the same one.
    """
    anatomy = (hand, hand_length_mm) if model.solver == "anatomical" else ()
    key = (_source(paths, layout), model.solver, model.singular_values, anatomy)
    if key not in _solved:
        found = _solve(paths, layout, model, hand, hand_length_mm)
        for solution in found.values():
            for value in () if isinstance(solution, str) else vars(solution).values():
                if isinstance(value, np.ndarray):
                    value.flags.writeable = False
        _solved[key] = found
        if len(_solved) > KEPT_SOLUTIONS:
            _solved.popitem(last=False)
    _solved.move_to_end(key)
    return dict(_solved[key])


def _solve(
    paths: Sequence[Path], layout: Layout, model: SkeletonModel, hand: str, hand_length_mm: float | None
) -> dict[str, JointSolution | str]:
    by_anatomy = model.solver == "anatomical"
    streamed = stream(paths, layout, spread=by_anatomy)
    moments, found = streamed.moments, dict[str, JointSolution | str]()
    solved = solutions(streamed.fit(layout, hand, hand_length_mm), moments) if by_anatomy else {}
    for index, joint in enumerate(layout.solvable):
        if by_anatomy and joint.name in solved:
            found[joint.name] = solved[joint.name]
        elif not by_anatomy and is_solvable(moments, index):
            solution = solve_closed(moments, index, model.singular_values)
            if model.solver == "stacked-svd":
                solution = _by_stack(solution, paths, joint, model.singular_values)
            found[joint.name] = solution
        else:
            found[joint.name] = _reason(joint, streamed.seen, int(moments.count[index]))
    return found


def _source(paths: Sequence[Path], layout: Layout) -> _Key:
    """What sums over recordings depend on: the files, told apart as `make` does, and the layout's content."""
    stats = [(path.absolute(), path.stat()) for path in paths]
    return (*((path, stat.st_size, stat.st_mtime_ns) for path, stat in stats), repr(layout))


@dataclass
class Streamed:
    """Recordings gone through once: moments of every joint, and which segments had a valid pose.

    sample : frames spread over the postures, where they were asked for.
    """

    moments: JointMoments
    seen: dict[str, bool]
    sample: HandSample | None
    _fits: dict[_Key, HandFit | None] = field(default_factory=dict)

    def fit(self, layout: Layout, hand: str, hand_length_mm: float | None) -> HandFit | None:
        """Weigh the sample against anatomy, see `fit_hand`; the layout is that of the recordings."""
        if self.sample is None:
            raise ValueError("the frames were not sampled")
        if (hand, hand_length_mm) not in self._fits:
            fit = fit_hand(self.sample, self.moments, layout, hand, hand_length_mm)
            self._fits = {(hand, hand_length_mm): fit}
        return self._fits[hand, hand_length_mm]


def stream(paths: Sequence[Path], layout: Layout, *, spread: bool) -> Streamed:
    """Go through recordings once; those of a hand that was gone through last are not read again.

    spread : whether to sample frames of the layout's solvable joints along the way.
    """
    key = _source(paths, layout)
    kept = _streamed.get(key)
    if kept is not None and (kept.sample is not None or not spread):
        return kept
    moments = JointMoments(len(layout.solvable), sum(map(frame_count, paths)))
    sample = HandSample(layout.solvable) if spread else None
    seen = dict.fromkeys(layout.measured, False)
    for path in paths:
        for series in receiver_series(path, layout.measured):
            relative = _joints_of(series, layout.solvable)
            moments.add(relative)
            if sample is not None:
                sample.add(relative)
            for segment in series:
                seen[segment] |= bool(series[segment].valid.any())
            del relative  # or two row groups would be in memory
    found = Streamed(moments, seen, sample)
    _streamed.clear()
    if moments.nbytes <= KEPT_BYTES:
        _streamed[key] = found
    return found


def _joints_of(series: Mapping[str, ReceiverSeries], joints: Sequence[Joint]) -> RelativePoses:
    n_frames = len(next(iter(series.values())).valid)
    parents = tuple(series.get(joint.parent_receiver) for joint in joints)
    return RelativePoses(parents, tuple(series.get(joint.child) for joint in joints), n_frames)


def add_block(moments: JointMoments, block: Poses, joints: Sequence[Joint]) -> RelativePoses:
    """Add a block of poses to the moments of those joints; give the joints' relative poses."""
    parents = np.array([block.index(joint.parent_receiver) for joint in joints])
    children = np.array([block.index(joint.child) for joint in joints])
    relative = relative_poses(block.quaternion, block.position_mm, block.valid, parents, children)
    moments.add(relative)
    return relative


def _by_stack(
    closed: JointSolution, paths: Sequence[Path], joint: Joint, n_singular_values: int
) -> JointSolution:
    """The same joint by the stacked SVD; what only the moments tell (precision, range) is kept."""
    pairs = [read_poses(path, (joint.parent_receiver, joint.child)) for path in paths]
    valid = np.concatenate([pair.valid.all(1) for pair in pairs])
    quaternion = np.concatenate([pair.quaternion for pair in pairs])[valid]
    position_mm = np.concatenate([pair.position_mm for pair in pairs])[valid]
    stacked = solve_stacked(
        quaternion[:, 0], position_mm[:, 0], quaternion[:, 1], position_mm[:, 1], n_singular_values
    )
    sign = 1.0 if stacked.null_child @ closed.null_child >= 0 else -1.0
    return replace(
        closed,
        p_mm=stacked.p_mm,
        q_mm=stacked.q_mm,
        null_parent=sign * stacked.null_parent,
        null_child=sign * stacked.null_child,
        singular_values=stacked.singular_values,
    )


def _reason(joint: Joint, seen: dict[str, bool], n_frames: int) -> str:
    dead = [segment for segment in (joint.parent_receiver, joint.child) if not seen[segment]]
    if dead:
        return f"no valid pose of {' and '.join(dead)}; check that receiver"
    if n_frames < 2:
        return f"{joint.parent_receiver} and {joint.child} have {n_frames} valid frames in common; expected 2"
    return "the joint did not move, so its centre cannot be found; record it moving"
