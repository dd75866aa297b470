"""Settings and fixtures for all tests."""

import os
import re
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import shape_checks
from hypothesis import settings

shape_checks.install()  # before shukotsu is imported

from shukotsu.errors import InputError  # noqa: E402

# Tests start hundreds of processes, which takes a third of the time with cached bytecode.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

if hasattr(signal, "SIGHUP"):  # ignored under `nohup`, also by child processes
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as set by a shell for `&`
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.setdefault("OMP_NUM_THREADS", "1")  # as in the workflow; threads do not help small matrices

# No deadline, so that slow machines do not fail. Examples are fixed except in the profile `search`.
settings.register_profile("steady", deadline=None, max_examples=15, derandomize=True)
INPUTS = int(os.environ.get("FUZZ_INPUTS", "100"))
settings.register_profile("search", deadline=None, max_examples=INPUTS, print_blob=True)
settings.load_profile("steady")

REPOSITORY = Path(__file__).resolve().parent.parent
LONGEST = {"studies", "end_to_end", "test_loose_receivers.py", "test_package.py"}
"""Folders and files that take minutes."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the longest files first, so that no parallel worker starts one of them at the end."""
    items.sort(key=lambda item: LONGEST.isdisjoint(item.path.parts))


@pytest.fixture(scope="session")
def real_data() -> Path:
    """Folder of real recordings, which are not part of the project; the test is skipped without it."""
    folder = Path(os.environ.get("SHUKOTSU_REAL_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no folder of real recordings; SHUKOTSU_REAL_DATA can name one")
    return folder


@pytest.fixture(scope="session")
def export_tool() -> Callable[..., Path]:
    """Return a function that finds an external program by its path in the folder of such programs.

    The folder is .tools or SHUKOTSU_TOOLS; the test is skipped if the program is missing, or node for a
    folder in node_modules, or the package that is named as second argument beside Python.
    """
    folder = Path(os.environ.get("SHUKOTSU_TOOLS", REPOSITORY / ".tools"))

    def find(name: str, package: str = "") -> Path:
        program = folder / name
        if not program.exists():
            pytest.skip(f"no {name} in {folder}; SHUKOTSU_TOOLS can name another")
        if name.startswith("node_modules") and program.is_dir() and shutil.which("node") is None:
            pytest.skip("no node on PATH")
        if package and not list(program.parents[1].glob(f"lib/*/site-packages/{package}")):
            pytest.skip(f"{package} is not installed beside {program}")
        return program

    return find


INTERNAL = re.compile(
    r"<(class|function|module|bound|_io|built)|object at 0x|Traceback|codec can't|Errno|PosixPath|WindowsPath"
    r"|\b(np|numpy|pa|pyarrow|pd)\.\w|\bdtype\b|(Value|Type|Key|Index|Attribute|Unicode\w+)Error|\bNone\b"
)
"""Words of Python and its libraries that must not appear in messages to users."""


@pytest.fixture(autouse=True)
def _refusals_can_be_read(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Fail a test if any InputError during it has a message with Python internals or no words."""
    plain, made = InputError.__init__, []

    def recorded(self: InputError, message: str) -> None:
        plain(self, message)
        made.append(str(self))

    monkeypatch.setattr(InputError, "__init__", recorded)
    yield
    assert [text for text in made if INTERNAL.search(text) or not re.search(r"\w+ \w+", text)] == []
