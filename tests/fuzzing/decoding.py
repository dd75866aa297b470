"""What must hold for a decoder, whatever bytes it is given."""

from __future__ import annotations

import json
import random
from collections.abc import Iterable
from dataclasses import fields
from itertools import pairwise

import numpy as np

from shukotsu.errors import InputError
from shukotsu.trackers.decode.stream import DECODERS
from shukotsu.trackers.protocols.piecewise import PiecewiseDecoder as Decoder
from shukotsu.trackers.protocols.records import Decoded, Records, Reply, concatenated
from shukotsu.trackers.protocols.stream_settings import StreamSettings, settings_from_json

MOST_FRAMING = 12
"""Bytes of a reply that are not its body, at the most: VIPER's leader and checksum."""


def decode(decoder: Decoder, data: bytes, cuts: Iterable[int] = ()) -> Decoded:
    """Feed the stream, cut at the given places, to its end; give all that came out."""
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    parts = [decoder.feed(data[a:b]) for a, b in pairwise(edges)]
    parts.append(decoder.feed(b"", final=True))
    return Decoded(
        concatenated([part.records for part in parts]),
        tuple(skip for part in parts for skip in part.skipped),
        tuple(reply for part in parts for reply in part.replies),
    )


def skipped_bytes(decoded: Decoded) -> list[int]:
    """Give the places of all skipped bytes."""
    return [i for skip in decoded.skipped for i in range(skip.offset, skip.offset + skip.size)]


def check_same(one: Decoded, other: Decoded) -> None:
    """AssertionError where two decodings of a stream differ."""
    for part in fields(Records):
        np.testing.assert_array_equal(getattr(one.records, part.name), getattr(other.records, part.name))
    assert skipped_bytes(one) == skipped_bytes(other), "other bytes are skipped"
    assert one.replies == other.replies, "other replies"


def check_tiles(decoded: Decoded, length: int) -> None:
    """AssertionError unless every byte is in one record, reply or skip; a reply is its body and its frame."""
    stretches: list[tuple[int, int | Reply]] = [(skip.offset, skip.size) for skip in decoded.skipped]
    stretches += zip(decoded.records.offset.tolist(), decoded.records.size.tolist(), strict=True)
    stretches += [(reply.offset, reply) for reply in decoded.replies]
    stretches.sort(key=lambda stretch: stretch[0])
    place = 0
    ends = [*(first for first, _ in stretches), length][1:]
    for (first, size), following in zip(stretches, ends, strict=True):
        assert first == place, f"byte {place} is in nothing, or in two things"
        if isinstance(size, Reply):
            assert 0 <= following - first - len(size.body) <= MOST_FRAMING, f"reply at {first}"
            place = following
        else:
            assert size > 0, f"nothing at {first}"
            place += size
    assert place == length, f"ends at {place}, the stream at {length}"


def check_decoder(settings: StreamSettings, data: bytes, chance: random.Random) -> str:
    """Decode, and for every third stream in pieces too. AssertionError where something does not hold."""
    decoded = decode(DECODERS[settings.family](settings), data)
    check_tiles(decoded, len(data))
    if chance.randrange(3) == 0:
        cuts = [chance.randint(0, len(data)) for _ in range(chance.randint(1, 10))]
        check_same(decoded, decode(DECODERS[settings.family](settings), data, cuts))
    return "decoded" if len(decoded.records) else "nothing in it"


def check_settings(text: bytes, data: bytes, chance: random.Random) -> str:
    """Decode a stream by settings that may be spoilt; they must be refused, or be good enough."""
    try:
        loaded = json.loads(text)
    except (ValueError, RecursionError):
        return "no JSON"
    try:
        settings = settings_from_json(loaded, "a.arrows")
        DECODERS[settings.family](settings)
    except InputError:
        return "refused"
    return check_decoder(settings, data, chance)
