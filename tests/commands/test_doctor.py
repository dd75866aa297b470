"""`shukotsu doctor`: what is there is ok, what is not is named with its remedy, and only the needed fails."""

from __future__ import annotations

import importlib.metadata
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from shukotsu.commands import doctor

NAMES = ["packages", "disk", "tracker"]


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
    assert lines["packages"].startswith("ok")
    assert str(tmp_path) in lines["disk"]


def test_a_package_that_is_missing_ends_with_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def version(name: str) -> str:
        if name == "scipy":
            raise importlib.metadata.PackageNotFoundError(name)
        return importlib.metadata.version(name)

    monkeypatch.setattr(doctor, "version", version)
    assert doctor.main([]) == 2
    line = lines_of(capsys.readouterr().out)["packages"]
    assert line.startswith("MISSING")
    assert "not installed: scipy; install this program again" in line


def test_a_port_that_is_closed_to_this_user_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial.tools.list_ports

    port = SimpleNamespace(device="/dev/ttyUSB7")
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: [port])
    monkeypatch.setattr(os, "access", lambda *_: False)
    check = doctor._ports()
    assert not check.there
    assert "not to be opened by this user: /dev/ttyUSB7" in check.found
    assert "group" in check.remedy
