"""Define the questions that compare skeleton models, those that judge a skeleton first."""

from __future__ import annotations

from dataclasses import dataclass

from shukotsu.sentences.translation import N_

PRIOR, TRUE = "prior-only", "true-skeleton"


@dataclass(frozen=True)
class Question:
    """One question; the smaller its number, the better.

    metric : as in the table model_values. amount : the words before an amount in a sentence.
    choice : its name among the others. says : how far the answer judges a skeleton. judged_by : the words
    of the headline; empty where it judges none. fitted_only : whether only models that pose a fitted hand
    take this test. axis : of its pictures. caption : of its figure.
    """

    metric: str
    amount: str
    choice: str
    says: str
    judged_by: str = ""
    fitted_only: bool = False
    unit: str = "mm"
    axis: str = ""
    caption: str = ""


JOINT_ERROR = Question(
    "error_mm",
    N_("the joint centre is off by"),
    N_("Joint centres against the truth"),
    N_(
        "How far the stated joint centres are from the true ones. This judges a skeleton. Models "
        "that differ only in how they pose a metacarpal have the same joints."
    ),
    N_("how far the joint centres are from the true ones"),
    axis=N_("Joint error [mm]"),
    caption=N_(
        "distance of the joint centres to the true ones in the child receiver's frame, mean over joints"
    ),
)
METACARPAL = Question(
    "metacarpal_deg",
    N_("the metacarpal's direction is off by"),
    N_("Metacarpal directions against the truth"),
    N_(
        "The angle between the stated and the true metacarpal. This judges what models of "
        "metacarpals differ in; one that starts its fingers at the wrist states another line "
        "than the bone's and is off by a constant angle besides."
    ),
    N_("how far the metacarpals are from their true directions"),
    unit="deg",
    axis=N_("Metacarpal direction error [deg]"),
)
TRUE_TIP = Question(
    "true_tip_mean_mm",
    N_("the fingertip is missed by"),
    N_("Fingertips against the truth"),
    N_(
        "From the fingertip that a model states to the true end of the distal bone. A fitted "
        "hand knows a fingertip; the other models know the receiver on the nail, which "
        "distal-receiver is alone."
    ),
    N_("how far the fingertips are from the true ones"),
    axis=N_("Fingertip error [mm]"),
    caption=N_("distance from the stated fingertip to the true end of the distal bone, mean over frames"),
)
LEFT_OUT = Question(
    "left_out_mean_mm",
    N_("the distal receiver, left out, is missed by"),
    N_("Distal receivers left out of the pose"),
    N_(
        "Each fitted hand is posed without the distal receivers' positions and must say where "
        "they are. On recordings that it was not made from this judges a fitted hand in part: it "
        "sees no error that a bone and its receiver make together. Other models replay their "
        "receivers, which is another test, and are not here."
    ),
    N_("how far distal receivers are missed when a pose is not told where they are"),
    fitted_only=True,
    axis=N_("Left-out error [mm]"),
    caption=N_(
        "fitted hands posed without the positions of the distal receivers, distance from where "
        "the hand says that these are to where they are, mean over frames"
    ),
)
REPLAY = Question(
    "replay_mean_mm",
    N_("the replay misses its receiver by"),
    N_("Tip error of the replay"),
    N_(
        "The paper's number. It says how well the joints close and not where they are, so it "
        "judges no skeleton: the true one does not win it. A large error is a warning; a small "
        "one is no proof."
    ),
    axis=N_("Replay's tip error [mm]"),
    caption=N_(
        "tip error of the receiver-driven replay, least-squares binding, mean over frames; it "
        "says how well the joints close and not where they are"
    ),
)
QUESTIONS = (JOINT_ERROR, METACARPAL, TRUE_TIP, LEFT_OUT, REPLAY)
