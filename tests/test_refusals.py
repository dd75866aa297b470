"""Refusals of options are one short printable line that names the option."""

import shlex
from pathlib import Path

import pytest

from shukotsu.__main__ import main
from shukotsu.errors import MOST_LETTERS, InputError


def test_a_message_is_one_short_printable_line_whatever_it_quotes() -> None:
    """It may quote a file of unknown origin that contains terminal control codes."""
    sentence = str(
        InputError("a.csv: is \x1b]0;x\x07\x9b31m\ud800\n\tb " + "x" * 5000 + "; expected a number")
    )
    assert len(sentence) <= MOST_LETTERS
    assert sentence.isprintable()
    assert sentence.startswith("a.csv: is ?]0;x??31m? b xxx")
    assert sentence.endswith("xxx; expected a number")


RECORD = "record --port /dev/no-such-port --out rom.arrows"
REFUSED = {
    "emulate --pty --stations 0-3": "--stations: is '0-3'; expected numbers from 1 to 16",
    "emulate --tcp 0.0.0.0:4001": "--tcp: is '0.0.0.0:4001'; expected a port of this machine",
    "emulate --pty --recording none.parquet": "none.parquet: no such file",
    "emulate --pty /nowhere/at/all": "/nowhere/at/all: cannot be made a link",
    "emulate --archive out.arrows": "--archive: needs a recording",
    "emulate --archive out.bin --recording r.csv": "out.bin: expected a name that ends with .arrows",
    "emulate --archive o.arrows --recording r.csv --loop": "--loop: needs a port",
    "record --ask": "--port: is missing; `shukotsu record --devices` lists",
    f"{RECORD} --duration 0": "--duration: is 0; expected seconds above 0",
    f"{RECORD} --out rom.parquet": "--out: is rom.parquet; expected a name that ends with .arrows",
    f"{RECORD} --tracker libety": "--tracker: is 'libety'; did you mean 'liberty'?",
    f"{RECORD} --tracker viper --stations 1": "--stations: a VIPER sends every sensor",
    f"{RECORD} --tracker viper --items short": "--items: a VIPER has no output lists",
    f"{RECORD} --tracker patriot --rate 120": "--rate: a patriot has a fixed rate",
    f"{RECORD} --stations 8-1": "--stations: is '8-1'; expected numbers from 1 to 16",
    f"{RECORD} --stations 0": "--stations: is '0'",
    f"{RECORD} --hemisphere up": "--hemisphere: is 'up'",
    RECORD: "/dev/no-such-port: no such port",
    "coach": "expected one of --port",
    "coach --port=x --replay=y": "expected one of --port",
    "coach --replay=absent.arrows": "absent.arrows",
    "coach --follow=absent.arrows": "absent.arrows: no such file",
    "coach --replay=x.arrows --speed=-1": "--speed: is -1",
    "coach --replay=x.arrows --page=y.arrows": "--page: is y.arrows",
    "coach --replay=x.arrows --layout=nothing": "layout 'nothing' is neither",
    "coach --replay=x.arrows --study=absent.yaml --subject=3": "absent.yaml",
    "coach --replay=x.arrows --study=absent.yaml": "--subject: is missing",
    "coach --replay=x.arrows -- --rate=240": "--rate=240: is an option of the recorder",
    "coach --port=socket://127.0.0.1:1": "socket://127.0.0.1:1: nothing was recorded",
    "import --in=r.csv --layout=a --subject= --hand=left --task=rom --out=p": "--subject: is empty",
    "new there": "there/recordings.tsv: already exists; name another folder, or edit that file",
    "new a --recordings absent": "--recordings: absent: no such folder; give the folder of your",
    "new a --recordings there": "--recordings: there: contains no recording; expected files that end",
    "new a --layout hand": "layout 'hand' is neither a layout that ships",
    "check": "study.yaml: not found in ",
}  # fmt: skip


@pytest.mark.parametrize("words", REFUSED)
def test_invalid_options_are_refused_in_one_sentence(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there/recordings.tsv").mkdir(parents=True)
    assert main(shlex.split(words)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(f"error: {REFUSED[words]}")
    assert printed.err.count("\n") == 1
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
