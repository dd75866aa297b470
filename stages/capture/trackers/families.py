"""Which family of trackers is decoded by what. A new tracker is one more line here and one module."""

from __future__ import annotations

import importlib

from schemas.errors import InputError
from stages.capture.trackers.records import Decoder
from stages.capture.trackers.settings import StreamSettings

DECODERS = {
    ("liberty", "binary"): ("stages.capture.trackers.liberty.binary", "BinaryDecoder"),
    ("liberty", "ascii"): ("stages.capture.trackers.liberty.text", "TextDecoder"),
    ("patriot", "binary"): ("stages.capture.trackers.liberty.binary", "BinaryDecoder"),
    ("patriot", "ascii"): ("stages.capture.trackers.liberty.text", "TextDecoder"),
    ("fastrak", "binary"): ("stages.capture.trackers.fastrak.binary", "BinaryDecoder"),
    ("fastrak", "ascii"): ("stages.capture.trackers.fastrak.text", "TextDecoder"),
    ("viper", "binary"): ("stages.capture.trackers.viper", "ViperDecoder"),
    ("trakstar", "binary"): ("stages.capture.trackers.flock", "FlockDecoder"),
}
"""Family and mode -> module and class; the class is made of the StreamSettings."""


def decoder_of(settings: StreamSettings) -> Decoder:
    """Give a fresh decoder of the stream. Raises InputError where the family has no such mode."""
    key = (settings.family, settings.mode)
    if key not in DECODERS:
        known = ", ".join(f"{family} in {mode}" for family, mode in DECODERS)
        raise InputError(f"{settings.family} in {settings.mode} cannot be decoded; known are {known}")
    module, name = DECODERS[key]
    decoder: Decoder = getattr(importlib.import_module(module), name)(settings)
    return decoder
