"""pingouin has the same numbers, to rounding, of drawn values.

Skipped where .tools, or the folder that SHUKOTSU_TOOLS names, lacks them; CONTRIBUTING.md says how to get
them.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shukotsu.scores.paired_statistics import (
    group_difference,
    paired_difference,
    reliability,
    small_sample_correction,
)

TESTS = Path(__file__).resolve().parents[1]
SCRIPT = TESTS / "export_tools" / "statistics_of_others.py"
ROUNDING = 1e-9

pytestmark = pytest.mark.tools


def of_others(program: str, asked: dict[str, Any]) -> Any:
    """What a program says; the test is skipped where it is absent."""
    tools = Path(os.environ.get("SHUKOTSU_TOOLS", TESTS.parent / ".tools"))
    python = tools / "python" / "bin" / "python"
    if not list(python.parents[1].glob(f"lib/*/site-packages/{program}")):
        pytest.skip(f"{program} is not installed beside {python}")
    text = json.dumps(asked)
    done = subprocess.run(
        [python, SCRIPT], input=text, check=True, capture_output=True, text=True, timeout=300
    )
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
    two = group_difference(first, other)
    assert two.effect is not None
    assert two.effect / small_sample_correction(2 * n + 1) == pytest.approx(theirs["cohen"], abs=ROUNDING)
    assert two.interval == pytest.approx(theirs["welch"][:2], abs=ROUNDING)
    assert two.p == pytest.approx(theirs["welch"][2], abs=0.1)
    size = paired_difference(first - other[:n]).effect
    assert size is not None
    assert size / small_sample_correction(n - 1) == pytest.approx(theirs["d_z"], abs=ROUNDING)
