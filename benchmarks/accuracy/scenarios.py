"""Describe how hands are recorded here: who they are, what moves, how skin behaves, what goes wrong."""

from __future__ import annotations

from dataclasses import dataclass

from shukotsu.anatomy.drawn_hands import MIXED_TABLE
from shukotsu.stages.simulate.realism import PHASE_LAG, POLYNOMIAL, Realism

FULL_REALISM = Realism.full()


@dataclass(frozen=True)
class Scenario:
    """One way to record and describe a hand; the defaults are the simulator's own full realism.

    task : of the recording that is calibrated on. realism : whom the hand is drawn around, its mounts, skin,
    field, noise and faults. cross_talk : rad per rad by which PIP flexion tilts the middle phalanx's receiver
    besides. dip_range_deg : to which the DIP joints' motion is scaled. dropped : share of the frames that
    each receiver loses, in bursts. half_absent : whether one receiver is missing for half of the recording.
    told_length : the hand's length that estimators are told, over the true one; None tells nothing. counted :
    how the names of the joints end that count in the scenario's row.
    """

    name: str
    task: str = "rom"
    realism: Realism = FULL_REALISM
    cross_talk: float = 0.0
    dip_range_deg: float | None = None
    dropped: float = 0.0
    half_absent: bool = False
    told_length: float | None = None
    counted: str = ""

    @property
    def key(self) -> str:
        """The name as it is written on the command line."""
        return self.name.lower().replace(",", "").replace(" ", "-")


FULL = Scenario("blend")
STIFF = Scenario("stiff DIPs", task="opposition")
ABLATED = Scenario("parts of the fit left out")
FOREIGN = Scenario("polynomial skin", realism=Realism(skin=POLYNOMIAL))
LATE = Scenario("phase-lag skin", realism=Realism(skin=PHASE_LAG))
OTHER = Scenario("other-anatomy", realism=Realism(anatomy=MIXED_TABLE))
CLEAN = Scenario(
    "no noise, no skin", realism=Realism(glide=0.0, artefact=0.0, noise=0.0, field_distortion=0.0)
)

_NO_SKIN, _HALF, _DOUBLE = (
    Scenario(f"skin x{scale:g}", realism=Realism(artefact=scale)) for scale in (0.0, 0.5, 2.0)
)
SIDE_BY_SIDE = (
    FULL,
    Scenario("ct", realism=Realism(anatomy="ct")),
    Scenario("xray", realism=Realism(anatomy="xray")),
    STIFF,
    FOREIGN,
    LATE,
    _DOUBLE,
    Scenario("faults", realism=Realism(faults=1.0)),
    CLEAN,
    OTHER,
)
"""The usual recording, and those that differ from it in one thing: whom hands are drawn around, what moves,
the law and the size of the skin, a tracker with faults, nothing that moves receivers or centres, and hands
outside of every source."""

BY_KEY = {scenario.key: scenario for scenario in SIDE_BY_SIDE}

SWEEPS = (
    *(_NO_SKIN, _HALF),
    Scenario("polynomial skin x2", realism=Realism(skin=POLYNOMIAL, artefact=2.0)),
    *(Scenario(f"cross-talk {c:g} rad/rad", cross_talk=c, counted="_dip") for c in (0.05, 0.1)),
    Scenario("cross-talk 0.1, DIP range 7 deg", cross_talk=0.1, dip_range_deg=7.0, counted="_dip"),
    *(Scenario(f"field distortion x{by:g}", realism=Realism(field_distortion=by)) for by in (0.0, 3.0)),
    *(Scenario(f"{share:.0%} of frames lost", dropped=share) for share in (0.1, 0.4)),
    Scenario("one receiver gone half the time", half_absent=True),
    *(Scenario(f"hand length told x{told:g}", told_length=told) for told in (0.9, 1.0, 1.1)),
    Scenario("receivers misplaced x2", realism=Realism(mounts=2.0)),
    *(Scenario(f"DIP range {deg} deg", dip_range_deg=deg, counted="_dip") for deg in (5, 10, 20, 45, 90)),
)
