"""The one command of the project, and what notebooks import."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from shukotsu.resources import VERSION

if TYPE_CHECKING:
    from shukotsu.hand.posing import PosedRecording
    from shukotsu.hand.read_results import bend, pose, read

__version__ = VERSION

__all__ = ["PosedRecording", "bend", "pose", "read"]

_HOME = {
    "PosedRecording": "hand.posing",
    "bend": "hand.read_results",
    "pose": "hand.read_results",
    "read": "hand.read_results",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for then and no sooner: the command line starts fast."""
    from importlib import import_module

    if name not in _HOME:
        raise AttributeError(f"module 'shukotsu' has no {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(f"shukotsu.{_HOME[name]}"), name)
