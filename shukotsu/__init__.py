"""The package of the command `shukotsu`, and the functions that notebooks import."""

from __future__ import annotations

TYPE_CHECKING = False  # without importing typing: the command line must soon be able to handle signals
if TYPE_CHECKING:
    from typing import Any

    from shukotsu.hand.posing import PosedRecording
    from shukotsu.hand.read_results import bend, pose, read

__all__ = ["PosedRecording", "bend", "pose", "read"]

_HOME = {
    "VERSION": "resources",
    "PosedRecording": "hand.posing",
    "bend": "hand.read_results",
    "pose": "hand.read_results",
    "read": "hand.read_results",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that the command line starts fast."""
    from importlib import import_module

    name = "VERSION" if name == "__version__" else name
    if name not in _HOME:
        raise AttributeError(f"module 'shukotsu' has no {name!r}; it has {', '.join(__all__)}")
    return getattr(import_module(f"shukotsu.{_HOME[name]}"), name)
