"""How hands are recorded in the benchmark: what moves, how skin behaves, what goes wrong, what is told."""

from __future__ import annotations

from dataclasses import dataclass

SATURATING, POLYNOMIAL = "saturating", "polynomial"


@dataclass(frozen=True)
class Scenario:
    """One way to record and describe a hand; the defaults are the simulator's own full realism.

    task : of the recording that is calibrated on. law : of the skin, the simulator's (saturating, lagging) or
    that of `polynomial_skin`. artefact, field, mounts : scales of skin, field distortion and misplaced
    receivers. cross_talk : rad per rad by which PIP flexion tilts the middle phalanx's receiver besides.
    dip_range_deg : to which the DIP joints' motion is scaled. dropped : share of the frames that each
    receiver loses, in bursts. half_absent : whether one receiver is missing for half of the recording.
    told_length : the hand's length that estimators are told, over the true one; None tells nothing.
    counted : how the names of the joints end that count in the scenario's row.
    """

    name: str
    task: str = "rom"
    law: str = SATURATING
    artefact: float = 1.0
    field: float = 1.0
    mounts: float = 1.0
    cross_talk: float = 0.0
    dip_range_deg: float | None = None
    dropped: float = 0.0
    half_absent: bool = False
    told_length: float | None = None
    counted: str = ""


FULL = Scenario("full range of motion")
STIFF = Scenario("stiff DIPs: opposition", task="opposition")
ABLATED = Scenario("parts of the fit left out")
FOREIGN = Scenario("polynomial skin x1", law=POLYNOMIAL)

_NO_SKIN, _HALF, _DOUBLE = (Scenario(f"skin x{scale:g}", artefact=scale) for scale in (0.0, 0.5, 2.0))
SKIN = (
    *(_NO_SKIN, _HALF, FULL, _DOUBLE, FOREIGN),
    Scenario("polynomial skin x2", law=POLYNOMIAL, artefact=2.0),
)
"""Scenarios of growing skin artefact, first by the simulator's law, then by the other."""

SWEEPS = (
    *(Scenario(f"cross-talk {c:g} rad/rad", cross_talk=c, counted="_dip") for c in (0.05, 0.1)),
    Scenario("cross-talk 0.1, DIP range 7 deg", cross_talk=0.1, dip_range_deg=7.0, counted="_dip"),
    *(Scenario(f"field distortion x{scale:g}", field=scale) for scale in (0.0, 3.0)),
    *(Scenario(f"{share:.0%} of frames lost", dropped=share) for share in (0.1, 0.4)),
    Scenario("one receiver gone half the time", half_absent=True),
    *(Scenario(f"hand length told x{told:g}", told_length=told) for told in (0.9, 1.0, 1.1)),
    Scenario("receivers misplaced x2", mounts=2.0),
    *(Scenario(f"DIP range {deg} deg", dip_range_deg=deg, counted="_dip") for deg in (5, 10, 20, 45, 90)),
)
