"""Positions of all joints and end sites of a BVH file as pybvh has them, as JSON. Runs in its own venv."""

import json
import sys
from pathlib import Path

from pybvh import read_bvh_file

motion = read_bvh_file(sys.argv[1])
positions = motion.node_positions()
found = {"frame_time_s": float(motion.frame_time), "joints": {}, "ends": {}}
for index, node in enumerate(motion.nodes):
    series = positions[:, index].tolist()
    if node.is_end_site():
        found["ends"][node.parent.name] = series
    else:
        found["joints"][node.name] = series
Path(sys.argv[2]).write_text(json.dumps(found), "utf-8")
