"""`shukotsu inspect`: what it says of each kind of file; its drafts lead to an import."""

import re
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import recording_files
import yaml
from recording_files import ARM, of

from schemas.errors import InputError
from schemas.mapping import read_mapping
from skeleton.rotations import matrix, unit
from stages.capture.__main__ import main
from stages.capture.samples import Samples
from stages.simulate.realism import Realism
from stages.simulate.recording import write_recording
from stages.simulate.simulation import simulate

REPOSITORY = Path(__file__).resolve().parents[3]
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
    """The command run on files in a folder of its own."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self._capsys = folder, capsys
        self.mapping = folder / "mapping.yaml"

    def write(self, name: str, content: str | bytes) -> Path:
        """Write a file."""
        path = self.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def table(self, name: str, titles: str, rows: Iterable[Iterable[float]], mark: str = ",") -> Path:
        """Write a table, without a header where there are no titles."""
        lines = [mark.join(f"{value:.6f}" for value in row) for row in rows]
        return self.write(name, "\n".join([titles.replace(",", mark), *lines] if titles else lines) + "\n")

    def inspect(self, path: Path, *words: str, code: int = 0) -> str:
        """What the command prints, to stdout or on bad input to stderr."""
        assert main(["inspect", str(path), "--layout", "arm", *words]) == code
        out = self._capsys.readouterr()
        return out.err if code else out.out

    def drafted(self, path: Path) -> str:
        """What it prints when it drafts a mapping, too."""
        return self.inspect(path, "--write-mapping", str(self.mapping))

    def imported(self, path: Path, answers: dict[str, str]) -> Samples:
        """The file read by its draft with the first place of each key set right.

        Names go by their CHECK name.
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


FORWARD = {"rotates": "receiver-to-transmitter"}


def test_the_guides_page_shows_what_is_printed(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its mapping reads the file that it is shown for."""
    monkeypatch.chdir(run.folder)
    run.write("session3.csv", GUIDE_FILE)
    page = (REPOSITORY / "docs" / "mappings.md").read_text("utf-8")
    out = run.inspect(Path("session3.csv"), "--layout", "liberty16", "--write-mapping", "mapping.yaml")
    assert f"```text\n{out}```" in page
    mapping = yaml.safe_load(re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)[0])
    samples = recording_files.read(Path("session3.csv"), ARM, mapping)
    hand = of(samples, "hand")
    np.testing.assert_allclose(samples.numbers[hand, 0], np.array([10.1, 10.2, 10.4]) * 25.4)


def test_a_wide_table_of_quaternions(run: Run) -> None:
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
    run.drafted(path)
    answers = {"position_unit": "m", "order": "wxyz", **FORWARD, "time_unit": "s", "CHECK_1": "hand"}
    samples = run.imported(path, answers)
    np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-3)
    np.testing.assert_allclose(samples.numbers[:, 3:], TURNED, atol=1e-6)
    np.testing.assert_allclose(samples.time_s, np.arange(FRAMES) / 120, atol=1e-6)


def test_a_small_z_before_a_quaternion_is_not_part_of_it(run: Run) -> None:
    """Rotation about nearly one axis, positions in metres: z, w, x, y have norm 1 within a thousandth."""
    half = np.linspace(0.1, 1.2, FRAMES)
    rows = np.stack([half, half, 0.02 * half, np.cos(half), np.sin(half), 0 * half, 0 * half], 1)
    rows[:, 3:] = unit(rows[:, 3:] + RNG.normal(scale=0.005, size=(FRAMES, 4)))
    out = run.inspect(run.table("old.csv", "a,b,c,d,e,f,g", rows))
    assert "quaternion d e f g: median norm 1.00000" in out
    assert "position a b c: " in out


@pytest.mark.parametrize("time", ["Zeit", "Uhr", "t"])
def test_columns_are_grouped_by_name_whatever_the_first_is_called(run: Run, time: str) -> None:
    out = run.drafted(run.write("wide.csv", GUIDE_FILE.replace("Time", time)))
    assert f"time column {time}: median step 4.15" in out
    text = run.mapping.read_text("utf-8")
    assert list(yaml.safe_load(text)["receivers"].values()) == [
        {"position": [f"{w}_{c}" for c in "xyz"], "orientation": [f"{w}_{c}" for c in ("az", "el", "ro")]}
        for w in "HF"
    ]
    guessed = [line.split()[0] for line in text.splitlines() if "guessed" in line]
    assert guessed == ([] if time == "t" else ["time:"])


def test_a_column_between_named_ones_shifts_none(run: Run) -> None:
    counts = 7 - np.arange(FRAMES)[:, None] % 3
    rows = np.concatenate([counts, PLACE, PLACE[:, :1], 1.2 * TURNED, PLACE + 3], 1)
    run.drafted(run.table("wide.csv", "Nr,A_x_mm,A_y_mm,A_z_mm,odd,A_qw,A_qx,A_qy,A_qz,u,v,w0", rows))
    draft = run.mapping.read_text()
    whole = 'position: ["A_x_mm", "A_y_mm", "A_z_mm"], orientation: ["A_qw", "A_qx", "A_qy", "A_qz"]}'
    assert f"{whole}\n" in draft
    assert re.search(r'position: \["u", "v", "w0"\].*# CHECK: guessed from the place', draft)


POSES_OF_TWO = np.concatenate([40 * PLACE, 50 * PLACE, 40 * PLACE + 3, 50 * PLACE[:, ::-1]], 1)
"""Of two receivers: positions in cm, then angles in degrees."""


def titled_table(run: Run, titles: str, factors: tuple[float, float, float]) -> Path:
    """A table of times, from s, and POSES_OF_TWO in other units.

    titles : of the time, then of one receiver's position and angles, in which # is the receiver's number.
    """
    time, *own = titles.split(",")
    header = ",".join([time, *(title.replace("#", number) for number in "12" for title in own)])
    rows = POSES_OF_TWO * np.tile(np.repeat(factors[1:], 3), 2)
    return run.table(
        "old.csv", header, np.concatenate([factors[0] * np.arange(FRAMES)[:, None] / 125, rows], 1)
    )


STATED = [
    ("time_ms,x#_cm,y#_cm,z#_cm,rx#_deg,ry#_deg,rz#_deg", (1e3, 1, 1), ("ms", "cm", "deg")),
    ("t (us),X# (mm),Y# (mm),Z# (mm),roll# [rad],pitch# [rad],yaw# [rad]",
     (1e6, 10, np.pi / 180), ("us", "mm", "rad")),
    ("Time [s],pos_x [m] #,pos_y [m] #,pos_z [m] #,x (°) #,y (°) #,z (°) #", (1, 0.01, 1), ("s", "m", "deg")),
    ("elapsed_msec,x_inches_#,y_inches_#,z_inches_#,a_degrees_#,e_degrees_#,r_degrees_#",
     (1e3, 1 / 2.54, 1), ("ms", "inch", "deg")),
]  # fmt: skip


@pytest.mark.parametrize(("titles", "factors", "units"), STATED)
def test_units_that_titles_state_are_drafted(
    run: Run, titles: str, factors: tuple[float, float, float], units: tuple[str, str, str]
) -> None:
    path = titled_table(run, titles, factors)
    out = run.drafted(path)
    assert "unit in doubt" not in out
    assert f"so in {units[0]}, as its title says, 125 Hz" in out
    assert f"in {units[1]}, as its titles say, a" in out
    assert f"in {units[2]}, as their titles say" in out
    assert "guessed" not in run.mapping.read_text("utf-8")
    named = 'axes: "ZYX"' in run.mapping.read_text("utf-8")
    turning = {} if named else {"axes": "ZYX", **FORWARD}
    samples = run.imported(path, {**turning, "CHECK_1": "hand", "CHECK_2": "forearm"})
    hand = of(samples, "hand")
    np.testing.assert_allclose(samples.numbers[hand, :3], 400 * PLACE, atol=0.02)
    np.testing.assert_allclose(samples.time_s[hand], np.arange(FRAMES) / 125, atol=1e-6)
    turned = euler_matrix(np.radians(POSES_OF_TWO[:, 3:6]))
    np.testing.assert_allclose(matrix(samples.numbers[hand, 3:]), turned, atol=1e-4)


def euler_matrix(angles_rad: np.ndarray) -> np.ndarray:
    """Rotations (N, 3, 3) about z, then the new y, then the new x."""
    (cz, cy, cx), (sz, sy, sx) = np.cos(angles_rad).T, np.sin(angles_rad).T
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


@pytest.mark.parametrize(
    ("titles", "factors", "doubt", "key"),
    [
        (STATED[0][0], (1, 1, 1),
         "the title time_ms says ms, in which frames come at 1.25e+05 Hz", "time_unit"),
        (STATED[0][0].replace("cm", "m"), (1e3, 10, 1),
         "the titles of positions say m, in which their span is too far for a tracker", "position_unit"),
        (STATED[0][0].replace("cm", "mm"), (1e3, 0.01, 1),
         "the titles of positions say mm, in which their span is nothing", "position_unit"),
        (STATED[0][0].replace("deg", "rad"), (1e3, 1, 1),
         "the titles of angles say rad; they look like degrees, as ", "unit"),
        (STATED[0][0], (1e3, 1, np.pi / 180),
         "the titles of angles say deg; they look like radians, or degrees of very small turns", "unit"),
    ],
)  # fmt: skip
def test_a_stated_unit_that_cannot_be_is_doubted(
    run: Run, titles: str, factors: tuple[float, float, float], doubt: str, key: str
) -> None:
    assert f"\nunit in doubt: {doubt}" in run.drafted(titled_table(run, titles, factors))
    assert re.search(rf"(?m)^ *{key}: CHECK  # .*{re.escape(doubt)}", run.mapping.read_text("utf-8"))


def test_titles_that_disagree_settle_no_unit(run: Run) -> None:
    """`x_m` is a position in metres, or the x of the middle finger: only what all titles say is believed."""
    rows = np.concatenate([np.arange(FRAMES)[:, None] / 125, PLACE, TURNED, PLACE, TURNED], 1)
    titles = "time_s,x_i,y_i,z_i,iqw,iqx,iqy,iqz,x_m,y_m,z_m,mqw,mqx,mqy,mqz"
    assert "unit in doubt: titles of positions say m, others nothing\n" in run.drafted(
        run.table("old.csv", titles, rows)
    )
    mapping = yaml.safe_load(run.mapping.read_text("utf-8"))
    assert mapping["position_unit"] == "CHECK"
    assert mapping["csv"]["time_unit"] == "s"
    assert [own["position"] for own in mapping["receivers"].values()] == [
        [f"{axis}_{finger}" for axis in "xyz"] for finger in "im"
    ]
    out = run.inspect(run.table("old.csv", titles.replace("_i", "_mm"), rows))
    assert "unit in doubt: titles of positions say mm and m\n" in out


def test_nine_numbers_and_columns_without_names(run: Run) -> None:
    path = run.table("old.txt", "", np.concatenate([PLACE, matrix(TURNED).reshape(-1, 9)], 1), "  ")
    assert "cells separated by blanks, decimal point, no header" in run.drafted(path)
    samples = run.imported(path, {"position_unit": "m", "rate_hz": "240", **FORWARD, "CHECK_1": "hand"})
    np.testing.assert_allclose(matrix(samples.numbers[:, 3:]), matrix(TURNED), atol=1e-5)
    np.testing.assert_allclose(samples.time_s, np.arange(FRAMES) / 240)


def test_a_long_table(run: Run) -> None:
    rows = [
        f"{frame},{sensor},{frame * 8},{frame + 0.5},{sensor},3.25,{frame},{-sensor * frame},{3 * frame},0\n"
        for frame in range(1, 30)
        for sensor in (1, 2)
    ]
    titles = "sample,sensor,timestamp,p1,p2,p3,azimuth,elevation,roll,button\n"
    path = run.write("old.csv", titles + "".join(rows))
    out = run.drafted(path)
    assert "frame column sample: 1 to 29" in out
    assert "receiver column sensor: one row a receiver and frame; it has 1, 2" in out
    assert "degrees, as 87 is more than two pi" in out
    answers = {"position_unit": "cm", "time_unit": "ms"}
    samples = run.imported(path, answers | {"CHECK_1": "hand", "CHECK_2": "forearm"})
    hand = of(samples, "hand")
    assert hand.sum() == (~hand).sum() == 29
    np.testing.assert_allclose(samples.numbers[hand, 0], (np.arange(1, 30) + 0.5) * 10)


@pytest.mark.parametrize("names", ["azimuth,elevation,roll", "Roll,El,Az", "a,e,r"])
def test_what_azimuth_elevation_and_roll_mean_is_stated(run: Run, names: str) -> None:
    """As Polhemus trackers and a trakSTAR have them, in whatever order the columns stand."""
    order = ["aer".index(name[0].lower()) for name in names.split(",")]
    rows = np.c_[np.arange(FRAMES) / 125, PLACE, POSES_OF_TWO[:, 3:6][:, order]]
    assert "; azimuth, elevation and roll, degrees" in run.drafted(
        run.table("old.csv", f"t [s],x [m],y [m],z [m],{names}", rows)
    )
    mapping = yaml.safe_load(run.mapping.read_text("utf-8"))
    assert mapping["orientation"] == {"kind": "euler", "axes": "ZYX", "unit": "deg", **FORWARD}
    assert [name[0].lower() for name in mapping["receivers"]["CHECK_1"]["orientation"]] == ["a", "e", "r"]


def test_a_trakstars_table(run: Run) -> None:
    """As its programs write it: times of the day, short names of angles, a quality of each sensor."""
    times = ["23:59:59.9500000", *(f"00:00:00.{50 * n:03}0000" for n in range(7))]
    rows = [
        f"{time},{n}.5,2,3,{10 * n},-{n},{2 * n},{n},4,{n}.25,6,{5 * n},{n},-{3 * n},{7 * n}\n"
        for n, time in enumerate(times, 1)
    ]
    path = run.write("old.csv", "time,x1,y1,z1,a1,e1,r1,q1,x2,y2,z2,a2,e2,r2,q2\n" + "".join(rows))
    out = run.drafted(path)
    assert "angles: a1 10 to 80, e1 -8 to -1, r1 2 to 16; azimuth, elevation and roll, degrees" in out
    assert "position x2 y2 z2: span" in out
    assert "quality q2: 7 to 56" in out
    answers = {"position_unit": "inch", "quality_above": "40"}
    samples = run.imported(path, answers | {"CHECK_1": "hand", "CHECK_2": "forearm"})
    hand, forearm = of(samples, "hand"), of(samples, "forearm")
    np.testing.assert_allclose(samples.time_s[hand], 86399.9 + 0.05 * np.arange(1, 9))
    np.testing.assert_allclose(samples.numbers[hand, 0], 25.4 * (np.arange(1, 9) + 0.5))
    assert not samples.marks["low-quality"][hand].any()
    np.testing.assert_array_equal(samples.marks["low-quality"][forearm], 7 * np.arange(1, 9) > 40)


def test_repeats_are_told_and_drafted_as_out_of_step(run: Run) -> None:
    held = np.arange(FRAMES) // 3
    rows = np.concatenate([0.003 * np.arange(FRAMES)[:, None], TURNED[held], PLACE[held]], 1)
    path = run.table("old.csv", "Time,w1,x1,y1,z1,loc1_x,loc1_y,loc1_z", rows)
    assert "w1 x1 y1 z1: 67% of the rows repeat the one before (14 new values)" in run.drafted(path)
    answers = {"position_unit": "m", "rate_hz": "111", "order": "wxyz", **FORWARD, "time_unit": "s"}
    samples = run.imported(path, answers | {"CHECK_1": "hand"})
    np.testing.assert_array_equal(samples.frame, np.arange(14))


def test_matrices_in_a_file_and_in_a_folder(run: Run) -> None:
    folder = run.folder / "poses"
    folder.mkdir()
    whole = np.tile(np.eye(4), (FRAMES, 1, 1))
    whole[:, :3, :3], whole[:, :3, 3] = matrix(TURNED), PLACE
    texts = ["\n".join(" ".join(f"{v:.8f}" for v in row) for row in one) + "\n" for one in whole]
    for number, text in enumerate(texts):
        (folder / f"{number}.txt").write_text(text)
    (folder / "LICENSE").write_text("free")
    for path in (folder, run.write("all.traj", "\n".join(texts))):
        out = run.drafted(path)
        assert "40 matrices of 4 x 4" in out
        assert "40 of 40 are rotations within 0.01" in out
        samples = run.imported(path, {"position_unit": "m", "rate_hz": "100", **FORWARD, "CHECK": "hand"})
        np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-4)
        run.mapping.unlink()


def write_c3d(path: Path, points: np.ndarray, labels: list[str], unit_text: str = "") -> Path:
    """A C3D file of 50 Hz; points: (T, P, 3). Without points it has the poses as a ROTATION `hand 1`."""
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit_text] if unit_text else []
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file["data"]["points"] = np.concatenate([points, np.ones((*points.shape[:2], 1))], -1).transpose(2, 1, 0)
    if not labels:
        whole = np.tile(np.eye(4)[:, :, None, None], (1, 1, 1, 2 * FRAMES))
        whole[:3, :3, 0, ::2], whole[:3, 3, 0, ::2] = np.moveaxis(matrix(TURNED), 0, -1), PLACE.T
        file.add_parameter("ROTATION", "LABELS", ["hand 1"])
        file["data"]["rotations"] = whole
    file.write(str(path))
    return path


def test_a_c3d_file_names_its_rigid_clusters(run: Run) -> None:
    shape = np.array([[0.0, 0, 0], [60, 0, 0], [20, 40, 0]])
    rigid = shape @ np.swapaxes(matrix(TURNED), 1, 2) + 1000 * PLACE[:, None]
    points = np.concatenate([rigid, RNG.normal(scale=100, size=(FRAMES, 3, 3))], 1)
    points[:10, 3] = np.nan
    labels = ["Arm1", "Arm2", "Arm3", "Dot1", "Dot2", "Dot3"]
    path = write_c3d(run.folder / "a.c3d", points, labels, "mm")
    out = run.drafted(path)
    facts = ["C3D: 6 points, 40 frames numbered from 1", "rate 50 Hz", "unit mm (POINT:UNITS)"]
    for fact in (*facts, "missing: Dot1 25 %"):
        assert fact in out
    assert re.search(r"Arm1, Arm2, Arm3: .*: a rigid cluster", out)
    assert re.search(r"Dot1, Dot2, Dot3: .*: not rigid", out)
    assert re.search(r"Arm1, .*: distances about [\d.]+ mm, varying by \S+ mm: ", out)
    draft = run.mapping.read_text()
    assert "first_frame" not in draft
    assert "#   last_frame: 40  # frames count from 1 at the first stored frame" in draft
    samples = run.imported(path, {"CHECK_Arm": "upper_arm"})
    np.testing.assert_allclose(samples.numbers[:, :3], rigid[:, 0], atol=1e-3)
    assert samples.notes[0].startswith("cluster upper_arm: 3 markers")


def test_markers_that_are_never_seen_together(run: Run) -> None:
    points = np.full((FRAMES, 3, 3), np.nan)
    for marker in range(3):
        points[marker::3, marker] = PLACE[marker::3]
    out = run.inspect(write_c3d(run.folder / "a.c3d", points, ["Dot1", "Dot2", "Dot3"]))
    assert "markers Dot1, Dot2, Dot3: never seen together" in out
    assert "nan" not in out


def test_a_c3d_file_of_rotations(run: Run) -> None:
    path = write_c3d(run.folder / "a.c3d", np.ones((FRAMES, 0, 3)), [])
    out = run.drafted(path)
    assert "ROTATION labels: hand 1, 2 a frame" in out
    assert "no unit is stated" in out
    samples = run.imported(path, {"position_unit": "m", "CHECK_hand_1": "hand"})
    np.testing.assert_allclose(samples.numbers[:, :3], PLACE * 1000, atol=1e-3)


def test_positions_alone_are_said_to_be_too_little(run: Run) -> None:
    lines = [",".join(f"{v:.5f}" for v in row) + ",,ok\n" for row in PLACE]
    out = run.drafted(run.write("points.csv", "x,y,z,quality,note\n" + "".join(lines)))
    assert "no orientations were found: a joint cannot be found from positions alone" in out
    assert "text: quality, note" in out
    with pytest.raises(InputError, match="CHECK"):
        read_mapping(run.mapping)


def test_parquet_of_other_programs(run: Run) -> None:
    names = TIDY.strip().replace("segment", "receiver").split(",")
    columns: dict[str, list[float]] = {name: [1, 2] for name in names} | {"qw": [1, 1]}
    columns |= {name: [0, 0] for name in ("qx", "qy", "qz")}
    pq.write_table(pa.table(columns), run.folder / "tidy.parquet")
    out = run.inspect(run.folder / "tidy.parquet")
    assert "a tidy recording (Parquet): needs no mapping" in out
    assert "receivers: 1, 2" in out
    pq.write_table(pa.table({"a": [1.5]}), run.folder / "other.parquet")
    err = run.inspect(run.folder / "other.parquet", code=2)
    assert "neither a tidy recording nor a table of this project; it has a (double)" in err


TIDY = "frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n"
TIDY_ROWS = "7,0.5,hand,1,2,3,1,0,0,0\n8,0.51,hand,,,,,,,\n8,0.51,elbow,1,2,3,1,0,0,0\n"


def test_own_files_need_no_mapping(run: Run) -> None:
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


@pytest.mark.parametrize("text", [GUIDE_FILE, GUIDE_FILE.split("\n", 1)[1]], ids=["comments", "semicolons"])
def test_importing_a_foreign_table_without_a_mapping_leads_here(run: Run, text: str) -> None:
    path = run.write("old.csv", text)
    recording_files.refuse(path, f"`shukotsu inspect {path}`")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", b"", "a.csv: is empty"),
        ("a.csv", b"hello\nworld\n", "a.csv: no table of numbers"),
        ("a.csv", b"\x00\xff\xfe", "a.csv: is not UTF-8 text"),
        ("a.c3d", b"hello", "a.c3d: not a readable C3D file"),
        ("a.parquet", b"hello", "a.parquet: not a readable Parquet file"),
        ("a.txt", b"1 0 0 0\n0 1 0 0\n", "a.txt: line 3: the matrix that begins in line 1 has 2 lines"),
        ("a.csv", b"t,x,y,z\n1,2,3,4\n2,3,4,5\n3,4\n", "a.csv: line 4: has 2 cells; expected 4"),
        ("a.xdf", b"hello", "a.xdf: "),
    ],
)
def test_what_cannot_be_read_is_one_sentence(run: Run, name: str, content: bytes, message: str) -> None:
    err = run.inspect(run.write(name, content), code=2)
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1


def test_an_edited_mapping_is_not_overwritten(run: Run) -> None:
    run.write("mapping.yaml", "mine\n")
    path = run.write("a.csv", GUIDE_FILE)
    assert "is there already" in run.inspect(path, "--write-mapping", str(run.mapping), code=2)
    assert run.mapping.read_text() == "mine\n"
    assert "no such file" in run.inspect(run.folder / "nothing", code=2)


@pytest.mark.parametrize(
    ("file", "facts"),
    [
        (
            "upper_limb_clusters_apache2/racing_full.c3d",
            ["rate 69.9926 Hz", "ForearmR1, ForearmR2, ForearmR3:"],
        ),
        ("pivot_bsd3", ["57 matrices of 4 x 4 in files *.txt", "57 of 57 are rotations"]),
        ("fastrak_wrist_cc0/user1_cup0.traj", ["290 matrices of 4 x 4", "in m a desk"]),
        (
            "upper_limb_poses/racing_right.csv",
            ["a tidy recording", "segments: scapula, upper_arm, forearm, hand"],
        ),
    ],
)
def test_real_files(real_data: Path, run: Run, file: str, facts: list[str]) -> None:
    out = run.inspect(real_data / file)
    for fact in facts:
        assert fact in out
    if "tidy" not in out:
        run.drafted(real_data / file)
        assert "CHECK" in str(yaml.safe_load(run.mapping.read_text()))


def test_inspection_and_import_say_what_cannot_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a recording in metres, and of a left hand without and with a word on which hand it is."""
    made = {hand: simulate("01", hand, "rom", 7, Realism.full(), 900) for hand in ("right", "left")}
    metres = replace(made["right"], position_mm=made["right"].position_mm / 1000)
    write_recording(tmp_path / "metres.csv", metres)
    write_recording(tmp_path / "left.parquet", made["left"])
    sentence = "units: The positions are 1000 times too small, in m and read as mm"

    def said(*words: str) -> tuple[str, str]:
        assert main([*words]) == 0
        captured = capsys.readouterr()
        return captured.out, captured.err

    assert f"suspect: {sentence}" in said("inspect", str(tmp_path / "metres.csv"))[0]
    who = ["--layout", "liberty16", "--subject", "01", "--hand", "right", "--task", "rom"]
    poses = str(tmp_path / "poses.parquet")
    printed = said("import", "--in", str(tmp_path / "metres.csv"), "--out", poses, *who)[1]
    assert f"suspect: {tmp_path / 'metres.csv'}: {sentence}" in printed
    assert f"suspect: {sentence}" in said("inspect", poses)[0]
    left = said("inspect", str(tmp_path / "left.parquet"))[0]
    assert "it looks like a left hand" in left
    assert "suspect" not in left
    assert "wrong-hand" in said("inspect", str(tmp_path / "left.parquet"), "--hand", "right")[0]
