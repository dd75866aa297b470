"""The benchmark of mistakes: what its tables count."""

from benchmarks.mistakes import Person, tables_of


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
