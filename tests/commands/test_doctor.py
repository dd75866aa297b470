"""`shukotsu doctor`: each check's result with its remedy; only required parts make it fail."""

import importlib.metadata
import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from shukotsu.commands import doctor


@pytest.mark.parametrize("absent", ["", "scipy"])
def test_every_check_has_a_line_and_a_missing_package_exits_with_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], absent: str
) -> None:
    monkeypatch.chdir(tmp_path)

    def version(name: str) -> str:
        if name == absent:
            raise importlib.metadata.PackageNotFoundError(name)
        return importlib.metadata.version(name)

    monkeypatch.setattr(doctor, "version", version)
    assert doctor.main([]) == (2 if absent else 0)
    packages, disk, tracker = capsys.readouterr().out.splitlines()
    assert packages.split()[:2] == ["MISSING" if absent else "ok", "packages"]
    assert ("not installed: scipy; install this program again" in packages) == bool(absent)
    assert str(tmp_path) in disk
    assert tracker.split()[1] == "tracker"


def test_a_port_without_permission_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    import serial.tools.list_ports

    port = SimpleNamespace(device="/dev/ttyUSB7")
    monkeypatch.setattr(serial.tools.list_ports, "comports", lambda: [port])
    monkeypatch.setattr(os, "access", lambda *_: False)
    check = list(doctor.checks())[-1]
    assert not check.there
    assert "this user has no permission for /dev/ttyUSB7" in check.state
    assert "group" in check.remedy
