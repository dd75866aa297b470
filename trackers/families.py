"""The families of trackers: one record each names its decoders, driver, emulated device, items and limits.

A new tracker is one package and one entry of FAMILIES.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from schemas.errors import InputError

if TYPE_CHECKING:
    from trackers.protocols.output_items import OutputItems
    from trackers.protocols.piecewise import PiecewiseDecoder
    from trackers.protocols.stream_settings import StreamSettings


@dataclass(frozen=True)
class Family:
    """What there is for one family; code is named `module:object`, so that only what is used is imported.

    title : its name for people. decoders : mode ("binary", "ascii") -> module and class, made of the
    StreamSettings; the module in a text of its own, so that the workflow sees that results depend on its
    code, as they do not on the code of drivers and emulated devices.
    driver : class, made of the Conversation and the RecordingRequest. rates_hz : frames a second that a user
    can choose, the usual one first; one where there is no choice, none where it is measured. items : its
    OutputItems; None where records are always the same. record_bytes : bytes of a record of a station, and of
    what a whole cycle has beside, where there are no items.
    emulated_device : class, made of the World, the family, connectors and rate; None where there is none.
    ports : numbers of connectors that the emulated device may have, the usual one last.
    """

    title: str
    decoders: Mapping[str, tuple[str, str]]
    driver: str
    rates_hz: tuple[int, ...] = ()
    items: str | None = None
    record_bytes: int = 0
    cycle_bytes: int = 0
    emulated_device: str | None = None
    ports: tuple[int, ...] = ()
    remedies: str = ""
    """Options that make a stream smaller, of trackers that count their frames."""
    unsupported: Mapping[str, str] = field(default_factory=dict)
    """Option of a recorder that the family cannot do -> the sentence that says so."""


_BINARY_ONLY = "sends binary only; leave it out"
_LIBERTY_DECODERS = {
    "binary": ("trackers.liberty.binary_decoder", "BinaryDecoder"),
    "ascii": ("trackers.liberty.text_decoder", "TextDecoder"),
}

FAMILIES = {
    "liberty": Family(
        title="LIBERTY",
        decoders=_LIBERTY_DECODERS,
        driver="trackers.liberty.driver:LibertyDriver",
        rates_hz=(240, 120),
        items="trackers.liberty.items:OUTPUT_ITEMS",
        emulated_device="trackers.liberty.emulated_device:EmulatedLiberty",
        ports=(4, 8, 12, 16),
        remedies="--stations, --items short, --rate 120",
    ),
    "patriot": Family(
        title="PATRIOT",
        decoders=_LIBERTY_DECODERS,
        driver="trackers.liberty.driver:LibertyDriver",
        rates_hz=(60,),
        items="trackers.liberty.items:OUTPUT_ITEMS",
        emulated_device="trackers.liberty.emulated_device:EmulatedLiberty",
        ports=(2,),
        remedies="--stations, --items short",
    ),
    "fastrak": Family(
        title="FASTRAK",
        decoders={
            "binary": ("trackers.fastrak.binary_decoder", "BinaryDecoder"),
            "ascii": ("trackers.fastrak.text_decoder", "TextDecoder"),
        },
        driver="trackers.fastrak.driver:FastrakDriver",
        rates_hz=(120,),
        items="trackers.fastrak.items:OUTPUT_ITEMS",
        emulated_device="trackers.fastrak.emulated_device:EmulatedFastrak",
        ports=(4,),
        unsupported={"--hemisphere track": "--hemisphere: a FASTRAK does not follow a receiver; give x,y,z"},
    ),
    "viper": Family(
        title="VIPER",
        decoders={"binary": ("trackers.viper.decoder", "ViperDecoder")},
        driver="trackers.viper.driver:ViperDriver",
        rates_hz=(240, 120),
        record_bytes=32,
        cycle_bytes=28,
        remedies="--rate 120",
        unsupported={
            "--stations": "--stations: a VIPER sends every sensor that is connected; leave it out",
            "--ascii": f"--ascii: a VIPER {_BINARY_ONLY}",
        },
    ),
    "trakstar": Family(
        title="trakSTAR",
        decoders={"binary": ("trackers.trakstar.decoder", "FlockDecoder")},
        driver="trackers.trakstar.driver:TrakstarDriver",
        record_bytes=14,
        unsupported={
            "--ascii": f"--ascii: a trakSTAR {_BINARY_ONLY}",
            "--hemisphere": "--hemisphere, --no-filters: set them with the trakSTAR's own program",
            "--no-filters": "--hemisphere, --no-filters: set them with the trakSTAR's own program",
        },
    ),
}


def decoder_of(settings: StreamSettings) -> PiecewiseDecoder:
    """Give a fresh decoder of the stream. Raises InputError where the family has no such mode."""
    family = FAMILIES.get(settings.family)
    if family is None or settings.mode not in family.decoders:
        known = ", ".join(f"{name} in {mode}" for name, known in FAMILIES.items() for mode in known.decoders)
        raise InputError(f"{settings.family} in {settings.mode} cannot be decoded; known are {known}")
    decoder: PiecewiseDecoder = loaded(":".join(family.decoders[settings.mode]))(settings)
    return decoder


def output_items(family: str) -> OutputItems | None:
    """Give the items that a record can hold; None where records are always the same."""
    name = FAMILIES[family].items
    items: OutputItems | None = None if name is None else loaded(name)
    return items


def loaded(name: str) -> Any:
    """Give what `module:object` names."""
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
