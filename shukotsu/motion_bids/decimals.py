"""Numbers as decimal text, the decimal point shifted in the text, so that a unit costs no digit."""

from __future__ import annotations

from decimal import Decimal

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


def text_of(values: npt.NDArray[np.float64], shift: int = 0) -> pa.Array:
    """Write every value times 10**shift as decimal text, shift <= 0, shape (N,); NaN becomes null.

    `numbers_of(text, -shift)` gives the same 64 bits back: the point is moved in the shortest text that
    stands for the value, which no division does. Raises ValueError where a value is infinite.
    """
    if np.isinf(values).any():
        raise ValueError("an infinite value has no decimal text")
    text = pc.cast(pa.array(values, from_pandas=True), pa.string())
    if not shift:
        return text
    parts = pc.extract_regex(text, r"^(?P<sign>-?)(?P<whole>[0-9]+)\.?(?P<rest>[0-9]*)$")
    whole = pc.utf8_lpad(pc.struct_field(parts, "whole"), 1 - shift, padding="0")
    head = pc.utf8_slice_codeunits(whole, 0, stop=shift)
    tail = pc.utf8_slice_codeunits(whole, shift)
    sign, rest = pc.struct_field(parts, "sign"), pc.struct_field(parts, "rest")
    shifted = pc.binary_join_element_wise(sign, pc.binary_join_element_wise(head, tail, "."), rest, "")
    with_exponent = pc.and_(pc.is_valid(text), pc.is_null(parts))
    odd = [str(Decimal(number).scaleb(shift)) for number in text.filter(with_exponent).to_pylist()]
    return pc.replace_with_mask(shifted, with_exponent, pa.array(odd, pa.string()))


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
