"""The command lines `record`, `devices` and `check`: help, refusals, exit codes."""

from pathlib import Path

import pytest

from shukotsu.stages.capture import record_tracker


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--duration", "0"], "--duration: is 0; expected seconds above 0"),
        (["--countdown", "-1"], "--countdown: is -1; expected 0 or more seconds"),
        (["--out", "rom.parquet"], "--out: is rom.parquet; expected a name that ends with .arrows"),
        (["--tracker", "fastrak", "--rate", "120"], "--rate: a fastrak has a rate of its own; leave it out"),
        (["--stations", "0"], "--stations: is '0'"),
        (["--items", "nothing"], "--items: is 'nothing'"),
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
