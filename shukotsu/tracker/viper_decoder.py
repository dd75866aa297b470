"""Protocol of the Polhemus VIPER: pose frames with all sensors, and command frames, both with a checksum.

A frame consists of a preamble, the number of bytes that follow, a body, and a CRC field whose low 16 bits are
the CRC-16/ARC of everything before it; all little-endian. Source: Polhemus VIPER interface header; VIPER User
Manual URM18PH392.
"""

from __future__ import annotations

import re
import struct

import numpy as np
import numpy.typing as npt

from shukotsu.arrays import Bools, Integers
from shukotsu.tracker import records as protocol
from shukotsu.tracker.records import MM_PER_UNIT, Bytes, Decoded, Records, Reply, doubtful_poses

COMMAND_PREAMBLE, POSE_PREAMBLE = b"VPRC", b"VPRP"
LEADER_BYTES, POSE_HEADER_BYTES, COMMAND_HEADER_BYTES, CRC_BYTES = 8, 24, 28, 4
SENSORS = 16
MAX_FRAME_BYTES = 4096
"""Longer than any reply; a larger byte count must be damaged."""
SET, GET, RESET, ACKNOWLEDGED, REFUSED, WARNED = range(6)
"""Action that a command requests, or result that its reply states."""
SINGLE, CONTINUOUS = 18, 19
ANY = 0xFFFFFFFF

_MM = np.array([MM_PER_UNIT[unit] for unit in ("inch", "foot", "cm", "m")])
_QUATERNION, _WITH_ACCELERATION, _FULL_SCALE = 2, 1, 32768
_SENSOR = np.dtype([("info", "<u4"), ("position", "<f4", (3,)), ("orientation", "<f4", (4,))])
_COUNT_AT = 20
_PREAMBLE, _CUT_OFF = re.compile(b"VPR[CP]"), re.compile(rb"VPR[CP]|(V|VP|VPR)\Z")

_REGISTERS = np.arange(256, dtype=np.uint16)
for _ in range(8):
    _REGISTERS = (_REGISTERS >> np.uint16(1)) ^ (_REGISTERS & np.uint16(1)) * np.uint16(0xA001)


def crc16_arc(rows: Bytes) -> npt.NDArray[np.uint16]:
    """Return the CRC-16/ARC (polynomial 0x8005, reflected, start 0) of N rows of bytes, (N, L) -> (N,)."""
    register = np.zeros(len(rows), np.uint16)
    for column in np.ascontiguousarray(rows.T):
        register = (register >> 8) ^ _REGISTERS[(register ^ column) & 0xFF]
    return register


def command_frame(
    command: int, action: int, sensor: int = ANY, argument: int = 0, payload: bytes = b""
) -> bytes:
    """Return the bytes of a command frame.

    command : its number (0 hemisphere ... 30 source select). action : SET, GET or RESET. sensor : from 0, ANY
    for all. argument : second argument of the command. payload : data that follow.
    """
    body = struct.pack("<5I", ANY, command, action, sensor, argument) + payload
    frame = COMMAND_PREAMBLE + struct.pack("<I", len(body) + CRC_BYTES) + body
    return frame + struct.pack("<I", int(crc16_arc(np.frombuffer(frame, np.uint8)[None])[0]))


class ViperDecoder(protocol.PiecewiseDecoder):
    """Decoder of a VIPER stream.

    The bytes before a frame's first sensor belong to that sensor's record, the CRC field to the last one's.
    Every record states its units, so no setting is needed. A pose frame without sensors is a reply to
    CONTINUOUS. The station is sensor + 1; virtual sensors have stations above 128 and are marked doubtful.
    """

    def _decide(self, b: Bytes, final: bool) -> tuple[Decoded, int]:
        at, end, is_pose = _possible_frames(b)
        kept, waiting_at = _disjoint(at, end, _sound(b, at, end), (end > len(b)) & (not final))
        at, end, is_pose = at[kept], end[kept], is_pose[kept]
        decided = len(b)
        if waiting_at is not None:
            decided = waiting_at
        elif not final:  # a frame whose header is cut off may begin after the others
            cut_off = _CUT_OFF.search(b.data, max(int(end.max(initial=0)), len(b) - POSE_HEADER_BYTES + 1))
            decided = cut_off.start() if cut_off else len(b)
        is_pose = is_pose & (end - at > POSE_HEADER_BYTES + CRC_BYTES)
        pose_at, sizes = at[is_pose], (end - at)[is_pose]
        of_size = [(pose_at[sizes == size], int(size)) for size in np.unique(sizes)]
        parts = [_records_of_size(protocol.rows_at(b, first, size), first) for first, size in of_size]
        records = protocol.concatenate_records(parts)
        records = records if len(parts) < 2 else records.take(np.argsort(records.offset))
        replies = tuple(_reply(b, int(at[row]), int(end[row])) for row in np.flatnonzero(~is_pose))
        return Decoded(records, protocol.gaps(at, end, decided), replies), decided


def _disjoint(at: Integers, end: Integers, good: Bools, waiting: Bools) -> tuple[Integers, int | None]:
    """Return indices of the good frames before the first that still waits for bytes, and its first byte.

    Frames inside the body of an accepted frame are skipped.
    """
    kept, position = list[int](), 0
    for index in np.flatnonzero(good | waiting).tolist():
        if at[index] < position:
            continue
        if waiting[index]:
            return np.array(kept, np.int64), int(at[index])
        kept.append(index)
        position = int(end[index])
    return np.array(kept, np.int64), None


def _possible_frames(b: Bytes) -> tuple[Integers, Integers, Bools]:
    """Return plausible frames: their first byte, the first byte after, and whether they are pose frames."""
    heads = b[: max(0, len(b) - POSE_HEADER_BYTES + len(POSE_PREAMBLE))]
    at = np.fromiter((preamble.start() for preamble in _PREAMBLE.finditer(heads.data)), np.int64)
    is_pose = b[at + 3] == POSE_PREAMBLE[3]
    size = _read_unsigned(b, at + 4) + LEADER_BYTES
    sensors = _read_unsigned(b, at + _COUNT_AT)
    of_poses = size == POSE_HEADER_BYTES + _SENSOR.itemsize * sensors + CRC_BYTES
    of_command = (size >= COMMAND_HEADER_BYTES + CRC_BYTES) & (size <= MAX_FRAME_BYTES)
    possible = np.where(is_pose, of_poses & (sensors <= 2 * SENSORS), of_command)
    return at[possible], (at + size)[possible], is_pose[possible]


def _read_unsigned(b: Bytes, at: Integers) -> Integers:
    """Return the unsigned 32-bit numbers at positions `at`."""
    return sum(((b[at + index].astype(np.int64) << 8 * index) for index in range(4)), np.zeros_like(at))


def _sound(b: Bytes, at: Integers, end: Integers) -> Bools:
    """Return whether frames are complete and have the right checksum."""
    good = np.zeros(len(at), bool)
    whole = end <= len(b)
    for size in np.unique((end - at)[whole]):
        mine = np.flatnonzero(whole & (end - at == size))
        for some in np.array_split(mine, 1 + len(mine) * int(size) // (1 << 22)):
            rows = protocol.rows_at(b, at[some], int(size))
            sent = _read_unsigned(b, end[some] - CRC_BYTES) & 0xFFFF
            good[some] = crc16_arc(rows[:, :-CRC_BYTES]) == sent
    return good


def _reply(b: Bytes, at: int, end: int) -> Reply:
    """Read a command frame, or a pose frame without sensors; the body starts with the unit's id."""
    body = b[at + LEADER_BYTES : end - CRC_BYTES].tobytes()
    if b[at + 3] == POSE_PREAMBLE[3]:
        return Reply(at, 0, CONTINUOUS, 0, body)
    _, command, action = struct.unpack_from("<3I", body)
    return Reply(at, 0, command, action if action in (REFUSED, WARNED) else 0, body)


def _records_of_size(rows: Bytes, at: Integers) -> Records:
    """Read the records of M pose frames of the same size; rows : (M, size) bytes, at : (M,) positions."""
    body = np.ascontiguousarray(rows[:, POSE_HEADER_BYTES:-CRC_BYTES])
    sensors = body.view(_SENSOR)
    per_frame = sensors.shape[1]
    header = np.ascontiguousarray(rows[:, LEADER_BYTES:POSE_HEADER_BYTES]).view("<u4")
    info = sensors["info"].ravel()
    records = protocol.empty_records(sensors.size)
    starts = np.arange(per_frame) * _SENSOR.itemsize + POSE_HEADER_BYTES
    starts[0] = 0
    records.offset[:] = (at[:, None] + starts).ravel()
    records.size[:] = np.tile(np.diff(starts, append=rows.shape[1]), len(rows))
    records.station[:] = (info & 0xFF) + 1
    records.frame[:] = np.repeat(header[:, 1], per_frame)
    records.distortion[:] = info >> 14 & 0xFF
    records.button[:] = info >> 12 & 3
    mm = _MM[info >> 8 & 3]
    with np.errstate(invalid="ignore", over="ignore"):
        sent = sensors["position"].reshape(-1, 3)
        records.position_mm[:] = sent.astype(float) * mm[:, None]
        accelerated = np.repeat(header[:, 2] & 0xF == _WITH_ACCELERATION, per_frame)
        orientation = sensors["orientation"].reshape(-1, 4)
        quaternion = orientation.astype(float)
        if accelerated.any():  # four 16-bit numbers of orientation, then four of acceleration
            wholes = np.ascontiguousarray(orientation[accelerated]).view("<i2")[:, :4]
            quaternion[accelerated] = wholes / _FULL_SCALE
        quaternion[info >> 10 & 3 != _QUATERNION] = np.nan  # Euler angles, which this recorder never requests
        records.quaternion[:] = quaternion
        records.doubtful[:] = doubtful_poses(records) | (records.station > SENSORS)
    return records
