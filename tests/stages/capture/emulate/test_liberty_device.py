"""The emulated LIBERTY without any port: commands, answers, counters and what is measured."""

import struct
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.capture.emulate.device import World
from stages.capture.emulate.faults import parse_fault
from stages.capture.emulate.liberty import Liberty
from stages.capture.emulate.poses_source import BuiltInMotion, RecordedMotion
from stages.capture.trackers.families import decoder_of
from stages.capture.trackers.liberty.items import FULL_LIST
from stages.capture.trackers.settings import StreamSettings

ALL = frozenset(range(1, 17))
INVALID = b"Invalid Command\r\n"


def device(stations: frozenset[int] = ALL, **world: object) -> Liberty:
    return Liberty(World(BuiltInMotion(), stations, **world))  # type: ignore[arg-type]


def told(tracker: Liberty, *commands: bytes) -> bytes:
    return b"".join(tracker.receive(command) for command in commands)


def body(reply: bytes) -> bytes:
    size = struct.unpack_from("<h", reply, 6)[0]
    assert len(reply) == 8 + size
    return reply[8:]


def cycles(tracker: Liberty, count: int) -> bytes:
    return b"".join(tracker.next_cycle().data for _ in range(count))


def records(data: bytes, size: int) -> list[bytes]:
    assert len(data) % size == 0
    return [data[at : at + size] for at in range(0, len(data), size)]


QUERIES = {
    # query: (ASCII body, binary body) of a device as the factory leaves it
    b"U": (b"0", struct.pack("<i", 0)),
    b"R": (b"4", struct.pack("<i", 4)),
    b"D": (b"0", struct.pack("<i", 0)),
    b"Z": (b"0", struct.pack("<i", 0)),
    b"\x05": (b"0", struct.pack("<i", 0)),
    b"@B": (b"1", struct.pack("<i", 1)),
    b"G": (b"   0.000    0.000    0.000 ", struct.pack("<3f", 0, 0, 0)),
    b"X": (b" 0.200  0.200  0.800  0.950 ", struct.pack("<4f", 0.2, 0.2, 0.8, 0.95)),
    b"Y": (b" 0.200  0.200  0.800  0.950 ", struct.pack("<4f", 0.2, 0.2, 0.8, 0.95)),
    b"\x0f": (b"115200 N", struct.pack("<2i", 7, 0)),
    b"\x14": (b" ".join([b"0x00000000"] * 18), bytes(72)),
    b"\x150": (b"ffffffff", struct.pack("<HH", 0xFFFF, 0xFFFF)),
}
STATION_QUERIES = {
    b"A": (
        b"   0.00   0.00   0.00\r\n   1.00   0.00   0.00\r\n   0.00   1.00   0.00\r\n",
        struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0),
    ),
    b"B": (b"   0.00    0.00    0.00 ", struct.pack("<3f", 0, 0, 0)),
    b"H": (b"  1.000  0.000  0.000", struct.pack("<3f", 1, 0, 0)),
    b"L": (b"0", struct.pack("<i", 0)),
    b"N": (b" 0.000  0.000  0.000 ", struct.pack("<3f", 0, 0, 0)),
    b"O": (b"2 4 1", struct.pack("<4i", 2, 4, 1, -1)),
    b"\x15": (b"1" * 16, struct.pack("<HH", 0xFFFF, 0xFFFF)),
}


def letter(query: bytes) -> bytes:
    return query[:1] if query[0] >= 0x20 else bytes([query[0] + 0x60])


@pytest.mark.parametrize("query", QUERIES)
def test_queries_of_the_device_are_answered_in_both_modes(query: bytes) -> None:
    tracker = device()
    text, data = QUERIES[query]
    assert told(tracker, query + b"\r") == b"00" + letter(query) + b"  " + text + b"\r\n"
    assert told(tracker, b"F1\r") == b""
    header = b"LY" + bytes((0, query[0], 0, 0)) + struct.pack("<h", len(data))
    assert told(tracker, query.lower() + b"\r") == header + data


@pytest.mark.parametrize("query", STATION_QUERIES)
def test_queries_of_a_station_are_answered_in_both_modes(query: bytes) -> None:
    tracker = device()
    text, data = STATION_QUERIES[query]
    assert told(tracker, query + b"7\r") == b"07" + letter(query) + b"  " + text + b"\r\n"
    told(tracker, b"F1\r")
    header = b"LY" + bytes((7, query[0], 0, 0)) + struct.pack("<h", len(data))
    assert told(tracker, query + b"7\r") == header + data
    assert told(tracker, query + b"17\r")[4] == 2, "Invalid Station"
    assert told(tracker, query + b"\r")[4] == 4, "Too Few Parameters"


def test_other_answers_are_framed_too() -> None:
    tracker = device()
    for query in (b"\x16\r", b"\x163\r", b"\x18\r", b"\x04\r", b"\x041\r"):
        assert told(tracker, query).endswith(b"\r\n")
    assert told(tracker, b"\x1a0\r").startswith(b"00z")
    told(tracker, b"F1\r")
    assert body(told(tracker, b"\x16\r"))[:3] == bytes((16, 0, 0))
    assert len(body(told(tracker, b"\x18\r"))) == 6 * 16
    assert len(body(told(tracker, b"\x04\r"))) == 3 * 16
    assert len(told(tracker, b"\x1a1\r")) == 80 + 16 * 64 + 16 * 80
    assert told(tracker, b"F\r") == b"LY\0F\0\0\x04\0\x01\0\0\0"


SETTINGS = (
    b"A1,0,0,0,0,1,0,-1,0,0|B2,0,0,0|D1|F0|G0,0,10|H*,0,0,-1|L3,1|N*,0.1,0,0|O*,8,9,7|Q0|Q1|Q2|R3|R4|U1"
    b"|X0,1,0,0|Y.1,.2,.3,.4|Z1|\x02*|\x051|\x050|\x0b1|\x0f576,1|\x123|\x140|\x153,0|\x150,ffff|\x172"
    b"|\x18my probe|@B0"
).split(b"|")


@pytest.mark.parametrize("command", SETTINGS)
@pytest.mark.parametrize("mode", [b"F0\r", b"F1\r"])
def test_setting_is_never_answered(mode: bytes, command: bytes) -> None:
    tracker = device()
    told(tracker, mode)
    reply = told(tracker, command + b"\r\n")
    assert reply.replace(b"\x050\r", b"").replace(b"\n", b"") == b""


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (b"", 1), (b"K1", 1), (b"\x1c", 1), (b"H0,1,0,0", 2), (b"H17,1,0,0", 2), (b"Hx", 2), (b"U2", 7),
        (b"U-1", 3), (b"R2", 6), (b"H1,a,0,0", 3), (b"H1,0,0,1,5", 5), (b"Q", 4), (b"Q3", 7), (b"C1", 5),
        (b"O1,13", 7), (b"O1," + b"2," * 20 + b"2", 5), (b"X1,1,0,0", 3), (b"\x0f999", 3), (b"\x0b4", 7),
        (b"\x150,xyz", 3), (b"A1,0,0,0,1,0,0,1,0,0", 3), (b"N1,1e999,0,0", 7),
    ],
)  # fmt: skip
def test_refusals_name_their_code(command: bytes, code: int) -> None:
    """In ASCII a line without header, in binary a header with the error code and the text."""
    tracker = device()
    text = told(tracker, command + b"\r")
    assert text.endswith(b"\r\n")
    assert not text[:2].isdigit()
    told(tracker, b"F1\r")
    reply = told(tracker, command + b"\r")
    assert (reply[:3], reply[4], body(reply)) == (b"LY\0", code, text)


def test_line_ends_and_blanks() -> None:
    """CR ends a command, LF is nothing, a lone CR is an invalid command, blanks are tolerated."""
    tracker = device()
    assert told(tracker, b"\r") == INVALID
    assert told(tracker, b"\n") == b""
    assert told(tracker, b"u1\r\n", b"U\r\n") == b"00U  1\r\n"
    assert told(tracker, b"X .2,.3\r", b"X\r") == b"00X   0.200  0.300  0.800  0.950 \r\n"
    assert told(tracker, b"H ", b"4 , 0,", b"0,1\r", b"h4\r") == b"04H    0.000  0.000  1.000\r\n"
    assert told(tracker, b"Z" * 300).startswith(b"Too Many Command Characters")


def test_arguments_left_out_keep_their_value() -> None:
    tracker = device()
    told(tracker, b"H5,.1,.2,.3\r", b"H5,,.5\r", b"H6,,,\r")
    assert told(tracker, b"H5\r") == b"05H    0.100  0.500  0.300\r\n"
    assert told(tracker, b"H6\r") == b"06H    1.000  0.000  0.000\r\n"
    told(tracker, b"\x0f576\r", b"\x0f,2\r")
    assert told(tracker, b"\x0f\r") == b"00o   57600 E\r\n"


def test_output_list_limits() -> None:
    tracker = device()
    twenty = b"O1," + b",".join([b"7"] * 20) + b"\r"
    assert told(tracker, twenty) == b""
    assert told(tracker, b"O2," + b",".join([b"6"] * 12) + b"\r") != b"", (
        "in ASCII it has more than 1000 bytes"
    )
    told(tracker, b"F1\r")
    assert struct.unpack("<20i", body(told(tracker, b"O1\r"))) == (7,) * 20
    assert told(tracker, b"O2," + b",".join([b"6"] * 20) + b"\r") == b""


@given(items=st.lists(st.integers(2, 12), min_size=1, max_size=20), start=st.integers(0, 2**32 - 1))
def test_binary_records_are_what_struct_packs(items: Sequence[int], start: int) -> None:
    """Any list: the values come one after the other, little-endian, behind the header."""
    tracker = device(frozenset({3, 11}), start_frame=start)
    told(tracker, b"F1\rU1\r", b"O*," + ",".join(map(str, items)).encode() + b"\r", b"C\r")
    tracker.next_cycle()
    cycle = tracker.next_cycle()
    position, quaternion = BuiltInMotion().poses(np.array([1]), [3, 11])
    expected = b""
    for place, station in enumerate((3, 11)):
        w, x, y, z = quaternion[0, place]
        cosines = [
            1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
        ]  # fmt: skip
        euler = np.degrees(
            [np.arctan2(cosines[3], cosines[0]), np.arcsin(-cosines[6]), np.arctan2(cosines[7], cosines[8])]
        )
        frame = (start + 1) % 2**32
        values = {
            2: struct.pack("<3f", *position[0, place] / 10),
            4: struct.pack("<3f", *euler),
            6: struct.pack("<9f", *cosines),
            7: struct.pack("<4f", w, x, y, z),
            8: struct.pack("<I", (start + 1) * 1000 // 240 % 2**32),
            9: struct.pack("<I", frame),
            10: struct.pack("<i", 0),
            11: struct.pack("<i", 0),
            12: struct.pack("<i", 0),
        }
        values |= {3: values[2], 5: values[4]}
        packed = b"".join(values[item] for item in items)
        expected += struct.pack("<2sBBBBh", b"LY", station, ord("C"), 0, 0, len(packed)) + packed
    assert cycle.data == expected


def test_ascii_record_has_the_widths_of_the_manual() -> None:
    tracker = device(frozenset({2}))
    assert len(told(tracker, b"P")) == 60
    widths = {2: 27, 3: 45, 4: 27, 5: 45, 6: 87, 7: 36, 0: 1, 1: 2, 10: 1, 11: 1, 12: 1}
    for item, width in widths.items():
        told(tracker, b"O2,%d\r" % item)
        record = told(tracker, b"P")
        assert len(record) == 4 + width
        assert record.startswith(b"02  ")
    told(tracker, b"O2,3\r")
    assert [float(word) for word in told(tracker, b"P")[4:].split()] == pytest.approx(
        BuiltInMotion().poses(np.array([0]), [2])[0][0, 0] / 25.4, rel=1e-6
    )
    assert b"E+00" in told(tracker, b"P")


def test_p_acts_at_once_only_as_the_first_byte() -> None:
    tracker = device(frozenset({1}))
    told(tracker, b"C\r")
    assert tracker.next_cycle().data
    assert told(tracker, b"p").startswith(b"01  ")
    assert tracker.next_cycle().data == b""
    assert told(tracker, b"\x18pp\r") == b""
    assert b"pp" in told(tracker, b"\x18\r")


def test_all_stations_of_a_cycle_share_their_counters() -> None:
    """In ascending order; the timestamp is the frame count in ms, cut off; Q resets either or both."""
    tracker = device(frozenset({9, 2, 16}))
    told(tracker, b"F1\rO*,8,9\rC\r")
    cycles(tracker, 100)
    got = [struct.unpack_from("<2x2B4x2I", record) for record in records(cycles(tracker, 4), 16)]
    assert got == [(s, ord("C"), f * 1000 // 240, f) for f in range(100, 104) for s in (2, 9, 16)]
    for command, expected in ((b"Q1\r", (104 * 1000 // 240, 0)), (b"Q2\r", (0, 1)), (b"Q0\r", (0, 0))):
        told(tracker, command)
        assert struct.unpack_from("<8x2I", cycles(tracker, 1)) == expected


def test_counters_wrap_at_32_bits() -> None:
    tracker = device(frozenset({1}), start_frame=2**32 - 2)
    told(tracker, b"F1\rO1,9,8\rC\r")
    got = [struct.unpack_from("<8x2I", record) for record in records(cycles(tracker, 4), 16)]
    assert [frame for frame, _ in got] == [2**32 - 2, 2**32 - 1, 0, 1]
    assert [ms for _, ms in got] == [(2**32 - 2 + i) * 1000 // 240 % 2**32 for i in range(4)]


def test_rate_changes_the_timestamps_from_then_on() -> None:
    tracker = device(frozenset({1}))
    told(tracker, b"F1\rO1,8\rC\r")
    cycles(tracker, 24)
    told(tracker, b"R3\r")
    assert tracker.rate == 120
    got = [struct.unpack_from("<8xI", record)[0] for record in records(cycles(tracker, 3), 12)]
    assert got == [100, 108, 116]


def test_units_convert_outputs_and_inputs() -> None:
    tracker = device(frozenset({1}))
    told(tracker, b"N1,1,0,0\rF1\rO1,2\rX0,1,0,0\r")
    inches = np.array(struct.unpack_from("<3f", told(tracker, b"P"), 8))
    told(tracker, b"U1\r")
    centimetres = np.array(struct.unpack_from("<3f", told(tracker, b"P"), 8))
    assert centimetres == pytest.approx(inches * 2.54, rel=1e-6)
    assert struct.unpack("<3f", body(told(tracker, b"N1\r"))) == pytest.approx((2.54, 0, 0))
    told(tracker, b"N1,2,0,0\r", b"U0\r")
    assert struct.unpack("<3f", body(told(tracker, b"N1\r"))) == pytest.approx((2 / 2.54, 0, 0))


def test_station_state_in_both_forms() -> None:
    tracker = device(frozenset({1, 2, 5}))
    told(tracker, b"F1\r\x152,0\r")
    assert body(told(tracker, b"\x150\r")) == struct.pack("<HH", 0b10001, 0b10011), (
        "active first, then detected"
    )
    assert {record[2] for record in records(told(tracker, b"P"), 34)} == {1, 5}
    told(tracker, b"\x150,12\r")
    assert body(told(tracker, b"\x150\r")) == struct.pack("<HH", 0b10010, 0b10011)
    told(tracker, b"\x15*,1\rF0\r")
    assert told(tracker, b"\x150\r") == b"00u  00130013\r\n"
    assert told(tracker, b"\x155\r") == b"05u  1100100000000000\r\n"


def test_unplugging_and_plugging_change_the_active_set() -> None:
    """A plug that is pulled ends the records at once, one that is put in is found after a second."""
    faults = (parse_fault("plug", "3@1"), parse_fault("unplug", "2@240f"), parse_fault("plug", "2@2"))
    tracker = device(frozenset({1, 2, 3}), sensor_faults=faults)
    told(tracker, b"F1\rO*,9\rC\r")
    got: dict[int, list[int]] = {1: [], 2: [], 3: []}
    for record in records(cycles(tracker, 960), 12):
        got[record[2]].append(struct.unpack_from("<I", record, 8)[0])
    assert got[1] == list(range(960))
    assert got[2] == [*range(240), *range(720, 960)]
    assert got[3] == list(range(480, 960))


def test_error_letters_and_flags() -> None:
    """A failing source in lower case, in capitals with BIT errors, I with those alone until cleared."""
    tracker = device(
        frozenset({1, 12}),
        sensor_faults=(
            parse_fault("source-fail", "e@10f-20f"),
            parse_fault("distortion", "12=2@5f-6f"),
            parse_fault("sync", "7f"),
            parse_fault("stylus", "1@8f-9f"),
        ),
        bit_errors=(parse_fault("bit-errors", "12@15f"),),
    )
    told(tracker, b"F1\rO*,9,10,11,12\rZ1\rC\r")
    rows = [
        (record[4], record[2], *struct.unpack_from("<I3i", record, 8))
        for record in records(cycles(tracker, 24), 24)
    ]
    letters = {frame: chr(error) for error, station, frame, *_ in rows if station == 1 and error}
    expected = dict.fromkeys(range(10, 15), "e") | dict.fromkeys(range(15, 20), "E")
    assert letters == expected | dict.fromkeys(range(20, 24), "I")
    assert [(f, s) for _, s, f, button, _, _ in rows if button] == [(8, 1)]
    assert [(f, s) for _, s, f, _, level, _ in rows if level == 2] == [(5, 12)]
    assert [(f, s) for _, s, f, _, _, sync in rows if sync] == [(7, 1), (7, 12)]
    words = struct.unpack("<18I", body(told(tracker, b"\x14\r")))
    assert (words[0], words[9], words[13]) == (1 << 31, 1, 1)
    told(tracker, b"\x140\r")
    assert not any(body(told(tracker, b"\x14\r")))
    assert records(cycles(tracker, 1), 24)[0][4] == 0


def test_stylus_toggles_the_stream_in_point_and_track_mode_alone() -> None:
    presses = (parse_fault("stylus", "1@10f-12f"), parse_fault("stylus", "1@30f"))
    for mode, silent in ((b"0", 0), (b"1", 20)):
        tracker = device(frozenset({1}), sensor_faults=presses)
        told(tracker, b"F1\rO1,9\rL1," + mode + b"\rC\r")
        assert len(cycles(tracker, 60)) == 12 * (60 - silent)


def flat(x_mm: np.ndarray) -> RecordedMotion:
    """One receiver that moves along X."""
    position = np.stack([x_mm, np.full_like(x_mm, 300.0), np.full_like(x_mm, 20.0)], -1)[:, None]
    return RecordedMotion((1,), position, np.tile([1.0, 0, 0, 0], (len(x_mm), 1, 1)))


def measured_cm(tracker: Liberty, count: int) -> np.ndarray:
    told(tracker, b"F1\rU1\rO1,2,7\rC\r")
    return np.array([struct.unpack_from("<7f", r, 8) for r in records(cycles(tracker, count), 36)])


def test_a_receiver_that_leaves_the_hemisphere_is_reported_opposite() -> None:
    """Without filter at once; with it over 5 to 8 frames through the origin; orientation goes on."""
    motion = flat(np.linspace(100, -100, 200))
    sharp = Liberty(World(motion, frozenset({1})))
    told(sharp, b"X0,1,0,0\r")
    seen = measured_cm(sharp, 200)
    true = motion.position_mm[:, 0] / 10
    assert seen[:100, :3] == pytest.approx(true[:100], abs=1e-5)
    assert seen[100:, :3] == pytest.approx(-true[100:], abs=1e-5)
    assert seen[:, 0].min() >= 0
    smooth = measured_cm(Liberty(World(motion, frozenset({1}))), 200)
    between = np.abs(np.abs(smooth[:, 1]) - 30) > 0.5
    assert 5 <= between.sum() <= 8
    assert np.abs(smooth[between, 1]).min() < 10
    assert (smooth[:, 3:] == [1, 0, 0, 0]).all()
    assert smooth[130:, :3] == pytest.approx(-true[130:], abs=1e-5)


def test_no_flip_while_the_hemisphere_follows_the_receiver() -> None:
    motion = flat(np.linspace(100, -100, 200))
    tracker = Liberty(World(motion, frozenset({1})))
    told(tracker, b"H*,0,0,0\r")
    assert measured_cm(tracker, 200)[:, :3] == pytest.approx(motion.position_mm[:, 0] / 10, abs=1e-5)


def test_the_filter_goes_on_over_a_command() -> None:
    """A command in the midst of a flip does not start the filter anew."""
    motion = flat(np.linspace(100, -100, 200))
    plain = measured_cm(Liberty(World(motion, frozenset({1}))), 110)
    tracker = Liberty(World(motion, frozenset({1})))
    first = measured_cm(tracker, 102)
    told(tracker, b"Y0,1,0,0\r")
    rest = np.array([struct.unpack_from("<7f", r, 8) for r in records(cycles(tracker, 8), 36)])
    assert (np.concatenate([first, rest]) == plain).all()


def test_alignment_adds_up_and_is_reset() -> None:
    """Two quarter turns about Z are a half turn; positions and orientations are in the new frame."""
    tracker = device(frozenset({1}))
    told(tracker, b"F1\rU1\rO1,2,7\rX0,1,0,0\r")
    plain = struct.unpack_from("<7f", told(tracker, b"P"), 8)
    quarter = b"A1,0,0,0,0,1,0,-1,0,0\r"
    told(tracker, quarter, quarter)
    turned = struct.unpack_from("<7f", told(tracker, b"P"), 8)
    assert turned[:3] == pytest.approx((-plain[0], -plain[1], plain[2]), abs=1e-4)
    w, x, y, z = plain[3:]
    assert abs(np.dot(turned[3:], (z, y, -x, -w))) == pytest.approx(1, abs=1e-6)
    assert struct.unpack("<9f", body(told(tracker, b"A1\r"))) == pytest.approx(
        (0, 0, 0, -1, 0, 0, 0, -1, 0), abs=1e-6
    )
    told(tracker, b"A1,1,0,0,2,0,0,1,1,0\r")
    moved = struct.unpack_from("<7f", told(tracker, b"P"), 8)
    assert moved[:3] == pytest.approx((-plain[0] - 1, -plain[1], plain[2]), abs=1e-4)
    told(tracker, b"\x121\r")
    assert struct.unpack_from("<7f", told(tracker, b"P"), 8) == plain


def test_boresight_reports_the_angles_that_it_was_given() -> None:
    tracker = device(frozenset({4}))
    told(tracker, b"F1\rO4,4\r")
    plain = struct.unpack_from("<3f", told(tracker, b"P"), 8)
    told(tracker, b"B4,10,20,30\r")
    assert struct.unpack_from("<3f", told(tracker, b"P"), 8) == pytest.approx((10, 20, 30), abs=1e-4)
    assert struct.unpack("<3f", body(told(tracker, b"B4\r"))) == (10, 20, 30)
    told(tracker, b"\x02*\r")
    assert struct.unpack_from("<3f", told(tracker, b"P"), 8) == plain


def test_tip_and_mounting_move_what_is_reported() -> None:
    motion = RecordedMotion((1,), np.array([[[100.0, 0, 0]]]), np.array([[[0.5**0.5, 0, 0, 0.5**0.5]]]), True)
    tracker = Liberty(World(motion, frozenset({1})))
    told(tracker, b"F1\rU1\rO1,2\rN1,5,0,0\r")
    assert struct.unpack_from("<3f", told(tracker, b"P"), 8) == pytest.approx((10, 5, 0), abs=1e-5)
    told(tracker, b"N1,0,0,0\rG90,0,0\r")
    assert struct.unpack_from("<3f", told(tracker, b"P"), 8) == pytest.approx((0, 10, 0), abs=1e-5)


def test_saved_settings_come_back_after_a_restart() -> None:
    """^K keeps, ^W chooses, ^Y starts again: deaf for a while, then it says that it is ready."""
    tracker = device(restart_s=0.5, start_frame=700)
    told(tracker, b"U1\r\x18mine\r\x0b2\r\x172\rU0\rC\r")
    tracker.next_cycle()
    told(tracker, b"\x19\r")
    assert told(tracker, b"U\r") == b""
    assert cycles(tracker, 121) == b"LIBERTY Ready!\r\n"
    assert told(tracker, b"U\r") == b"00U  1\r\n"
    assert cycles(tracker, 3) == b""
    told(tracker, b"O1,9\rF1\r")
    assert struct.unpack_from("<8xI", told(tracker, b"P")) == (704,), "counted since power-up"
    told(tracker, b"\x170\r\x19\r")
    cycles(tracker, 200)
    assert told(tracker, b"U\r") == b"00U  0\r\n"


def test_echo_gives_back_what_was_typed() -> None:
    tracker = device()
    assert told(tracker, b"\x051\r", b"U1\r") == b"U1\r"
    assert told(tracker, b"U\r") == b"U\r00U  1\r\n"


def test_patriot_has_two_stations_at_60_hz_and_its_own_tag() -> None:
    tracker = Liberty(World(BuiltInMotion(), frozenset({1, 2})), family="patriot", ports=2)
    told(tracker, b"F1\rO*,8,9\rR4\rC\r")
    assert tracker.rate == 60
    cycles(tracker, 60)
    got = records(cycles(tracker, 1), 16)
    assert [record[:3] for record in got] == [b"PA\x01", b"PA\x02"]
    assert struct.unpack_from("<2I", got[0], 8) == (1000, 60)
    assert told(tracker, b"H3\r")[4] == 2


def test_a_gap_in_a_recording_is_a_partial_cycle() -> None:
    position = np.full((3, 2, 3), 100.0)
    position[1, 0] = np.nan
    motion = RecordedMotion((4, 6), position, np.tile([1.0, 0, 0, 0], (3, 2, 1)))
    tracker = Liberty(World(motion, frozenset({4, 6})))
    told(tracker, b"F1\rO*,9\rC\r")
    got = [(record[2], struct.unpack_from("<I", record, 8)[0]) for record in records(cycles(tracker, 5), 12)]
    assert got == [(4, 0), (6, 0), (6, 1), (4, 2), (6, 2)]
    assert told(tracker, b"P") == b"", "after its end a recording has no pose"


@pytest.mark.parametrize(
    ("mode", "items"),
    [
        ("binary", FULL_LIST),
        ("binary", (2, 4, 1)),
        ("ascii", (9, 0, 8, 0, 2, 7, 0, 10, 11, 12, 1)),
        ("ascii", (3, 6)),
    ],
)
def test_decoders_read_what_is_sent(mode: str, items: tuple[int, ...]) -> None:
    """Every record is found, with positions as fine as the format prints them."""
    tracker = device()
    chosen = ",".join(map(str, items)).encode()
    told(tracker, b"F%d\rU1\rO*,%s\rC\r" % (mode == "binary", chosen))
    stations = tuple(range(1, 17))
    settings = StreamSettings("liberty", mode, "cm", 240.0, stations, dict.fromkeys(stations, items))
    got = decoder_of(settings).feed(cycles(tracker, 200), final=True)
    assert not got.skipped
    assert len(got.records) == 16 * 200
    position, _ = BuiltInMotion().poses(np.arange(200), stations)
    coarse_mm = 0.0051 if mode == "ascii" else 1e-4
    assert np.abs(got.records.position_mm - position.reshape(-1, 3)).max() < coarse_mm
    if 9 in items:
        assert (got.records.frame == np.repeat(np.arange(200), 16)).all()
