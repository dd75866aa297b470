"""Statistics of the same numbers as pingouin and spm1d have them, JSON in and out. Runs in the tools' Python.

usage: python statistics_of_others.py pingouin < {"values": [[...] a subject], "first": [...], "other": [...]}
       python statistics_of_others.py spm1d
"""

import json
import sys

import numpy as np


def of_pingouin(asked):
    """ICC(2,1) and ICC(3,1) of values (n, k), and standardised differences of two samples."""
    import pandas as pd
    import pingouin
    import statsmodels.api

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
    line = statsmodels.api.OLS(first, statsmodels.api.add_constant(other[: len(first)])).fit(cov_type="HC3")
    kinds = ("ICC(A,1)", "ICC(C,1)")
    return {
        "icc": {kind: [icc.at[kind, "ICC"], *map(float, icc.at[kind, "CI95"])] for kind in kinds},
        "cohen": pingouin.compute_effsize(first, other, eftype="cohen"),
        "d_z": float(pingouin.ttest(first[:least], other[:least], paired=True)["T"].iloc[0]) / least**0.5,
        "welch": [*map(float, welch["CI95"].iloc[0]), float(welch["p_val"].iloc[0])],
        "slope": [float(line.params[1]), float(line.bse[1])],
    }


def of_spm1d(_):
    """Its own data sets: curves and t."""
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
            test = spm1d.stats.ttest(one, other)
            one, other = one - other, None
        elif name.startswith("tpaired"):
            test = spm1d.stats.ttest_paired(one, other)
            one, other = one - other, None
        else:
            test = spm1d.stats.ttest2(one, other)
        found.append(
            {
                "name": name,
                "one": one.tolist(),
                "other": None if other is None else other.tolist(),
                "t": test.z.tolist(),
            }
        )
    return found


asked = json.load(sys.stdin) if sys.argv[1] == "pingouin" else None
json.dump({"pingouin": of_pingouin, "spm1d": of_spm1d}[sys.argv[1]](asked), sys.stdout)
