"""CRC-16/ARC (polynomial 0x8005, reflected, start 0) of many byte strings of one length at a time."""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

Checksums = npt.NDArray[np.uint16]

_REFLECTED_POLYNOMIAL = np.uint16(0xA001)
_BLOCK_WORDS = 1 << 20


def crc16_arc(rows: npt.NDArray[np.uint8]) -> Checksums:
    """Checksums of N byte strings.

    rows : (N, L), the strings. Returns (N,).

    The CRC is linear and starts at 0, so zeros in front change nothing, and that of two halves is the first
    one's pushed on by the second's length, plus the second one's: pairs of words, of pairs, and so on.
    """
    odd = rows.shape[1] % 2
    step = max(1, _BLOCK_WORDS // max(1, rows.shape[1] // 2))
    sums = np.zeros(len(rows), np.uint16)
    for first in range(0, len(rows), step):
        block = rows[first : first + step]
        words = np.zeros((len(block), rows.shape[1] + odd), np.uint8)
        words[:, odd:] = block
        sums[first : first + step] = _folded(words.view("<u2"))
    return sums


def _folded(words: Checksums) -> Checksums:
    if not words.shape[1]:
        return np.zeros(len(words), np.uint16)
    level = 0
    sums = _pushed_on(0)[words]
    while sums.shape[1] > 1:
        if sums.shape[1] % 2:
            sums = np.concatenate([np.zeros((len(sums), 1), np.uint16), sums], 1)
        sums = _pushed_on(level)[sums[:, ::2]] ^ sums[:, 1::2]
        level += 1
    return sums[:, 0]


@cache
def _pushed_on(level: int) -> Checksums:
    """Where each of the 65536 registers gets to by 2^level words of zeros."""
    if level:
        half = _pushed_on(level - 1)
        return half[half]
    register = np.arange(65536, dtype=np.uint16)
    for _ in range(16):
        register = (register >> np.uint16(1)) ^ (register & np.uint16(1)) * _REFLECTED_POLYNOMIAL
    return register
