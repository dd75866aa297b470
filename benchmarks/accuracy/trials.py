"""Scenarios in which a simulated hand is recorded: whom it is drawn around, what moves, what goes wrong."""

from __future__ import annotations

from contextlib import redirect_stderr
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

from shukotsu.anatomy.drawn_hands import MIXED_TABLE
from shukotsu.schemas.poses import Poses, read_poses
from shukotsu.stages.capture import import_recording
from shukotsu.stages.simulate.realism import PHASE_LAG, POLYNOMIAL, Realism
from shukotsu.stages.simulate.recording import write_recording
from shukotsu.stages.simulate.simulated_truth import Truth
from shukotsu.stages.simulate.simulation import LAYOUT, Simulated, simulate

SUBJECT = "01"
N_FRAMES = 6000


@dataclass(frozen=True)
class Scenario:
    """One way to record a hand; the defaults are the simulator's own full realism.

    task : of the recording that is calibrated on. realism : whom the hand is drawn around, its mounts, skin,
    field, noise and faults.
    """

    name: str
    task: str = "rom"
    realism: Realism = field(default_factory=Realism)

    @property
    def key(self) -> str:
        """The name as it is written on the command line."""
        return self.name.lower().replace(",", "").replace(" ", "-")


FULL = Scenario("blend")
STIFF = Scenario("stiff DIPs", task="opposition")

SIDE_BY_SIDE = (
    FULL,
    Scenario("ct", realism=Realism(anatomy="ct")),
    Scenario("xray", realism=Realism(anatomy="xray")),
    STIFF,
    Scenario("polynomial skin", realism=Realism(skin=POLYNOMIAL)),
    Scenario("phase-lag skin", realism=Realism(skin=PHASE_LAG)),
    Scenario("skin x2", realism=Realism(artefact=2.0)),
    Scenario("faults", realism=Realism(faults=1.0)),
    Scenario("no noise, no skin", realism=Realism(glide=0.0, artefact=0.0, noise=0.0, field_distortion=0.0)),
    Scenario("other-anatomy", realism=Realism(anatomy=MIXED_TABLE)),
)
"""The usual recording, and those that differ from it in one thing: whom hands are drawn around, what moves,
the law and the size of the skin, a tracker with faults, nothing that moves receivers or centres, and hands
outside of every source."""

BY_KEY = {scenario.key: scenario for scenario in SIDE_BY_SIDE}


@dataclass(frozen=True)
class Trial:
    """A recording of one hand; the truth is for the judge alone."""

    seed: int
    hand: str
    poses: Poses
    truth: Truth


def record(seed: int, hand: str, scenario: Scenario, n_frames: int = N_FRAMES) -> Trial:
    """Simulate a hand in a scenario; with the default scenario exactly what `stages.simulate` makes."""
    made = simulate(SUBJECT, hand, scenario.task, seed, scenario.realism, n_frames)
    poses = _imported(made) if scenario.realism.faults else made.poses()
    return Trial(seed, hand, poses, made.truth)


def _imported(made: Simulated) -> Poses:
    """The recording as its file is read: faults of the tracker are found, repaired or left out."""
    with TemporaryDirectory() as folder:
        recording, table = Path(folder, "recording.parquet"), Path(folder, "poses.parquet")
        write_recording(recording, made)
        names = ("--layout", LAYOUT, "--subject", SUBJECT, "--hand", made.hand, "--task", made.task)
        files = ("--in", str(recording), "--out", str(table), "--repair-hemisphere")
        with redirect_stderr(StringIO()):  # it says what it finds
            assert import_recording.main([*files, *names]) == 0
        return read_poses(table, made.segments)
