"""Random damage: to bytes, and to a value somewhere in JSON or YAML that stays well-formed."""

from __future__ import annotations

import copy
import json
import random
from typing import Any

import yaml

TOKENS = (
    *(b"LY", b"PA", b"VPRP", b"VPRC", b"01", b"02  ", b"\r\n", b"nan", b"inf", b"1e999", b"-", b".", b","),
    *(bytes(4), b"\xff" * 4, b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\t", b'"', b"\xef\xbb\xbf", b"{}"),
    *(b"n/a", b"null", b"1e308", b"-0", b"9" * 20, b"[", b"]", b": ", b"- ", b"&a ", b"*a", b"\0", b"\x85"),
    *(b"\xc3\xa9", b"\xed\xa0\x80", b"99999:59:59", b"<![CDATA[", b"&#0;", b"MATRIX", b"!!python/name:os "),
)
_VALUES: tuple[Any, ...] = (
    *(None, True, -1, 0, 2, 7, 16, 77, 10**400, 1e308, 1e-320, float("nan"), float("inf"), "", "viper"),
    *(
        "ascii",
        "inch",
        "7",
        "\0",
        "\ud800",
        "x" * 300,
        "../..",
        "/dev/zero",
        [],
        [1],
        [[]],
        {},
        {"1": [2, 4]},
    ),
)


def damage(data: bytes, chance: random.Random) -> bytes:
    """Change bytes in up to 8 places: other bits, other bytes, less, more, the same again, cut off."""
    out = bytearray(data)
    for _ in range(chance.randint(0, 8)):
        place = chance.randint(0, len(out))
        length = chance.choice((1, 1, 1, 2, 4, 8, chance.randint(0, 200)))
        kind = chance.randrange(8)
        if kind == 0 and place < len(out):
            out[place] ^= 1 << chance.randrange(8)
        elif kind == 1:
            out[place : place + length] = chance.randbytes(length)
        elif kind == 2:
            del out[place : place + length]
        elif kind == 3:
            out[place:place] = chance.randbytes(length)
        elif kind == 4:
            out[place:place] = out[place : place + length]
        elif kind == 5:
            out[place : place + length] = chance.choice(TOKENS)
        elif kind == 6:
            first = chance.randint(0, len(out))
            out[place : place + length] = out[first : first + length]
        elif chance.randrange(8) == 0:
            del out[place:]
    return bytes(out)


def damage_values(data: bytes, chance: random.Random) -> bytes:
    """Change up to three values of a JSON or YAML text; every third time, or where it is none, its bytes."""
    if chance.randrange(3) == 0:
        return damage(data, chance)
    try:
        loaded = yaml.load(data, Loader=yaml.CSafeLoader)  # JSON is YAML
    except (yaml.YAMLError, ValueError, RecursionError):
        return damage(data, chance)
    if not isinstance(loaded, dict | list):
        return damage(data, chance)
    for _ in range(chance.randint(1, 3)):
        _damage_value(loaded, chance)
    try:
        return json.dumps(loaded, default=str).encode()
    except (ValueError, TypeError, RecursionError):
        return damage(data, chance)


def _damage_value(loaded: Any, chance: random.Random) -> None:
    """Change one value, or one key, somewhere in lists and objects to one of another kind or size."""
    inside = loaded
    while True:
        keys = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
        if not keys:
            return
        key = chance.choice(keys)
        if isinstance(inside[key], dict | list) and chance.randrange(6):
            inside = inside[key]
            continue
        change = chance.randrange(8)
        if change == 0:
            del inside[key]
        elif change == 1 and isinstance(inside, dict):
            inside[str(chance.choice(_VALUES))] = inside.pop(key)
        elif change == 2:
            other = chance.choice(keys)
            inside[key] = copy.deepcopy(inside[other])
        else:
            inside[key] = copy.deepcopy(chance.choice(_VALUES))
        return
