"""The body that a GLB file shows; what other programs have of a file is in test_glb_in_other_programs.py."""

from __future__ import annotations

import numpy as np
from moving_fingers import moving_fingers

from shukotsu.export.glb import bone_mesh


def test_the_body_is_closed_and_faces_outward() -> None:
    mesh = bone_mesh(moving_fingers(1))
    triangles = mesh.position_mm[mesh.bone]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert np.linalg.norm(across, axis=1).min() > 0
    facing = mesh.normal[mesh.bone].mean(1)
    assert ((across * facing).sum(-1) > 0).all()
    corner = {tuple(p): i for i, p in enumerate(np.unique(mesh.position_mm.round(6), axis=0))}
    index = np.array([corner[tuple(p)] for p in mesh.position_mm.round(6)])[mesh.bone]
    edges = np.concatenate([index[:, [0, 1]], index[:, [1, 2]], index[:, [2, 0]]])
    there, back = sorted(map(tuple, edges)), sorted((b, a) for a, b in edges)
    assert there == back, "every edge once in either direction"
    assert np.linalg.det(triangles).sum() > 0, "its volume is positive"
