"""Every refusal that the tests meet: how it reads, and the places in the code that no test reaches.

A plugin of the tests (see `conftest.py`). A test during which a sentence comes up that no user could follow
fails. After the whole fast suite the places that were not reached are named, and the run fails where one of
HELD is among them.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from refusal_places import ROOT, Place, places

from schemas.errors import MOST_LETTERS, InputError

INTERNAL = re.compile(
    r"<(class|function|module|bound|_io|built)|object at 0x|Traceback|codec can't|Errno|PosixPath|WindowsPath"
    r"|\b(np|numpy|pa|pyarrow|pd)\.\w|\bdtype\b|(Value|Type|Key|Index|Attribute|Unicode\w+)Error|\bNone\b"
)
"""Words of Python and its libraries, which are none of a user's."""
HELD = ("schemas/", "workflow/", "trackers/", "checks/", "skeleton/", "anatomy/")
"""Rooms of which every place must be reached; those of stages are only named."""
_PROCESS = "said by the recorder or the emulator, which tests run as processes of their own"
_STAGE = "tests of the stages that read such files reach it"
UNREACHED = {
    "schemas/bids/dataset_files.py": _STAGE,
    "schemas/marked_text.py": "of `make docs` alone",
    "schemas/parts.py": _STAGE,
    "schemas/plan.py": _STAGE,
    "schemas/poses.py": _STAGE,
    "schemas/recording_summary.py": _STAGE,
    "schemas/tables.py": _STAGE,
    "schemas/limits.py": _STAGE,
    "schemas/study.py: …: row …: results of … would have the path of … (row …); rename one": (
        "of two rows whose results share a path; no test has such a pair yet"
    ),
    "skeleton/posed_recording.py": _STAGE,
    "skeleton/digit_chain.py": _STAGE,
    "trackers/archive.py": _STAGE,
    "trackers/decode/stream.py": _STAGE,
    "trackers/families.py": _STAGE,
    **dict.fromkeys(
        (
            "trackers/emulate/server.py",
            "trackers/fastrak/driver.py",
            "trackers/liberty/driver.py",
            "trackers/record/driver.py",
            "trackers/record/session.py",
            "trackers/record/tracker_check.py",
            "trackers/viper/driver.py",
        ),
        _PROCESS,
    ),
}
"""Files, and `file: pattern` of places, that no test of their room reaches, each with the reason."""

_here: list[tuple[str, int, str]] = []
"""File, line and sentence of every refusal of the test that runs."""
_met: set[tuple[str, int]] = set()


def start() -> None:
    """Record what is raised from now on."""
    plain = InputError.__init__

    def recorded(self: InputError, message: str) -> None:
        plain(self, message)
        frame = sys._getframe(1)
        file = Path(frame.f_code.co_filename)
        if file.is_relative_to(ROOT) and not file.is_relative_to(ROOT / "tests"):
            _here.append((file.relative_to(ROOT).as_posix(), frame.f_lineno, str(self)))

    InputError.__init__ = recorded  # type: ignore[method-assign]


def here() -> list[tuple[str, int, str]]:
    """File, line and sentence of every refusal of this test so far."""
    return list(_here)


def complaint(sentence: str) -> str:
    """Say what is wrong with a sentence for a user; empty where nothing is."""
    if len(sentence) > MOST_LETTERS:
        return f"has {len(sentence)} letters"
    found = INTERNAL.search(sentence)
    if found:
        return f"speaks of {found[0]!r}"
    if not sentence.isprintable():
        return "holds what cannot be printed"
    return "" if re.search(r"\w+ \w+", sentence) else "says nothing"


@pytest.fixture(autouse=True)
def _sentences_can_be_followed() -> Iterator[None]:
    _here.clear()
    yield
    _met.update((file, line) for file, line, _ in _here)
    odd = [f"{file}:{line}: {said}: {wrong}" for file, line, said in _here if (wrong := complaint(said))]
    assert not odd, "\n".join(odd)


def unreached(met: set[tuple[str, int]]) -> list[Place]:
    """Places that were not met and are not excepted."""
    return [
        place
        for place in places()
        if (place.file, place.line) not in met
        and not {place.file, f"{place.file}: {place.pattern}"} & UNREACHED.keys()
    ]


def pytest_configure(config: pytest.Config) -> None:
    """Give the workers of a run one folder to leave what they have met."""
    if not hasattr(config, "workerinput"):
        config.stash[_FOLDER] = tempfile.TemporaryDirectory(prefix="shukotsu-refusals-")


_FOLDER = pytest.StashKey[Any]()


def pytest_configure_node(node: Any) -> None:
    """Tell a worker of xdist that folder."""
    node.workerinput["refusals"] = node.config.stash[_FOLDER].name


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Leave what was met; after the whole fast suite say what was not."""
    config: Any = session.config
    worker = hasattr(config, "workerinput")
    folder = Path(config.workerinput["refusals"] if worker else config.stash[_FOLDER].name)
    name = config.workerinput["workerid"] if worker else "main"
    (folder / f"{name}.json").write_text(json.dumps(sorted(_met)))
    if worker:
        return
    met = {tuple(each) for path in folder.glob("*.json") for each in json.loads(path.read_text())}
    config.stash[_FOLDER].cleanup()
    whole = config.option.markexpr.startswith("not slow") and not config.option.keyword
    if whole and config.args_source is pytest.Config.ArgsSource.TESTPATHS and session.exitstatus == 0:
        missed = unreached(met)
        for place in missed:
            print(f"\n{place.file}:{place.line}: no test meets this refusal: {place.pattern}", end="")
        session.exitstatus = int(any(place.file.startswith(HELD) for place in missed))
