"""The command line `record`: help, refusals, exit codes."""

from pathlib import Path

import pytest

from shukotsu.stages.capture import record_tracker


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--duration", "0"], "--duration: is 0; expected seconds above 0"),
        (["--out", "rom.parquet"], "--out: is rom.parquet; expected a name that ends with .arrows"),
        (["--tracker", "fastrak"], "--tracker: fastrak left in 0.2: record with the tracker's own program"),
        (["--tracker", "libety"], "--tracker: is 'libety'; expected one of liberty, patriot, viper"),
        (["--tracker", "viper", "--stations", "1"], "--stations: a VIPER sends every sensor"),
        (["--tracker", "viper", "--items", "short"], "--items: a VIPER has no output lists"),
        (["--tracker", "patriot", "--rate", "120"], "--rate: a patriot has a rate of its own"),
        (["--port", "igtl://host:18944"], "--port: igtl left in 0.2: record with PLUS or 3D Slicer"),
        (["--lsl-outlet"], "record --lsl-outlet left in 0.2: import the archive"),
        (["--stations", "0"], "--stations: is '0'"),
        (["--hemisphere", "up"], "--hemisphere: is 'up'"),
        ([], "/dev/no-such-port: no such port"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_anything_is_done(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "rom.arrows"
    assert record_tracker.main(["--port", "/dev/no-such-port", "--out", str(out), *options]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error: {sentence}")
    assert told.count("\n") == 1
    assert not out.exists()


def test_ports_are_listed_without_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert record_tracker.main(["--devices"]) == 0
    assert capsys.readouterr().out
    assert record_tracker.main(["--ask"]) == 2
    assert "--port: is missing; `shukotsu record --devices` lists" in capsys.readouterr().err
