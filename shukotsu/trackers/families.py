"""The families of trackers: one record each names its decoders, driver, emulated device, items and limits.

A new tracker is one package and one entry of FAMILIES.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from shukotsu.errors import InputError

if TYPE_CHECKING:
    from shukotsu.trackers.protocols.output_items import OutputItems
    from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder
    from shukotsu.trackers.protocols.stream_settings import StreamSettings


class UsbTracker(NamedTuple):
    """Hold what is known of a tracker on USB.

    state : READY, WANTS_FIRMWARE or NOT_READ. endpoints : out and in, where it is read by bulk transfers.
    """

    name: str
    state: str
    endpoints: tuple[int, int] | None = None


@dataclass(frozen=True)
class Family:
    """List the code of one family; code is named `module:object`, so that only what is used is imported.

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
    scheme: str = ""
    """What the name of its ports begins with, where it has ports of its own."""
    usb: Mapping[tuple[int, int], UsbTracker] = field(default_factory=dict)
    """By USB vendor and product."""


USUAL = "liberty"

POLHEMUS, NDI = 0x0F44, 0x04B4
HIGH_SPEED, FULL_SPEED = (0x04, 0x88), (0x02, 0x82)
READY, WANTS_FIRMWARE, NOT_READ = "ready", "wants its firmware", "not read by this program"
_BINARY_ONLY = "sends binary only; leave it out"
_LIBERTY_DECODERS = {
    "binary": ("shukotsu.trackers.liberty.binary_decoder", "BinaryDecoder"),
    "ascii": ("shukotsu.trackers.liberty.text_decoder", "TextDecoder"),
}


def _set_by(program: str) -> dict[str, str]:
    """Give the sentence of options that are set elsewhere."""
    options = ("--hemisphere", "--no-filters")
    return dict.fromkeys(options, f"{', '.join(options)}: set them with {program}")


FAMILIES = {
    "liberty": Family(
        title="LIBERTY",
        decoders=_LIBERTY_DECODERS,
        driver="shukotsu.trackers.liberty.driver:LibertyDriver",
        rates_hz=(240, 120),
        items="shukotsu.trackers.liberty.items:OUTPUT_ITEMS",
        emulated_device="shukotsu.trackers.liberty.emulated_device:EmulatedLiberty",
        ports=(4, 8, 12, 16),
        remedies="--stations, --items short, --rate 120",
        usb={
            (POLHEMUS, 0xFF20): UsbTracker("LIBERTY (high-speed USB)", READY, HIGH_SPEED),
            (POLHEMUS, 0xFF21): UsbTracker("LIBERTY (high-speed USB)", WANTS_FIRMWARE),
            (POLHEMUS, 0xFF12): UsbTracker("LIBERTY", READY, FULL_SPEED),
            (POLHEMUS, 0xFF11): UsbTracker("LIBERTY", WANTS_FIRMWARE),
        },
    ),
    "patriot": Family(
        title="PATRIOT",
        decoders=_LIBERTY_DECODERS,
        driver="shukotsu.trackers.liberty.driver:LibertyDriver",
        rates_hz=(60,),
        items="shukotsu.trackers.liberty.items:OUTPUT_ITEMS",
        emulated_device="shukotsu.trackers.liberty.emulated_device:EmulatedLiberty",
        ports=(2,),
        remedies="--stations, --items short",
        usb={
            (POLHEMUS, 0xEF20): UsbTracker("PATRIOT (high-speed USB)", READY, HIGH_SPEED),
            (POLHEMUS, 0xEF21): UsbTracker("PATRIOT (high-speed USB)", WANTS_FIRMWARE),
            (POLHEMUS, 0xEF12): UsbTracker("PATRIOT", READY, FULL_SPEED),
            (POLHEMUS, 0xEF11): UsbTracker("PATRIOT", WANTS_FIRMWARE),
        },
    ),
    "fastrak": Family(
        title="FASTRAK",
        decoders={
            "binary": ("shukotsu.trackers.fastrak.binary_decoder", "BinaryDecoder"),
            "ascii": ("shukotsu.trackers.fastrak.text_decoder", "TextDecoder"),
        },
        driver="shukotsu.trackers.fastrak.driver:FastrakDriver",
        rates_hz=(120,),
        items="shukotsu.trackers.fastrak.items:OUTPUT_ITEMS",
        emulated_device="shukotsu.trackers.fastrak.emulated_device:EmulatedFastrak",
        ports=(4,),
        unsupported={"--hemisphere track": "--hemisphere: a FASTRAK does not follow a receiver; give x,y,z"},
        usb={
            (POLHEMUS, 0x0002): UsbTracker("FASTRAK", READY),
            (POLHEMUS, 0x0001): UsbTracker("FASTRAK", WANTS_FIRMWARE),
            (POLHEMUS, 0x0003): UsbTracker("FASTRAK 3", READY),
        },
    ),
    "viper": Family(
        title="VIPER",
        decoders={"binary": ("shukotsu.trackers.viper.decoder", "ViperDecoder")},
        driver="shukotsu.trackers.viper.driver:ViperDriver",
        rates_hz=(240, 120),
        record_bytes=32,
        cycle_bytes=28,
        remedies="--rate 120",
        unsupported={
            "--stations": "--stations: a VIPER sends every sensor that is connected; leave it out",
            "--ascii": f"--ascii: a VIPER {_BINARY_ONLY}",
        },
        usb={(POLHEMUS, 0xBF01): UsbTracker("VIPER", READY), (POLHEMUS, 0xCF01): UsbTracker("G4", NOT_READ)},
    ),
    "trakstar": Family(
        title="trakSTAR",
        decoders={"binary": ("shukotsu.trackers.trakstar.decoder", "FlockDecoder")},
        driver="shukotsu.trackers.trakstar.driver:TrakstarDriver",
        record_bytes=14,
        unsupported={
            "--ascii": f"--ascii: a trakSTAR {_BINARY_ONLY}",
            **_set_by("the trakSTAR's own program"),
        },
        usb={(NDI, 0x1005): UsbTracker("trakSTAR", NOT_READ)},
    ),
    "openigtlink": Family(
        title="OpenIGTLink",
        decoders={"binary": ("shukotsu.trackers.openigtlink.decoder", "MessageDecoder")},
        driver="shukotsu.trackers.openigtlink.driver:OpenIGTLinkDriver",
        record_bytes=106,
        emulated_device="shukotsu.trackers.openigtlink.emulated_device:EmulatedServer",
        ports=(16,),
        unsupported={
            "--stations": "--stations: an OpenIGTLink server sends every tool; leave it out",
            "--ascii": f"--ascii: OpenIGTLink {_BINARY_ONLY}",
            **_set_by("the program that serves OpenIGTLink"),
        },
        scheme="igtl",
    ),
    "lsl": Family(
        title="LSL",
        decoders={"binary": ("shukotsu.trackers.lsl.decoder", "LslDecoder")},
        driver="shukotsu.trackers.lsl.driver:LslDriver",
        record_bytes=28,
        cycle_bytes=8,
        scheme="lsl",
        unsupported={
            "--stations": "--stations: an LSL stream is recorded whole; leave it out",
            "--ascii": f"--ascii: an LSL stream {_BINARY_ONLY}",
            **_set_by("the LSL stream's sender"),
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


def family_at(port: str, named: str | None) -> str:
    """Give the family of the tracker at a port: `named`, or what the port's name says, or else the usual one.

    Raises InputError where the two differ.
    """
    scheme = port.partition(":")[0]
    own = next((name for name, family in FAMILIES.items() if family.scheme and family.scheme == scheme), None)
    own_ports = named is not None and FAMILIES[named].scheme
    if (own is not None and named not in (None, own)) or (own_ports and named != own):
        expected = own or f"a port {own_ports}:..."
        raise InputError(f"--tracker: is {named}, and --port is {port}; expected {expected}, or leave it out")
    return own or named or USUAL


def output_items(family: str) -> OutputItems | None:
    """Give the items that a record can hold; None where records are always the same."""
    name = FAMILIES[family].items
    items: OutputItems | None = None if name is None else loaded(name)
    return items


def loaded(name: str) -> Any:
    """Import the object that `module:object` names."""
    module, _, attribute = name.partition(":")
    return getattr(importlib.import_module(module), attribute)
