"""What left the program, and what to take instead: said in one sentence where its name is refused."""

from __future__ import annotations

SINCE = "0.2"

_PLUS = "record with PLUS or 3D Slicer and import its sequence (.mha, .nrrd)"
_LAB_RECORDER = "record with LabRecorder and import its .xdf"
_VENDOR = "record with the tracker's own program and import its text by a mapping"
_EMULATED_FAULTS = (
    "unplug", "plug", "drop-bytes", "flip-bytes", "duplicate-bytes", "garbage", "seed", "silent", "gone-at",
    "line-rate", "fifo", "baud", "power-up-text", "reinit-delay", "already-streaming", "echo",
)  # fmt: skip

_COACHS_SERVER = ("listen", "no-page")

_EXPORTS_OPTIONS = {
    "unit": "leave it out; each format has a unit",
    "up": "leave it out; each format has an axis that points up",
    "rate-hz": "give rate_hz in the recording's mapping",
}

_POINTS = "positions alone fit no skeleton here any more: take Pose2Sim or FreeMoCap"
_FITTED = "take whole-hand, or paper-fig4 for an arm"
_FROM_GLB = "export glb, and convert it by Blender or usd-core (docs/handing-on.md)"

LEFT = {
    ("port", "igtl"): _PLUS,
    ("port", "lsl"): _LAB_RECORDER,
    ("family", "fastrak"): _VENDOR,
    ("family", "trakstar"): _VENDOR,
    ("family", "openigtlink"): _PLUS,
    ("family", "lsl"): _LAB_RECORDER,
    ("export", "usd"): _FROM_GLB,
    ("export", "urdf"): "export osim, or write it from the tidy tables",
    ("export", "mjcf"): "export osim, or write it from the tidy tables",
    ("format", "matrices"): "write the matrices as a table, six lines of NumPy (docs/handing-on.md)",
    ("format", "jsonl"): "make a table of it, six lines of pandas (docs/handing-on.md)",
    ("format", "motion-bids"): "read its _motion.tsv by a mapping of format csv (docs/handing-on.md)",
    ("command", "export-bids"): "take export --formats bids",
    ("command", "plan"): "G*Power plans a study from the spread in the tidy tables (docs/handing-on.md)",
    ("key", "questions"): "ask them of the tidy tables in R or pingouin (docs/handing-on.md)",
    ("command", "workflow"): "take doctor --snakefile",
    ("format", "ascii"): "record in binary; version 0.1 decodes an older capture in ASCII",
    ("command", "devices"): "take record --devices",
    ("command", "tracker"): "take record --ask",
    ("command", "wand"): "nothing stands in; the fit itself says where metal disturbed the field",
    ("key", "room"): "leave it out; the fit itself says where metal disturbed the field",
    ("layout", "keypoints-21"): _POINTS,
    ("layout", "tips-and-back"): _POINTS,
    ("key", "point"): _POINTS,
    ("model", "anatomical"): _FITTED,
    ("joint", "anatomical"): "take solver closed, or the model whole-hand",
    ("command", "decode"): "take import, or inspect for what a capture lacks",
    **{("option", f"{command} --ascii"): "binary has all of it" for command in ("record", "coach")},
    **{
        ("option", f"{command} {option}"): "leave it out; a line that is too slow is refused with what fits"
        for command in ("record", "coach")
        for option in ("--line-rate", "--allow-slower")
    },
    **{("option", f"coach --{option}"): "the page is one HTML file (--page)" for option in _COACHS_SERVER},
    ("option", "coach --language"): "the coach speaks English; the report has the study's language",
    ("option", "coach --log"): "keep what it prints: the same archive gives the same lines",
    ("option", "coach --calliper"): "leave it out; what measuring would bring is said at the end",
    ("option", "coach --point"): "enter touches in the study's sheet of touches",
    ("option", "coach --session"): "enter the session in the sheet of recordings",
    ("option", "coach --task"): "the task is rom; change it in the sheet of recordings",
    ("option", "record --countdown"): "leave it out",
    ("option", "record --lsl-outlet"): "import the archive",
    ("option", "record --marks"): "give --note, or an events sheet beside the recording",
    **{
        ("option", f"{command}export --{option}"): advice
        for command in ("", "stage ")
        for option, advice in _EXPORTS_OPTIONS.items()
    },
    ("option", "stage simulate --skin"): "leave it out; skin moves by the usual law",
    ("option", "emulate --igtl"): _PLUS,
    ("option", "emulate --lsl"): _LAB_RECORDER,
    ("option", "emulate --message"): _PLUS,
    ("option", "emulate --device"): "the emulator is a LIBERTY",
    ("option", "emulate --ports"): "give --stations",
    ("option", "stage project_planes --joints"): "give --joint-solutions",
    ("option", "stage estimate_metacarpals --joints"): "give --projected-joints",
    ("option", "stage estimate_metacarpals --fit"): "give --fitted-joints, --fitted-bones and --bone-poses",
    ("option", "stage evaluate_tips --joints"): "give --joint-centres",
    ("option", "stage evaluate_tips --bones"): "give --bone-lengths",
    **{
        ("option", f"emulate --{option}"): "leave it out; the emulator has no faults"
        for option in _EMULATED_FAULTS
    },
}
"""(kind, name) -> what to take instead.

Kinds: port, family, command, option (with its command: `record --marks`), export, format, model, layout,
joint (a value in a model's group `joints`), key (of a configuration file: `study.models`). Who refuses a
name puts before the sentence where it stands.
"""


def instead(kind: str, name: str) -> str:
    """Return since when a name is gone and what to take instead, in a sentence; empty where it never was."""
    advice = LEFT.get((kind, name))
    return f"{name} left in {SINCE}: {advice}" if advice else ""
