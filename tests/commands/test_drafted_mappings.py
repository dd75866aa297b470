"""Mappings of a folder: one for all files that are alike, also where one leaves open what another settles."""

from pathlib import Path

from shukotsu.commands.drafted_mappings import Drafts, draft_mappings
from shukotsu.schemas.layout import read_layout

TITLES = "t [s],x,y,z,az,el,roll\n"


def table(path: Path, step_deg: float, titles: str = TITLES) -> Path:
    """Write a table of one receiver whose angles grow by so much a row."""
    angles = [(n * step_deg, n * step_deg / 2, n * step_deg / 3) for n in range(9)]
    rows = [f"{n / 100},{n},{n * 2},{n * 3},{','.join(map(str, angles[n]))}\n" for n in range(9)]
    path.write_text(titles + "".join(rows))
    return path


def test_what_one_file_leaves_open_another_settles(tmp_path: Path) -> None:
    """Angles of small turns may be radians; the same columns' large ones are degrees."""
    small, large = table(tmp_path / "a.csv", 0.1), table(tmp_path / "b.csv", 9.0)
    other = table(tmp_path / "c.csv", 9.0, TITLES.replace(" [s]", " [ms]"))
    empty = tmp_path / "d.csv"
    empty.touch()
    seen: list[int] = []
    drafts = draft_mappings([small, large, other, empty], read_layout("liberty16"), seen.append)
    assert drafts.of == {small: "mapping.yaml", large: "mapping.yaml", other: "mapping-2.yaml"}
    assert "Drafted from b.csv" in drafts.texts["mapping.yaml"]
    assert drafts.refused == {empty: f"{empty}: is empty; expected a recording"}
    assert seen == [1, 2, 3, 4]


def test_this_project_s_own_tables_need_none(tmp_path: Path) -> None:
    own = tmp_path / "own.csv"
    own.write_text("frame,time_s,segment,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,0,hand,1,2,3,1,0,0,0\n")
    drafts = draft_mappings([own], read_layout("liberty16"))
    assert drafts == Drafts({}, {}, {})
