"""Write what OpenSim computes from our files as NPZ: bodies in every frame of the .mot, and inverse
kinematics.

Runs in a separate venv: read_with_opensim.py STEM OUT [--ik]. Coordinates are read by OpenSim's table reader.
With --ik, STEM_ik_setup.xml is run in its folder, and its results are written beside it.
"""

import os
import sys
from pathlib import Path

import numpy as np
import opensim

stem, out = (Path(word).absolute() for word in sys.argv[1:3])
opensim.Logger.setLevelString("Error")
os.chdir(stem.parent)  # the setup file's paths are relative to it


def posed(motion):
    """Return times, positions and rotations of all bodies, and coordinates by name."""
    model = opensim.Model(f"{stem}.osim")
    state = model.initSystem()
    table = opensim.TimeSeriesTable(motion)
    labels = list(table.getColumnLabels())
    values = table.getMatrix().to_numpy()
    coordinates = [model.getCoordinateSet().get(label) for label in labels]
    assert len(labels) == model.getNumCoordinates(), "the table must have every coordinate of the model"
    turns = [coordinate.getMotionType() == 1 for coordinate in coordinates]
    rad = np.where(turns, np.radians(values), values)
    bodies = [model.getBodySet().get(index) for index in range(model.getNumBodies())]
    places, turn = [], []
    for row in rad:
        for coordinate, value in zip(coordinates, row.tolist(), strict=True):
            coordinate.setValue(state, value, False)
        model.realizePosition(state)
        poses = [body.getTransformInGround(state) for body in bodies]
        places.append([pose.p().to_numpy() for pose in poses])
        quaternions = [pose.R().convertRotationToQuaternion() for pose in poses]
        turn.append([[quaternion.get(part) for part in range(4)] for quaternion in quaternions])
    return {
        "time_s": np.array(table.getIndependentColumn()),
        "place_m": np.array(places),
        "turn": np.array(turn),
        "coordinates": labels,
        "values": values,
        "in_degrees": table.getTableMetaDataString("inDegrees"),
    }


content = {f"mot_{key}": value for key, value in posed(f"{stem}.mot").items()}
trc = opensim.TimeSeriesTableVec3(f"{stem}.trc")
content["trc_markers"] = list(trc.getColumnLabels())
content["trc_units"] = trc.getTableMetaDataString("Units")
flat = trc.flatten()  # keep a reference, as its matrix is a view
content["trc_mm"] = flat.getMatrix().to_numpy().reshape(trc.getNumRows(), -1, 3)
if "--ik" in sys.argv:
    tool = opensim.InverseKinematicsTool(f"{stem}_ik_setup.xml")
    content["ik_ran"] = tool.run()
    content |= {f"ik_{key}": value for key, value in posed(f"{stem}_ik.mot").items()}
    errors = opensim.TimeSeriesTable(f"{tool.getName()}_ik_marker_errors.sto")
    content["ik_rms_m"] = errors.getDependentColumn("marker_error_RMS").to_numpy()
np.savez(out, **content)
