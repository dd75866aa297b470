"""pingouin and spm1d have the same numbers, to rounding, of drawn values and of spm1d's own data sets.

Skipped where .tools, or the folder that SHUKOTSU_TOOLS names, lacks them; CONTRIBUTING.md says how to get
them.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.statistics.curve_statistics import CurveTest, curves_between, curves_within
from shukotsu.statistics.group_statistics import two_groups
from shukotsu.statistics.paired_statistics import effect_size, small_sample_correction
from shukotsu.statistics.reliability_statistics import reliability

TESTS = Path(__file__).resolve().parents[1]
SCRIPT = TESTS / "export_tools" / "statistics_of_others.py"
ROUNDING = 1e-9

pytestmark = pytest.mark.tools


def of_others(program: str, asked: dict[str, Any] | None = None) -> Any:
    """What a program says; the test is skipped where it is absent."""
    tools = Path(os.environ.get("SHUKOTSU_TOOLS", TESTS.parent / ".tools"))
    python = tools / "python" / "bin" / "python"
    if not list(python.parents[1].glob(f"lib/*/site-packages/{program}")):
        pytest.skip(f"{program} is not installed beside {python}")
    words = list(map(str, [python, SCRIPT, program]))
    text = json.dumps(asked)
    done = subprocess.run(words, input=text, check=True, capture_output=True, text=True, timeout=300)
    return json.loads(done.stdout)


@pytest.mark.parametrize(("n", "k", "shift"), [(6, 4, 2.0), (12, 3, 0.0), (20, 2, 0.5)])
def test_pingouin_has_the_same_iccs_and_sizes(n: int, k: int, shift: float) -> None:
    rng = np.random.default_rng(n)
    values = rng.normal(0, 3, (n, 1)) + rng.normal(size=(n, k)) + shift * np.arange(k)
    first, other = rng.normal(1.0, 1.0, n), rng.normal(0.0, 2.0, n + 3)
    arrays = {"values": values, "first": first, "other": other}
    theirs = of_others("pingouin", {name: array.tolist() for name, array in arrays.items()})
    ours = reliability(values)
    for name, icc in (("ICC(A,1)", ours.agreement), ("ICC(C,1)", ours.consistency)):
        assert [icc.value, *icc.interval] == pytest.approx(theirs["icc"][name], abs=ROUNDING)
    groups = two_groups(first, other)
    assert groups.effect is not None
    assert groups.effect / small_sample_correction(2 * n + 1) == pytest.approx(theirs["cohen"], abs=ROUNDING)
    assert groups.interval == pytest.approx(theirs["welch"], abs=ROUNDING)
    paired = effect_size(first - other[:n])
    assert paired is not None
    assert paired / small_sample_correction(n - 1) == pytest.approx(theirs["d_z"], abs=ROUNDING)


def test_spm1d_has_the_same_curves_and_permutations() -> None:
    """Of its data sets: t, the largest |t| of every permutation, the threshold, and p from them."""
    data_sets = of_others("spm1d")
    assert len(data_sets) == 5
    for theirs in data_sets:
        ours = _tested(theirs)
        assert ours is not None
        assert ours.t == pytest.approx(np.array(theirs["t"]), abs=ROUNDING)
        largest = np.sort(theirs["largest"])
        mirrored = len(ours.largest) // len(largest)  # of groups every assignment has its mirror image
        assert np.sort(ours.largest)[::mirrored] == pytest.approx(largest, abs=ROUNDING)
        expected = [(largest >= abs(t) - ROUNDING).mean() for t in theirs["t"]]
        assert ours.p == pytest.approx(np.array(expected), abs=ROUNDING)
        if ours.threshold is not None:  # theirs interpolates between two permutations
            rank = math.floor(0.95 * (len(largest) - 1))
            assert largest[rank] <= theirs["threshold"] <= ours.threshold + ROUNDING


def _tested(theirs: dict[str, Any]) -> CurveTest | None:
    one = np.array(theirs["one"])
    return curves_within(one) if theirs["other"] is None else curves_between(one, np.array(theirs["other"]))
