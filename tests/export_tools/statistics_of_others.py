"""Statistics of the same numbers as pingouin and spm1d have them, JSON in and out. Runs in the tools' Python.

usage: python statistics_of_others.py pingouin < {"values": [[...] a subject], "first": [...], "other": [...]}
       python statistics_of_others.py spm1d
"""

import json
import sys

import numpy as np

MOST = 10_000
"""Permutations that are all tried; data sets with more are left out."""


def of_pingouin(asked):
    """ICC(2,1) and ICC(3,1) of values (n, k), and standardised differences of two samples."""
    import pandas as pd
    import pingouin

    n, k = np.shape(asked["values"])
    rows = pd.DataFrame(
        {
            "subject": np.repeat(np.arange(n), k),
            "session": np.tile(np.arange(k), n),
            "value": np.ravel(asked["values"]),
        }
    )
    for name in ("round", "round.column.CI95"):
        pingouin.options[name] = None
    icc = pingouin.intraclass_corr(rows, "subject", "session", "value").set_index("Type")
    first, other = (np.array(asked[name]) for name in ("first", "other"))
    least = min(len(first), len(other))
    welch = pingouin.ttest(first, other, correction=True)
    kinds = ("ICC(A,1)", "ICC(C,1)")
    return {
        "icc": {kind: [icc.at[kind, "ICC"], *map(float, icc.at[kind, "CI95"])] for kind in kinds},
        "cohen": pingouin.compute_effsize(first, other, eftype="cohen"),
        "d_z": float(pingouin.ttest(first[:least], other[:least], paired=True)["T"].iloc[0]) / least**0.5,
        "welch": [float(end) for end in welch["CI95"].iloc[0]],
    }


def of_spm1d(_):
    """Its own data sets: curves, t, the largest |t| of every permutation, and the threshold."""
    import spm1d

    found = []
    for data in (
        spm1d.data.uv1d.t1.Random(),
        spm1d.data.uv1d.t1.SimulatedPataky2015a(),
        spm1d.data.uv1d.tpaired.PlantarArchAngle(),
        spm1d.data.uv1d.t2.PlantarArchAngle(),
        spm1d.data.uv1d.t2.SimulatedTwoLocalMax(),
        spm1d.data.uv1d.t2.SmallSampleLargePosNegEffects(),
    ):
        one, other = data.get_data()
        name = f"{type(data).__module__.rpartition('.')[2]} {type(data).__name__}"
        if name.startswith("t1"):
            test = spm1d.stats.nonparam.ttest(one, other)
            one, other = one - other, None
        elif name.startswith("tpaired"):
            test = spm1d.stats.nonparam.ttest_paired(one, other)
            one, other = one - other, None
        else:
            test = spm1d.stats.nonparam.ttest2(one, other)
        if test.permuter.ncomb > MOST:
            continue
        threshold = test.inference(0.05, two_tailed=True, iterations=-1).zstar
        found.append(
            {
                "name": name,
                "one": one.tolist(),
                "other": None if other is None else other.tolist(),
                "t": test.z.tolist(),
                "largest": test.mgr.Z.tolist(),
                "threshold": float(threshold),
            }
        )
    return found


asked = json.load(sys.stdin) if sys.argv[1] == "pingouin" else None
json.dump({"pingouin": of_pingouin, "spm1d": of_spm1d}[sys.argv[1]](asked), sys.stdout)
