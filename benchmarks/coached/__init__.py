"""People who do what the coach asks, clumsily, beside the same people at the standard routine."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial

from benchmarks.benchmark_table import TextTable, add_people, of_each_person
from benchmarks.coached.coached_tables import enough_table, time_table
from benchmarks.coached.hands import Hand, one_hand
from benchmarks.two_drawings import OTHER, OWN

WRITTEN_TO = "coach.md", "coached"
N_HANDS, FIRST_SEED = 40, 9700


def add_options(parser: argparse.ArgumentParser) -> None:
    add_people(parser, N_HANDS, FIRST_SEED)


def run(n_hands: int = N_HANDS, seed: int = FIRST_SEED) -> Iterator[TextTable]:
    """Give the tables over that many hands of each drawing."""
    hands: list[Hand] = []
    for drawing in (OWN, OTHER):
        hands += of_each_person(partial(one_hand, drawing), n_hands, seed)
    for table in (time_table, enough_table):
        yield table(hands)
