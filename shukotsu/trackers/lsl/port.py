"""An LSL stream as a port: what it brings is framed, so that the archive holds all of it as bytes."""

from __future__ import annotations

import importlib
import os
import time
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np

from shukotsu.errors import InputError
from shukotsu.files.xdf_streams import described, owners
from shukotsu.trackers.lsl.decoder import CLOCK, DESCRIPTION, FIRST, OFFSET, SAMPLES, framed, sample_type
from shukotsu.trackers.record.port import WAIT_S, Port, PortGoneError

DESCRIBE, START, STOP = b"describe\n", b"start\n", b"stop\n"
CONNECT_S = 5.0
OFFSET_S = 5.0
RESOLVE_S = 1.0
BUFFERED_S = 60
"""LSL keeps so much of a stream with a rate for a recorder that is late; of others a hundred samples each."""

MOST_SAMPLES_BYTES = 1 << 16
SETTINGS = ("lsl_api.cfg", "~/lsl_api/lsl_api.cfg", "/etc/lsl_api/lsl_api.cfg")
"""Where LSL looks for what a user has set."""


@cache
def pylsl() -> Any:
    """Give the package, which only warns where the user has no settings of LSL.

    Raises InputError where it is not installed, or does not run here.
    """
    try:
        lsl = importlib.import_module("pylsl")
    except (ImportError, OSError, RuntimeError) as error:
        raise InputError("LSL needs pylsl (pip install pylsl; on Linux with glibc 2.35 or newer)") from error
    if "LSLAPICFG" not in os.environ and not any(Path(file).expanduser().exists() for file in SETTINGS):
        lsl.set_config_content("[log]\nlevel = -1\n")
    return lsl


def resolved(lsl: Any, name: str) -> Any:
    """Give the stream of that name or source_id; without a name the one of type MoCap. Raises InputError."""
    for _ in range(3):
        found = lsl.resolve_streams(RESOLVE_S)
        own = [s for s in found if name in (s.name(), s.source_id()) or (not name and s.type() == "MoCap")]
        if len(own) == 1:
            return own[0]
    known = ", ".join(sorted(f"{s.name()} (source_id {s.source_id()})" for s in found)) or "none"
    what = f"name {name!r}" if name else "type MoCap"
    raise InputError(
        f"--port lsl:{name} is {len(own) or 'none'} of the LSL streams by {what}; expected one of these: "
        f"{known}; start its sender, or give its source_id"
    )


def stream_lines() -> list[str]:
    """List the streams that have poses, as ports; nothing where pylsl is not installed."""
    try:
        lsl = pylsl()
    except InputError:
        return []
    lines = []
    for found in lsl.resolve_streams(RESOLVE_S):
        try:
            stream = described("", lsl.StreamInlet(found, recover=False).info(RESOLVE_S).as_xml().encode())
        except (RuntimeError, InputError):  # it has just ended, or is not described
            continue
        if objects := len(owners(stream)):
            what = f"LSL stream of {found.hostname()}, {objects} objects, {stream.rate_hz:g} Hz"
            lines.append(f"lsl:{stream.name}  {what}")
    return sorted(lines)


class LslPort(Port):
    """The port `lsl:NAME`, or `lsl:NAME?unit=mm` for a stream that does not say its unit.

    What is written to it is one of DESCRIBE, START and STOP. A stream that ends is gone, and is not looked
    for again: another that takes its name may be another device. Raises InputError where there is none.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        stream, _, option = name.partition(":")[2].partition("?")
        self.unit = option.removeprefix("unit=").lower()
        self._lsl = pylsl()
        self._inlet = self._lsl.StreamInlet(resolved(self._lsl, stream), BUFFERED_S, recover=False)
        number_format = self._lsl.lib.fmt2string[self._inlet.channel_format]
        try:
            self._row = sample_type(number_format, self._inlet.channel_count)
        except KeyError as error:
            raise InputError(f"{name}: holds no numbers; expected a stream of poses") from error
        if self._row.itemsize > MOST_SAMPLES_BYTES:
            raise InputError(f"{name}: has {self._inlet.channel_count} channels; expected poses alone")
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._streaming = self._draining = False
        self._count, self._offset_at = 0, 0.0

    def read(self) -> bytes:
        """Return what has come, waiting at most WAIT_S; empty where nothing came. Raises PortGoneError."""
        try:
            answer = self._answers.get(timeout=0 if self._streaming or self._draining else WAIT_S)
        except Empty:
            answer = b""
        if not self._streaming and not self._draining:
            return answer
        came = self._pulled(WAIT_S if self._streaming else 0.0)
        self._draining = self._draining and bool(came)
        return answer + came

    def _pulled(self, wait_s: float) -> bytes:
        """Give a sample and those that wait; more are not asked for, as a stream's end would cost them."""
        try:
            pulled = [self._inlet.pull_chunk(wait_s, 1, as_numpy=True)]
            waiting = min(self._inlet.samples_available(), MOST_SAMPLES_BYTES // self._row.itemsize)
            pulled += [self._inlet.pull_chunk(0.0, waiting, as_numpy=True)] if waiting else []
        except RuntimeError as error:
            raise PortGoneError("the stream has ended") from error
        samples = np.empty(sum(len(stamps) for _, stamps in pulled), self._row)
        if not len(samples):
            return b""
        samples["values"], samples["stamp"] = map(np.concatenate, zip(*pulled, strict=True))
        first, self._count = self._count, self._count + len(samples)
        data = framed(SAMPLES, FIRST.pack(first & 0xFFFFFFFF) + samples.tobytes())
        return data if time.perf_counter() < self._offset_at else data + self._offset(WAIT_S)

    def _offset(self, wait_s: float) -> bytes:
        """Ask for the clock offset; nothing where the sender's clock does not answer."""
        self._offset_at = time.perf_counter() + OFFSET_S
        try:
            offset = self._inlet.time_correction(wait_s)
        except RuntimeError:
            return b""
        return framed(OFFSET, CLOCK.pack(self._lsl.local_clock() - offset, offset))

    def write(self, data: bytes) -> None:
        """Obey. Raises PortGoneError where the stream has ended."""
        try:
            if data == DESCRIBE:
                xml = self._inlet.info(CONNECT_S).as_xml().encode()
                self._answers.put(framed(DESCRIPTION, xml) + self._offset(CONNECT_S))
            elif data == START:
                self._count = 0
                self._inlet.open_stream(CONNECT_S)
                self._inlet.flush()
                self._answers.put(self._offset(CONNECT_S))
                self._streaming = True
            else:
                self._draining, self._streaming = self._streaming, False
        except RuntimeError as error:
            raise PortGoneError("the stream has ended") from error

    def close(self) -> None:
        """Leave the stream."""
        self._inlet.close_stream()
