"""Second pass over an archive: records with device time and flags."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shukotsu.trackers.archive import Archive
from shukotsu.trackers.decode.stream import Block, Tally, blocks_of
from shukotsu.trackers.decode.survey import Survey
from shukotsu.trackers.protocols.records import Bools, Records

FLAGS = {
    "gap-before": "frames are missing between this record and the station's one before",
    "resync-before": "bytes that are no record lie before it",
    "partial-cycle": "another station's record is missing in this frame",
    "doubtful": "framed as a record should be, but its numbers cannot be right",
    "out-of-order": "its frame or station does not fit between its neighbours'",
    "device-error": "the tracker's error letter says that the pose is wrong (a to g, A to G)",
    "device-warning": "its error letter is another one (I: self-test errors, u: unmapped place)",
    "distorted": "the tracker saw its field distorted by metal",
}
"""What a record's flags say; bit i of the number stands for the i-th."""

BIT = {flag: np.uint16(1 << place) for place, flag in enumerate(FLAGS)}

UNUSABLE = ("doubtful", "out-of-order")
"""Records of which not even the station and frame can be believed."""

SOURCE_FAILURES = b"abcdefgABCDEFG"


@dataclass(frozen=True)
class FlaggedRecords:
    """Records of a block: time_s (N,) device time, flags (N,) bits as in FLAGS, host_ns (N,) of arrival."""

    records: Records
    time_s: npt.NDArray[np.float64]
    host_ns: npt.NDArray[np.int64]
    flags: npt.NDArray[np.uint16]

    def flagged(self, *names: str) -> Bools:
        """Whether a record has any of the flags, shape (N,)."""
        mask = np.bitwise_or.reduce([BIT[name] for name in names])
        return np.asarray((self.flags & mask) != 0)


def flagged_records(archive: Archive, survey: Survey) -> Iterator[FlaggedRecords]:
    """Decode the archive again, with what the survey found; blocks without a record are left out."""
    if survey.clock is None:
        return
    for block in blocks_of(archive, Tally()):
        if len(block.records):
            time_s = survey.clock.time_s(block.records.frame)
            yield FlaggedRecords(block.records, time_s, block.host_ns, _flags(block, survey))


def _flags(block: Block, survey: Survey) -> npt.NDArray[np.uint16]:
    records = block.records
    flags = np.zeros(len(records), np.uint16)
    flags[records.doubtful] |= BIT["doubtful"]
    flags[block.out_of_order] |= BIT["out-of-order"]
    source = np.isin(records.error, list(SOURCE_FAILURES))
    flags[source] |= BIT["device-error"]
    flags[(records.error != 0) & ~source] |= BIT["device-warning"]
    flags[(records.distortion > 0) & ~records.doubtful] |= BIT["distorted"]
    flags[np.isin(records.frame, survey.partial_frames)] |= BIT["partial-cycle"]
    resumed = [offset + size for offset, size, _ in survey.skipped]
    flags[np.isin(records.offset, resumed)] |= BIT["resync-before"]
    for station in np.unique(records.station).tolist():
        resumes = survey.gaps[survey.gaps[:, 0] == station, 2] + 1
        flags[(records.station == station) & np.isin(records.frame, resumes)] |= BIT["gap-before"]
    return flags
