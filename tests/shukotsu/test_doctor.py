"""`shukotsu doctor`: what is there is ok, what is not is named with its remedy, and only the needed fails."""

from __future__ import annotations

import importlib.metadata
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from shukotsu import doctor

NAMES = [
    "Python",
    "packages",
    "memory",
    "disk",
    "locks",
    "encoding",
    "tracker",
    "Japanese",
    "Slurm",
    "Blender",
    "git",
]


def lines_of(out: str) -> dict[str, str]:
    """Each check's name and the rest of its line."""
    return {line.split()[1]: line for line in out.splitlines()}


def test_every_check_has_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert doctor.main([]) == 0
    lines = lines_of(capsys.readouterr().out)
    assert list(lines) == NAMES
    assert lines["Python"].startswith("ok")
    assert lines["packages"].startswith("ok")
    assert str(tmp_path) in lines["disk"]


def test_a_package_that_is_missing_ends_with_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def version(name: str) -> str:
        if name == "scipy":
            raise importlib.metadata.PackageNotFoundError(name)
        return "0.1" if name == "numpy" else importlib.metadata.version(name)

    monkeypatch.setattr(doctor, "version", version)
    assert doctor.main([]) == 2
    line = lines_of(capsys.readouterr().out)["packages"]
    assert line.startswith("MISSING")
    assert "not installed: scipy; run ./bootstrap requirements.lock" in line
    assert "others than tested: numpy 0.1" in line


def test_a_port_that_is_closed_to_this_user_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial.tools.list_ports

    port = SimpleNamespace(device="/dev/ttyUSB7")
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: [port])
    monkeypatch.setattr(os, "access", lambda *_: False)
    check = doctor._ports()
    assert not check.there
    assert "not to be opened by this user: /dev/ttyUSB7" in check.found
    assert "group" in check.remedy


def test_little_memory_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("schemas.limits.available_memory_bytes", lambda: 500_000_000)
    check = doctor._memory()
    assert not check.there
    assert "0.5 GB free" in check.line(9)
    assert "enough for 1 jobs" in check.found


def test_a_folder_that_cannot_be_written_ends_with_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert doctor.main([]) == 2
    assert "where this user may not write" in lines_of(capsys.readouterr().out)["disk"]


def test_a_japanese_font_is_found_where_there_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "FONT_FOLDERS", (str(tmp_path),))
    assert not doctor._japanese_font().there
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "NotoSansCJK-Regular.ttc").touch()
    assert doctor._japanese_font().found == "font NotoSansCJK-Regular.ttc"
