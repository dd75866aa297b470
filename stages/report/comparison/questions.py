"""What skeleton models are asked, the questions that judge a skeleton first."""

from __future__ import annotations

from dataclasses import dataclass

from stages.report.wording import mark

PRIOR, NAIL, TRUE = "prior-only", "distal-receiver", "true-skeleton"


@dataclass(frozen=True)
class Question:
    """One question; the smaller its number, the better.

    metric : the column of `table` that answers it. amount : the words before an amount in a sentence.
    choice : its name among the others. says : how far the answer judges a skeleton. judged_by : the words
    of the headline; empty where it judges none. references : drawn beside the models. fitted_only : whether
    only models that pose a fitted hand take this test. axis, caption : in print, of an axis and in a caption.
    """

    metric: str
    amount: str
    choice: str
    says: str
    judged_by: str = ""
    references: tuple[str, ...] = ()
    fitted_only: bool = False
    table: str = "skeleton_scores"
    unit: str = "mm"
    axis: str = ""
    caption: str = ""


JOINT_ERROR = Question(
    "error_mm",
    mark("the joint centre is off by"),
    mark("Joint centres against the truth"),
    mark(
        "How far the stated joint centres are from the true ones. This judges a skeleton. Models "
        "that differ only in how they pose a metacarpal have the same joints."
    ),
    mark("how far the joint centres are from the true ones"),
    (PRIOR,),
    table="joint_errors",
    axis=mark("Joint error [mm]"),
    caption=mark(
        "distance of the joint centres to the true ones in the child receiver's frame, mean over joints"
    ),
)
METACARPAL = Question(
    "metacarpal_deg",
    mark("the metacarpal's direction is off by"),
    mark("Metacarpal directions against the truth"),
    mark(
        "The angle between the stated and the true metacarpal. This judges what models of "
        "metacarpals differ in; one that starts its fingers at the wrist states another line "
        "than the bone's and is off by a constant angle besides."
    ),
    mark("how far the metacarpals are from their true directions"),
    (PRIOR,),
    unit="deg",
)
TRUE_TIP = Question(
    "true_tip_mean_mm",
    mark("the fingertip is missed by"),
    mark("Fingertips against the truth"),
    mark(
        "From the fingertip that a model states to the true end of the distal bone. A fitted "
        "hand knows a fingertip; the other models know the receiver on the nail, which "
        "distal-receiver is alone."
    ),
    mark("how far the fingertips are from the true ones"),
    (PRIOR, NAIL, TRUE),
    axis=mark("Fingertip error [mm]"),
    caption=mark("distance from the stated fingertip to the true end of the distal bone, mean over frames"),
)
LEFT_OUT = Question(
    "left_out_mean_mm",
    mark("the distal receiver, left out, is missed by"),
    mark("Distal receivers left out of the pose"),
    mark(
        "Each fitted hand is posed without the distal receivers' positions and must say where "
        "they are. On recordings that it was not made from this judges a fitted hand in part: it "
        "sees no error that a bone and its receiver make together. Other models replay their "
        "receivers, which is another test, and are not here."
    ),
    mark("how far distal receivers are missed when a pose is not told where they are"),
    (PRIOR, TRUE),
    fitted_only=True,
    axis=mark("Left-out error [mm]"),
    caption=mark(
        "fitted hands posed without the positions of the distal receivers, distance from where "
        "the hand says that these are to where they are, mean over frames"
    ),
)
REPLAY = Question(
    "replay_mean_mm",
    mark("the replay misses its receiver by"),
    mark("Tip error of the replay"),
    mark(
        "The paper's number. It says how well the joints close and not where they are, so it "
        "judges no skeleton: the true one does not win it. A large error is a warning; a small "
        "one is no proof."
    ),
    references=(TRUE,),
    axis=mark("Replay's tip error [mm]"),
    caption=mark(
        "tip error of the receiver-driven replay, least-squares binding, mean over frames; it "
        "says how well the joints close and not where they are"
    ),
)
QUESTIONS = (JOINT_ERROR, METACARPAL, TRUE_TIP, LEFT_OUT, REPLAY)
