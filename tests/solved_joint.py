"""One joint, from samples through the poses table to the closed form, for tests of readers."""

import numpy as np

from stages.capture.poses import poses_table
from stages.capture.samples import NUMBERS, Samples
from stages.solve_joints.closed import JointSolution, solve_closed
from stages.solve_joints.moments import JointMoments, relative_poses


def solved(samples: Samples, parent: str, child: str) -> JointSolution:
    """The joint between two segments, all six unknowns free."""
    columns = poses_table(samples, {}).columns
    segment = np.array(columns["segment"].to_pylist())
    of_both = [segment == one for one in (parent, child)]
    poses = np.stack([np.stack([columns[name][rows] for name in NUMBERS], -1) for rows in of_both], 1)
    valid = np.stack([columns["valid"][rows] for rows in of_both], 1)
    moments = JointMoments(1)
    moments.add(relative_poses(poses[..., 3:], poses[..., :3], valid, np.array([0]), np.array([1])))
    return solve_closed(moments, 0, 6)
