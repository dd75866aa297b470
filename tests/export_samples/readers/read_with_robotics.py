"""Where MuJoCo or yourdfpy has every frame of a model as its table of joints moves it, as an .npz by names.

Arguments: the model (.urdf or .xml), its table (.csv), the file to write. Run by a Python that has both.
"""

import csv
import sys

import numpy as np

model_path, table_path, out = sys.argv[1:]
with open(table_path, newline="") as stream:  # noqa: PTH123
    names, *rows = csv.reader(stream)
values = np.array(rows, float)
places = {}
if model_path.endswith(".urdf"):
    import yourdfpy

    robot = yourdfpy.URDF.load(model_path, load_meshes=False, build_collision_scene_graph=False)
    order = [names.index(name) for name in robot.actuated_joint_names]
    places = {name: np.empty((len(values), 3)) for name in robot.link_map}
    for frame, row in enumerate(values):
        robot.update_cfg(row[order])
        for name, place in places.items():
            place[frame] = robot.get_transform(name)[:3, 3]
    limits = {j.name: (j.limit.lower, j.limit.upper) for j in robot.actuated_joints}
else:
    import mujoco

    model = mujoco.MjModel.from_xml_path(model_path)
    state = mujoco.MjData(model)
    order = [names.index(model.joint(number).name) for number in range(model.njnt)]
    bodies = [model.body(number).name for number in range(model.nbody)]
    sites = [model.site(number).name for number in range(model.nsite)]
    places = {name: np.empty((len(values), 3)) for name in [*bodies, *sites]}
    for frame, row in enumerate(values):
        state.qpos = row[order]
        mujoco.mj_kinematics(model, state)
        for name, place in [*zip(bodies, state.xpos, strict=True), *zip(sites, state.site_xpos, strict=True)]:
            places[name][frame] = place
    mujoco.mj_resetDataKeyframe(model, state, 0)
    assert np.abs(state.qpos - values[0][order]).max() < 1e-9
    mujoco.mj_step(model, state)  # it also moves by itself
    assert np.isfinite(state.qpos).all()
    limits = {names[n]: tuple(model.joint(names[n]).range) for n in order if model.joint(names[n]).limited[0]}
for name, (low, high) in limits.items():
    column = values[:, names.index(name)]
    assert low - 1e-9 <= column.min(), name
    assert column.max() <= high + 1e-9, name
np.savez(out, **places)
