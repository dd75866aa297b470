"""Numbers as decimal text, the decimal point shifted in the text, so that a unit costs no digit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

_NUMBER = r"^\s*(?P<digits>[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[eE]\+?(?P<power>-?[0-9]{1,6}))?\s*$"


class NotANumberError(ValueError):
    """A text that is no decimal number; `index` says which."""

    def __init__(self, index: int) -> None:
        super().__init__(f"text {index} is no number")
        self.index = index


def numbers_of(text: pa.Array, shift: int = 0) -> npt.NDArray[np.float64]:
    """Read decimal texts times 10**shift, shape (N,), rounded once; NaN where null.

    Raises NotANumberError at the first text that is no finite decimal number.
    """
    try:
        return _joined(text, f"e{shift}")
    except pa.ArrowInvalid:  # some text has an exponent of its own, or is no number
        return _parsed(text, shift)


def _parsed(text: pa.Array, shift: int) -> npt.NDArray[np.float64]:
    parts = pc.extract_regex(text, _NUMBER)
    bad = pc.and_(pc.is_valid(text), pc.is_null(parts)).to_numpy(zero_copy_only=False)
    if bad.any():
        raise NotANumberError(int(np.argmax(bad)))
    power = pc.struct_field(parts, "power")
    own = pc.cast(pc.if_else(pc.equal(power, ""), "0", power), pa.int64())
    return _joined(pc.struct_field(parts, "digits"), "e", pc.cast(pc.add(own, shift), pa.string()))


def _joined(*parts: pa.Array | str) -> npt.NDArray[np.float64]:
    text = pc.binary_join_element_wise(*parts, "")
    return np.asarray(pc.cast(text, pa.float64()).to_numpy(zero_copy_only=False), float)
