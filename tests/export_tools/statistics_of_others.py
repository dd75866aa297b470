"""Compute statistics with pingouin, from JSON on stdin to JSON on stdout. Runs in the tools' Python.

usage: python statistics_of_others.py < {"values": [[...] per subject], "first": [...], "other": [...]}
"""

import json
import sys

import numpy as np


def of_pingouin(asked):
    """Return ICC(2,1) and ICC(3,1) of values (n, k), and standardised differences of two samples."""
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
        "welch": [*map(float, welch["CI95"].iloc[0]), float(welch["p_val"].iloc[0])],
    }


json.dump(of_pingouin(json.load(sys.stdin)), sys.stdout)
