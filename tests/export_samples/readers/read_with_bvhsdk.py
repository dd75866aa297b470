"""Positions of all joints and end sites of a BVH file as bvhsdk has them, as JSON. Runs in its own venv."""

import json
import sys
from pathlib import Path

import bvhsdk

animation = bvhsdk.ReadFile(sys.argv[1])
frames = range(animation.frames)
joints = animation.getlistofjoints()
found = {
    "frame_time_s": float(animation.frametime),
    "joints": {j.name: [j.getPosition(frame).tolist() for frame in frames] for j in joints},
    "ends": {
        j.name: [j.getEndSitePosition(frame).tolist() for frame in frames] for j in joints if len(j.endsite)
    },
}
Path(sys.argv[2]).write_text(json.dumps(found), "utf-8")
