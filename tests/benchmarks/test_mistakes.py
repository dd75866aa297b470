"""The benchmark of mistakes: what its tables count."""

import numpy as np

from benchmarks.believed_joints import believed_joints
from benchmarks.mistakes import Person, tables_of
from shukotsu.schemas.poses import Poses
from shukotsu.stages.simulate.realism import Realism
from shukotsu.stages.simulate.simulation import simulate


def test_shares_and_alarms_are_counted_by_drawing() -> None:
    first = ("own", "units: metres", True, True)
    person = Person(
        [("own", "usual hand, rom", ()), ("other", "a child, rom", ("wrong-hand", "units"))],
        [first, ("own", "units: cm", False, True), ("other", "units: metres", True, True),
         ("other", "units: cm", False, False)],
        [("own", "two of different kinds", True, False), ("other", "two of different kinds", True, True)],
    )  # fmt: skip
    single, pairs, alarms = tables_of([person, person])
    assert single.rows[0] == ("units: metres", 2, 100.0, 100.0, 100.0, 100.0)
    assert single.rows[1] == ("units: cm", 2, 0.0, 100.0, 0.0, 0.0)
    assert single.rows[-1][:2] == ("all", 4)
    assert list(pairs.rows) == [("two of different kinds", 2, 100.0, 0.0, 100.0, 100.0)]
    assert next(iter(alarms.rows)) == ("other", "a child, rom", 2, 2, "units 2, wrong-hand 2")
    assert alarms.meaning.startswith("Of 1000 recordings of hands without a fault 500.0")


def test_believed_joints_are_held_against_the_truth() -> None:
    """Of a hand as it is, and of one that is 5 % larger than its truth."""
    made = simulate("01", "right", "rom", 3, Realism.full(), 900)
    valid = np.ones(made.position_mm.shape[:2], bool)
    medians_mm = []
    for factor in (1.0, 1.05):
        position_mm = made.position_mm * factor
        poses = Poses(made.segments, made.frame, made.time_s, position_mm, made.quaternion, valid)
        truth = {name: np.array([own.parent_mm, own.child_mm]) for name, own in made.truth.joints.items()}
        rows = list(believed_joints("usual", poses, "right", truth))
        assert {drawing for drawing, _, _, _ in rows} == {"usual"}
        medians_mm.append(np.median([error_mm for _, model, error_mm, _ in rows if model == "whole-hand"]))
    assert 0.3 < medians_mm[0] < 1.7 < medians_mm[1]
