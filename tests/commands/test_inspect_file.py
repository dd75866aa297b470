"""`shukotsu inspect`: descriptions of each kind of file, and drafted mappings that can be imported."""

import itertools
import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
import recording_files
import yaml
from recording_files import ARM, of, write_c3d
from scipy.spatial.transform import Rotation

from shukotsu.__main__ import main
from shukotsu.errors import InputError
from shukotsu.hand.rotations import about_axis, matrix, multiply, unit
from shukotsu.readers.samples import Samples
from shukotsu.study.file_formats import FORMATS
from shukotsu.study.mapping import read_mapping

REPOSITORY = Path(__file__).resolve().parents[2]
WHO = ["--layout", "arm", "--subject", "01", "--hand", "right", "--task", "rom"]
RNG = np.random.default_rng(12)
FRAMES = 40
TURNED = unit(np.array([1.0, 0.2, -0.1, 0.3]) + RNG.normal(scale=0.05, size=(FRAMES, 4)))
PLACE = RNG.normal(scale=0.2, size=(FRAMES, 3))

GUIDE_FILE = """# lab export
Time;H_x;H_y;H_z;H_az;H_el;H_ro;F_x;F_y;F_z;F_az;F_el;F_ro
0;10,1;2,2;3,1;10;20;30;11,1;3,2;4,1;20;21;31
4,2;10,2;2,3;3,2;11;20;30;11,2;3,3;4,2;20;22;31
8,3;10,4;2,4;3,3;12;20;30;11,4;3,4;4,3;20;24;31
"""


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> "Run":
    return Run(tmp_path, capsys)


class Run:
    """Runs the command on files in a separate folder."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self._capsys = folder, capsys
        self.mapping = folder / "mapping.yaml"

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a file."""
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def table(self, name: str, titles: str, rows: Iterable[Iterable[float]], mark: str = ",") -> Path:
        """Write a table, without a header if titles is empty."""
        lines = [mark.join(f"{value:.6f}" for value in row) for row in rows]
        return self.write(name, "\n".join([titles.replace(",", mark), *lines] if titles else lines) + "\n")

    def inspect(self, path: Path, *words: str, code: int = 0) -> str:
        """Return the command's output, from stderr if it must fail."""
        assert main(["inspect", str(path), "--layout", "arm", *words]) == code
        out = self._capsys.readouterr()
        return out.err if code else out.out

    def drafted(self, path: Path) -> str:
        """Draft a mapping and return the command's output."""
        return self.inspect(path, "--write-mapping", str(self.mapping))

    def imported(self, path: Path, answers: dict[str, str]) -> Samples:
        """Read the file by its draft, with the first CHECK of each key replaced by its answer.

        Receivers are named by their CHECK names.
        """
        with pytest.raises(InputError, match=r"still says? CHECK: put the truth there"):
            read_mapping(self.mapping)
        text = self.mapping.read_text("utf-8")
        for key, value in answers.items():
            name = key.startswith("CHECK")
            pattern = rf"(?m)^(\s*){key}:( CHECK)?( *#.*)?" if name else rf"(?m)^(\s*{key}:) CHECK.*$"
            text, count = re.subn(pattern, rf"\g<1>{value}:" if name else rf"\g<1> {value}", text, count=1)
            assert count == 1, (key, text)
        self.mapping.write_text(text, "utf-8")
        return recording_files.read(path, ARM, yaml.safe_load(text))


def test_a_file_of_both_hands_is_drafted_by_stations(run: Run) -> None:
    """The output has one line per kind of column; the mapping has one word to edit and serves both hands."""
    names = [f"S{n}_{part}" for n in range(32, 0, -1) for part in ("X", "Y", "Z", "Az", "El", "Ro")]
    place = 0.9 * np.arange(32)[::-1] + PLACE[:, :1]
    cells = np.stack([place, 0 * place, 0 * place, 100 + 30 * np.sin(place), 0 * place, 0 * place], -1)
    rows = np.concatenate([4.2 * np.arange(FRAMES)[:, None], cells.reshape(FRAMES, -1)], 1)
    path = run.table("both.csv", ",".join(["Time", *names]), rows, ";")
    out = run.inspect(path, "--layout", "liberty16", "--write-mapping", str(run.mapping))
    assert len(out.splitlines()) == 6
    assert out.endswith("--out poses.parquet; and so with --hand left\n")
    text = run.mapping.read_text("utf-8")
    assert re.findall(r"(?m)^ *(\S+): CHECK", text) == ["position_unit"]
    assert "neighbouring receivers are 0.9 apart, which on one hand means inch" in text
    run.mapping.write_text(text.replace("position_unit: CHECK", "position_unit: inch"), "utf-8")
    right, left = read_mapping(run.mapping), read_mapping(run.mapping, "left")
    assert right.details["time_unit"] == "ms"
    columns = {hand: each.receivers["little_distal"]["position"][0] for hand, each in ((1, right), (2, left))}
    assert columns == {1: "S16_X", 2: "S32_X"}
    assert [*right.receivers][:2] == [*left.receivers][:2] == ["hand", "thumb_metacarpal"]
    run.mapping.write_text(run.mapping.read_text("utf-8").replace('"S32_X", ', ""), "utf-8")
    with pytest.raises(InputError, match=r"little_distal\.position"):
        read_mapping(run.mapping)  # also for the right hand, as it is one file


FORWARD = {"rotates": "receiver-to-transmitter"}


@pytest.mark.parametrize("empty_line", ["\n", ",,,\r\n"])
def test_a_draft_of_a_file_with_two_tables_names_one(run: Run, empty_line: str) -> None:
    """Names over three lines, rotation vectors, and another table behind them, as Vicon Nexus exports it."""
    turned = Rotation.from_quat(TURNED, scalar_first=True).as_rotvec(degrees=True)
    place_mm = 300 * PLACE
    cells = np.concatenate([turned, place_mm, turned[::-1], place_mm[::-1]], 1)
    rows = [f"{n},0," + ",".join(map(str, row)) + "\n" for n, row in enumerate(cells)]
    names = ["Segments\n30\n,,S:forearm,,,,,,S:hand\nFrame,Sub Frame", *["RX,RY,RZ,TX,TY,TZ"] * 2]
    text = ",".join(names) + "\n,,deg,deg,deg,mm,mm,mm,deg,deg,deg,mm,mm,mm\n" + "".join(rows)
    path = run.write("v.csv", text + empty_line + "Trajectories\n30\nFrame,Sub Frame,X,Y,Z\n0,0,1,2,3\n")
    out = run.drafted(path)
    assert "table 2 of 2, under 'Trajectories':" in out
    assert "the mapping is for table 1; csv.table in it states which" in out
    run.mapping.write_text(re.sub("(?m)^ *axes: .*$", "", run.mapping.read_text("utf-8")), "utf-8")
    samples = run.imported(path, {"rate_hz": "30", "kind": "rotation-vector", **FORWARD})
    for segment, order in (("forearm", 1), ("hand", -1)):
        numbers = samples.numbers[of(samples, segment)]
        np.testing.assert_allclose(numbers, np.concatenate([place_mm, TURNED], 1)[::order], atol=1e-9)
    mapping = yaml.safe_load(run.mapping.read_text("utf-8"))
    mapping["csv"]["table"] = 3
    recording_files.refuse(path, "v.csv: has 2 tables; csv.table is 3", ARM, mapping)


def test_the_guides_page_shows_the_printed_output(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(run.folder)
    run.write("session3.csv", GUIDE_FILE)
    page = (REPOSITORY / "docs" / "mappings.md").read_text("utf-8")
    out = run.inspect(Path("session3.csv"), "--layout", "liberty16", "--write-mapping", "mapping.yaml")
    assert f"```text\n{out}```" in page
    mapping = yaml.safe_load(re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)[0])
    samples = recording_files.read(Path("session3.csv"), ARM, mapping)
    hand = of(samples, "hand")
    np.testing.assert_allclose(samples.numbers[hand, 0], np.array([10.1, 10.2, 10.4]) * 25.4)


def test_a_wide_table_of_quaternions_is_described_and_drafted(run: Run) -> None:
    cells = np.concatenate([np.arange(FRAMES)[:, None] / 120, PLACE, TURNED], 1)
    path = run.table("old.txt", "t,px,py,pz,w,i,j,k", cells, "\t")
    out = run.inspect(path)
    assert "cells separated by tabs, decimal point, a header" in out
    assert "in s 120 Hz" in out
    assert "quaternion w i j k: median norm 1.00000" in out
    assert "so wxyz is likelier" in out
    assert re.search(r"position px py pz: span .* in mm nothing, .* in m a desk", out)
    assert f"\nnext: shukotsu inspect {path} --write-mapping" in out
    sixteen = np.concatenate([TURNED, PLACE, np.roll(TURNED, 1, 0), PLACE, np.ones((FRAMES, 2))], 1)
    assert "a table as text: 40 rows, 16 columns" in run.inspect(run.table("a.txt", "", sixteen, " "))
    absent = run.folder / "absent" / "mapping.yaml"
    run.inspect(path, "--write-mapping", str(absent), code=2)
    assert not absent.parent.exists()
    run.drafted(path)
    answers = {"position_unit": "m", "order": "wxyz", **FORWARD, "time_unit": "s", "CHECK_1": "hand"}
    samples = run.imported(path, answers)
    np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-3)
    np.testing.assert_allclose(samples.numbers[:, 3:], TURNED, atol=1e-6)
    np.testing.assert_allclose(samples.time_s, np.arange(FRAMES) / 120, atol=1e-6)


@pytest.mark.parametrize("dates", [False, True])
def test_seconds_with_nanoseconds_or_dates_are_drafted_as_the_time(run: Run, dates: bool) -> None:
    stamps = [f"stamp {1_700_000_000 + t // 30} {t % 30 * 33_333_333}" for t in range(FRAMES)]
    titles = ["header.stamp.sec", "header.stamp.nanosec", "child_frame_id", "x", "y", "z"]
    titles += ["qw", "qx", "qy", "qz"]
    if dates:
        titles[:2] = ["stamp"]
        stamps = [f"stamp 2023-11-14T22:13:{20 + t / 30:09.6f}Z" for t in range(FRAMES)]
    cells = np.concatenate([PLACE, TURNED], 1)
    rows = [
        ",".join([*stamp.split()[1:], name, *map(str, row)])
        for stamp, row in zip(stamps, cells, strict=True)
        for name in ("forearm", "hand")
    ]
    path = run.write("tf.csv", "\n".join([",".join(titles), *rows, ""]))
    assert ("in s, as its title says, 30 Hz" in run.drafted(path)) != dates
    samples = run.imported(path, {"position_unit": "m", **FORWARD})
    hand = of(samples, "hand")
    np.testing.assert_array_equal(samples.frame[hand], np.arange(FRAMES))
    np.testing.assert_allclose(samples.time_s[hand] - 1.7e9, np.arange(FRAMES) / 30, atol=2e-6)


def test_many_receivers_have_one_line_and_a_glove_is_refused(run: Run) -> None:
    glove = run.table("glove.csv", "t,Thumb_MCP_Flex,Index_MCP_Flex,Index_MCP_Spread", TURNED)
    assert "has joint angles (Thumb_MCP_Flex, " in run.inspect(glove, code=2)
    titles = [f"s{n}_{axis}" for n in range(17) for axis in ("x", "y", "z", "qw", "qx", "qy", "qz")]
    many = run.table("many.csv", ",".join(titles), np.tile(np.concatenate([PLACE, TURNED], 1), 17))
    assert run.inspect(many).count("\nposition") == 1


def test_a_trackers_text_output_is_drafted_by_station(run: Run) -> None:
    """A lost row and an incomplete last cycle do not shift the frames of the other rows."""
    rows = [
        f"0{station} {frame + 0.5:8.4f} {station + 0.25:8.4f} 3.2500 {3 * frame:9.4f} {station:8.4f} 0.0000\n"
        for frame in range(30)
        for station in (1, 2)
        if (frame, station) not in ((7, 2), (29, 2))
    ]
    path = run.write("tracker.txt", "".join(rows))
    out = run.drafted(path)
    assert "receiver column number 1: one row a receiver and frame; it has 01, 02" in out
    draft = yaml.safe_load(run.mapping.read_text("utf-8"))
    assert draft["csv"] | {"receiver": 1, "position": [2, 3, 4], "orientation": [5, 6, 7]} == draft["csv"]
    assert (draft["position_unit"], draft["csv"]["rows"]) == ("CHECK", "long")
    assert draft["orientation"] == {"kind": "euler", "axes": "CHECK", "unit": "deg", "rotates": "CHECK"}
    answers = {"position_unit": "inch", "rate_hz": "240", "axes": "ZYX", **FORWARD}
    samples = run.imported(path, answers | {"CHECK_1": "hand", "CHECK_2": "forearm"})
    hand = of(samples, "hand")
    assert samples.frame[hand].tolist() == [*range(30)]
    assert samples.frame[~hand].tolist() == [*range(7), *range(8, 29)]
    np.testing.assert_allclose(samples.numbers[hand, 0], (np.arange(30) + 0.5) * 25.4)


@pytest.mark.parametrize("titles", ["frame,sensor,,,,,,", "frame,sensor,x,y,z,,,"])
def test_the_order_of_angles_in_a_long_table_is_left_open(run: Run, titles: str) -> None:
    turned = Rotation.from_quat(TURNED, scalar_first=True).as_euler("XYZ", degrees=True)
    rows = np.repeat(np.column_stack([np.arange(FRAMES), np.ones(FRAMES), 300 * PLACE, turned]), 2, axis=0)
    rows[1::2, 1] = 2
    path = run.write("long.csv", "".join(",".join(f"{v:.9g}" for v in row) + "\n" for row in rows))
    path.write_text(f"{titles}\n{path.read_text()}")
    run.drafted(path)
    answers = {"position_unit": "mm", "rate_hz": "60", "axes": "XYZ", **FORWARD}
    samples = run.imported(path, answers | {"CHECK_1": "hand", "CHECK_2": "forearm"})
    numbers = samples.numbers[of(samples, "hand")]
    np.testing.assert_allclose(numbers, np.concatenate([300 * PLACE, TURNED], 1), atol=1e-6)


@pytest.mark.parametrize(
    ("names", "units"), [("R,,,,,,,,", 8 * ","), (8 * ",", 8 * ","), ("a,b,c,d,e,f,g,h,i", "1" + 8 * ",1")]
)
def test_matrices_below_two_lines_of_titles_and_units_are_drafted(run: Run, names: str, units: str) -> None:
    turned, commas = matrix(TURNED).reshape(-1, 9), 11 * ","
    numbers = np.column_stack([np.arange(FRAMES) / 60, 300 * PLACE, turned, 200 * PLACE, turned[::-1]])
    path = run.table("matrices.csv", "", numbers)
    head = [f",hand{commas},forearm{commas}", "Time" + 2 * f",x,y,z,{names}", "s" + 2 * f",mm,mm,mm,{units}"]
    path.write_text("\n".join([*head, path.read_text()]))
    run.drafted(path)
    samples = run.imported(path, FORWARD)
    for segment, mm, order in (("hand", 300, 1), ("forearm", 200, -1)):
        expected = np.concatenate([mm * PLACE, TURNED[::order]], 1)
        np.testing.assert_allclose(samples.numbers[of(samples, segment)], expected, atol=2e-6)


@pytest.mark.parametrize("prefix", ["", "S"])
def test_numbered_receivers_of_a_long_table_are_drafted_by_station(run: Run, prefix: str) -> None:
    """One row a receiver and frame, with a title over the receivers' numbers."""
    rows = [
        f"{frame / 240:.5f},{prefix}{station},{20 * station}.{frame % 10},1.5,2.5,0.8,0.6,0,0\n"
        for frame in range(30)
        for station in range(1, 17)
    ]
    path = run.write("long.csv", "time,sensor,x,y,z,qw,qx,qy,qz\n" + "".join(rows))
    run.inspect(path, "--layout", "liberty16", "--write-mapping", str(run.mapping))
    draft = yaml.safe_load(run.mapping.read_text("utf-8"))
    assert [*draft["receivers"].values()] == [{"value": f"{prefix}{station}"} for station in range(1, 17)]
    assert [*draft["receivers"]][::15] == ["hand", "little_distal"]
    assert (draft["csv"]["rows"], draft["csv"]["receiver"]) == ("long", "sensor")


@pytest.mark.parametrize("by_receiver", [False, True])
@pytest.mark.parametrize("names", [["手", "腕"], ["Tool A", "Tool B"], ["3", "7"]])
@pytest.mark.parametrize("titles", ["frame,Zeit,Rec", "frame,time,object", "", "# row numbers"])
def test_a_receiver_column_is_known_by_its_rows(
    run: Run, titles: str, names: list[str], by_receiver: bool
) -> None:
    """Whatever its title, its names and the order of the rows; times start anew with each receiver's rows."""
    numbers = np.concatenate([1000 * PLACE, TURNED], -1).round(6)
    cells = [
        [str(100 + frame), f"{frame / 120:.4f}", name, *map(str, numbers[frame] + [at, *[0] * 6])]
        for frame in range(FRAMES)
        for at, name in enumerate(names)
    ]
    titled = titles.startswith("frame")
    rows = sorted(cells, key=lambda row: names.index(row[2])) if by_receiver and titled else cells
    head = [titles + ",x,y,z,qw,qx,qy,qz"] if titled else []
    if titles and not titled:
        rows = [[str(number), *row] for number, row in enumerate(rows, 1)]
    path = run.write("long.csv", "\n".join([*head, *map(",".join, rows)]) + "\n")
    run.drafted(path)
    answers = {"position_unit": "mm", **FORWARD, "time_unit": "s", "CHECK_1": "hand", "CHECK_2": "forearm"}
    samples = run.imported(path, answers | ({} if titled else {"order": "wxyz"}))
    assert (samples.frame.min(), samples.frame.max()) == (100, 99 + FRAMES)
    for at, segment in enumerate(("hand", "forearm")):
        mine = of(samples, segment)
        np.testing.assert_allclose(samples.numbers[mine, 0], numbers[:, 0] + at)
        np.testing.assert_allclose(samples.time_s[mine], np.arange(FRAMES) / 120, atol=1e-4)


@pytest.mark.parametrize("titles", [["Time", "phase"], ["Frame", "Sub Frame"]])
def test_a_counter_beside_the_receivers_columns_names_no_receiver(run: Run, titles: list[str]) -> None:
    """It takes turns, too, but no rows have their frame or time in common as those of a long table have."""
    poses = [f"{name}_{part}" for name in ("hand", "forearm") for part in ("x", "y", "z", "az", "el", "ro")]
    angles = 10.0 + 100.0 * PLACE
    at = np.arange(FRAMES)
    clock = at / 240 if titles[0] == "Time" else at // 4
    numbers = np.column_stack([clock, at % 4, 1000 * PLACE, angles, 900 * PLACE, angles])
    run.drafted(run.table("wide.csv", ",".join([*titles, *poses]), numbers, ","))
    draft = yaml.safe_load(run.mapping.read_text("utf-8"))
    assert [*draft["receivers"]] == ["hand", "forearm"]
    assert draft["csv"]["rows"] == "wide"


def test_angles_about_axes_are_told_from_positions_by_a_letter(run: Run) -> None:
    """Each receiver has x, y, z and rx, ry, rz; a line of units, most of them empty, follows the titles."""
    titles = [f"{name}_{axis}" for name in ("hand", "forearm") for axis in ("x", "y", "z", "rx", "ry", "rz")]
    angles = Rotation.from_quat(TURNED, scalar_first=True).as_euler("XYZ")
    numbers = np.concatenate([1000 * PLACE, angles, 900 * PLACE, angles], -1)
    path = run.table("angles.tsv", ",".join(titles), numbers, "\t")
    path.write_text(path.read_text().replace("\n", "\nmm" + "\t" * 11 + "\n", 1))
    run.drafted(path)
    draft = yaml.safe_load(run.mapping.read_text("utf-8"))
    assert (draft["csv"]["delimiter"], draft["orientation"]["axes"]) == ("tab", "CHECK")
    position, turning = (
        [f"forearm_{axis}" for axis in axes] for axes in (["x", "y", "z"], ["rx", "ry", "rz"])
    )
    assert draft["receivers"]["forearm"] == {"position": position, "orientation": turning}


def test_quoted_numbers_and_receivers_named_by_a_letter_are_drafted(run: Run) -> None:
    """S01 after q0 is a receiver, not seconds; in quotation marks are numbers, too, and separators."""
    titles = [f"{column}_S01" for column in ("x", "y", "z", "q0", "q1", "q2", "q3")]
    rows = [["time, s", *titles], *np.column_stack([np.arange(FRAMES) / 120, 1000 * PLACE, TURNED])]
    path = run.write("quoted.csv", "".join(",".join(f'"{cell}"' for cell in row) + "\n" for row in rows))
    run.drafted(path)
    samples = run.imported(path, {"position_unit": "mm", **FORWARD, "CHECK_1": "hand"})
    np.testing.assert_allclose(samples.numbers, np.array(rows[1:])[:, 1:], atol=1e-6)


def test_rigid_clusters_of_a_c3d_file_are_drafted_for_any_labels(run: Run) -> None:
    shape = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]])
    motions = (TURNED, 1000 * PLACE), (TURNED[::-1], 300 * PLACE[::-1])
    rigid = [shape @ np.swapaxes(matrix(turn), 1, 2) + mm[:, None] for turn, mm in motions]
    loose = RNG.normal(scale=100, size=(FRAMES, 1, 3))
    points = np.concatenate([*rigid, loose], 1)[:, [0, 3, 1, 4, 6, 2, 5]]
    labels = ["RSHO", "LPSI", "CLAV", "STRN", "RUPA", "T10", "RBAK"]
    points[:10, 4] = np.nan
    out = run.drafted(write_c3d(run.folder / "a.c3d", points, labels))
    facts = ["C3D: 7 points, 40 frames numbered from 1", "rate 50 Hz", "unit mm (POINT:UNITS)"]
    assert all(fact in out for fact in (*facts, "missing: RUPA 25 %"))
    assert "#   last_frame: 40  # frames count from 1 at the first stored frame" in run.mapping.read_text()
    for names in ("RSHO, CLAV, T10", "LPSI, STRN, RBAK"):
        assert f"markers {names}: keep their distances: a rigid cluster" in out
    samples = run.imported(run.folder / "a.c3d", {"CHECK_RSHO": "upper_arm", "CHECK_LPSI": "forearm"})
    np.testing.assert_allclose(samples.numbers[of(samples, "upper_arm"), :3], rigid[0][:, 0], atol=1e-3)
    assert samples.notes[0].startswith("cluster upper_arm: 3 markers")


SEGMENTS = ("scapula", "upper_arm", "forearm", "hand")


def in_turn() -> np.ndarray:
    """Return the markers (T, 16, 3) of four plates on an arm whose joints bend briefly one after another."""
    rng, time = np.random.default_rng(4), np.linspace(0, 1, 1200)
    turn = about_axis(np.array([0.6, 0.0, 0.8]), 0.7 * np.sin(9 * time))
    place, plates = np.stack([80 * np.sin(5 * time), 60 * np.cos(7 * time), 40 * time], -1), []
    for joint in range(4):
        angle = 0.9 * np.exp(-(((time - 0.25 * joint) / 0.02) ** 2)) * (joint > 0)
        place = place + matrix(turn) @ [25.0, 0, 0]
        turn = multiply(turn, about_axis(np.array([0.0, 0.6, 0.8]), angle))
        place = place + matrix(turn) @ [25.0, 0, 0]
        plates.append(PLATE @ np.swapaxes(matrix(turn), 1, 2) + place[:, None])
    points = np.concatenate(plates, 1)
    return points + rng.normal(scale=0.2, size=points.shape)


PLATE = np.array([[0.0, 0, 0], [18, 0, 0], [4, 15, 0], [10, 8, 8]])


@pytest.mark.parametrize("spoilt", ["nothing", "occluded", "zeros", "labels exchanged"])
@pytest.mark.parametrize("named", [True, False])
def test_plates_whose_joints_move_in_turn_are_separate_clusters(run: Run, spoilt: str, named: bool) -> None:
    points = in_turn()
    if spoilt == "occluded":
        points[400:560, 2] = points[640:800, 9] = np.nan
    if spoilt == "zeros":
        points[:30, 5] = points[700:705, 0] = 0.0
    if spoilt == "labels exchanged":
        points[800:812, [3, 6]] = points[800:812, [6, 3]]
    labels = [
        f"{segment.title()}{n}" if named else f"*{4 * i + n}"
        for i, segment in enumerate(SEGMENTS)
        for n in range(4)
    ]
    path = write_c3d(run.folder / "rom.c3d", points, labels)
    said = run.drafted(path)
    drafted = yaml.safe_load(run.mapping.read_text("utf-8"))["receivers"]
    assert [part["markers"] for part in drafted.values()] == [labels[4 * i : 4 * i + 4] for i in range(4)]
    assert [*drafted] == [*SEGMENTS] if named else all(key.startswith("CHECK") for key in drafted)
    assert ("CHECK" in run.mapping.read_text("utf-8")) == ("put the truth where" in said) == (not named)


@pytest.mark.slow
def test_a_cluster_on_two_bones_is_found_and_its_cure_works(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    labels = [f"M{n}" for n in range(16)]
    path = write_c3d(run.folder / "rom.c3d", in_turn(), labels)
    markers = {segment: labels[4 * i : 4 * i + 4] for i, segment in enumerate(SEGMENTS)}

    def checked(receivers: dict[str, list[str]]) -> str:
        mapping = {"format": "c3d", "position_unit": "mm"}
        mapping |= {"receivers": {name: {"markers": part} for name, part in receivers.items()}}
        run.mapping.write_text(yaml.safe_dump(mapping), "utf-8")
        main(["check", str(path), "--hand", "right", "--layout", "arm", "--mapping", str(run.mapping)])
        return capsys.readouterr().out

    said = checked({**markers, "forearm": labels[8:16]})
    assert said.startswith("suspect: cluster-not-rigid: In ")
    groups = re.findall(r"\[(.+?)\]", said)
    assert groups == [", ".join(markers["forearm"]), ", ".join(markers["hand"])]
    assert checked({**markers, "forearm": groups[0].split(", ")}).startswith("no finding")
    assert "leave forearm out of" in checked({**markers, "forearm": labels[7:14:3]})
    del markers["forearm"]
    said = checked(markers)
    assert said.startswith("note: receivers-absent: The mapping has no receiver for forearm, which")


NAMES = {
    "pos_{}_{}": "rot_{}_{}",
    "{}.pos.{}": "{}.rot.{}",
    "S0{}_P{}": "S0{}_Q{}",
    "{1}{0}": "Q{1}{0}",
    "{}:{}": "{}:Q{}",
    "Body{}Pos{}": "Body{}Rot{}",
    "{} [{}] (mm)": "{} [q{}]",
    "t{1}_{0}": "q{1}_{0}",
}
"""Titles of position columns by receiver and axis, with those of the orientations."""


@pytest.mark.parametrize("gap", ["no position", "empty position", "empty orientation", "all empty"])
@pytest.mark.parametrize("names", NAMES)
def test_a_draft_pairs_columns_by_their_names(run: Run, names: str, gap: str) -> None:
    """Orientation columns are in reverse order; the second receiver lacks the data named by `gap`."""
    axes = ("XYZ", "WXYZ") if "Body" in names or names.startswith("{1}") else ("xyz", "wxyz")
    places, turns = (
        [[text.format(n, axis) for axis in letters] for n in (1, 2, 3)]
        for text, letters in zip((names, NAMES[names]), axes, strict=True)
    )
    positions = np.concatenate([1000 * PLACE + n for n in range(3)], 1).T
    columns = dict(zip(itertools.chain(*places), positions, strict=True))
    columns |= dict(zip(itertools.chain(*turns[::-1]), np.tile(TURNED, 3).T, strict=True))
    for title in [*places[1] * ("orientation" not in gap), *turns[1] * ("position" not in gap)]:
        columns[title] = np.full(FRAMES, np.nan)
    if gap == "no position":
        columns = {title: column for title, column in columns.items() if title not in places[1]}
    titles = "time_s," + ",".join(columns)
    rows = np.stack([np.arange(FRAMES) / 120, *columns.values()], -1)
    path = run.table("names.csv", titles, rows)
    path.write_text(path.read_text().replace("nan", ""))
    said = run.drafted(path)
    text = run.mapping.read_text("utf-8")
    drafted = [(part["position"], part["orientation"]) for part in yaml.safe_load(text)["receivers"].values()]
    kept = [n for n in range(3) if gap != "no position" or n != 1]
    assert drafted == [(places[n], turns[n]) for n in kept]
    assert "guessed" not in text
    left = f"{' '.join(turns[1])}: no position matches it" if gap == "no position" else "empty: "
    assert left in said
    assert f"# {left}" in text


def test_columns_paired_by_order_alone_are_marked_with_check(run: Run) -> None:
    rows = np.concatenate([np.arange(FRAMES)[:, None] / 120, 1000 * PLACE, TURNED, TURNED[::-1]], 1)
    titles = "time_s,hand_x,hand_y,hand_z,headset_qw,headset_qx,headset_qy,headset_qz"
    run.drafted(run.table("a.csv", titles, rows[:, :8]))
    assert yaml.safe_load(run.mapping.read_text("utf-8"))["receivers"] == {"CHECK": {}}
    run.mapping.unlink()
    run.drafted(run.table("b.csv", titles.replace("hand_", ""), rows[:, :8]))
    assert "CHECK: guessed from the place" in run.mapping.read_text("utf-8")


TIDY = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
TIDY_ROWS = "7,0.5,hand,1,2,3,1,0,0,0\n8,0.51,hand,,,,,,,\n8,0.51,elbow,1,2,3,1,0,0,0\n"


def test_a_file_with_another_ending_is_described_in_the_format_that_is_named(run: Run) -> None:
    path = run.write("rom.dat", TIDY + TIDY_ROWS.replace("elbow", "forearm"))
    assert "import refuses it: " in run.inspect(path)
    out = run.inspect(path, "--format", "csv")
    assert "import refuses it: " not in out
    command = f"import --in {path} --format csv --layout arm "
    assert f"next: shukotsu {command}" in out
    assert main([*command.split(), *WHO[2:], "--out", str(run.folder / "poses.parquet")]) == 0
    assert "not a parquet file" in run.inspect(path, "--format", "parquet", code=2)


def test_the_refusal_of_a_format_lists_all_that_can_be_described(run: Run) -> None:
    said = run.inspect(run.write("a.dat", "XDF:"), "--format", "xdf", code=2)
    assert "a.dat: inspect reads the formats csv, parquet, capture, c3d; import this one directly" in said
    listed = said.partition("formats ")[2].partition(";")[0].split(", ")
    for name in FORMATS:
        told = run.inspect(run.write("b.dat", "?"), "--format", name, code=2)
        assert ("inspect reads" in told) == (name not in listed)


def test_tidy_files_and_tables_need_no_mapping(run: Run) -> None:
    path = run.write("rom.csv", TIDY + TIDY_ROWS)
    out = run.inspect(path)
    assert "a tidy recording (CSV): needs no mapping" in out
    assert "3 rows, frames 7 to 8, 2 of them" in out
    assert "not measured in layout arm: elbow" in out
    assert "1 of 3 rows lack a number" in out
    assert "next: shukotsu import --in" in out
    assert "needs no mapping" in run.inspect(path, "--write-mapping", str(run.mapping), code=2)
    assert not run.mapping.exists()
    run.write("rom.csv", TIDY + TIDY_ROWS.replace("elbow", "forearm"))
    poses = run.folder / "poses.parquet"
    assert main(["import", "--in", str(path), *WHO, "--out", str(poses)]) == 0
    out = run.inspect(poses)
    assert "table poses (version 1)" in out
    assert "column x_mm [mm]" in out
    assert "nothing to import" in out
