"""Which family of trackers is set up by which driver. A new tracker is one more line here and one module."""

from __future__ import annotations

import importlib

from stages.capture.record.conversation import Conversation
from stages.capture.record.wishes import Driver, Wishes

DRIVERS = {
    "liberty": ("stages.capture.record.liberty_driver", "LibertyDriver"),
    "patriot": ("stages.capture.record.liberty_driver", "LibertyDriver"),
    "fastrak": ("stages.capture.record.fastrak_driver", "FastrakDriver"),
    "viper": ("stages.capture.record.viper_driver", "ViperDriver"),
    "trakstar": ("stages.capture.record.trakstar_driver", "TrakstarDriver"),
}
"""Family -> module and class; the class is made of the Conversation and the Wishes."""


def driver_of(talk: Conversation, wishes: Wishes) -> Driver:
    """Give the driver of the family."""
    module, name = DRIVERS[wishes.family]
    driver: Driver = getattr(importlib.import_module(module), name)(talk, wishes)
    return driver
