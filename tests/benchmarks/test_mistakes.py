"""The benchmark of mistakes: what its tables count."""

from benchmarks.mistakes import tables_of


def test_shares_and_alarms_are_counted_by_name() -> None:
    person = (
        [("usual hand, rom", False, False), ("stiff, rom", True, False)],
        [("units: metres", True, True), ("units: cm", False, True)],
        [("same-file: third of three", True, True)],
        [("two of different kinds", True, False)],
    )
    single, pairs, alarms = tables_of([person, person])
    assert single.rows[0] == ("units: metres", 2, 100.0, 100.0)
    assert single.rows[1] == ("units: cm", 2, 0.0, 100.0)
    assert single.rows[-1][:2] == ("all", 6)
    assert list(pairs.rows) == [("two of different kinds", 2, 100.0, 0.0)]
    assert list(alarms.rows)[-1] == ("all", 4, 2)
    assert alarms.meaning.startswith("50.00 %")
