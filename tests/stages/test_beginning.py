"""What every job of a study begins with: no pandas, and an end that leaves nothing half-written."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

WITHOUT_PANDAS = """
import sys
from stages import command_line
command_line.begin()
import pyarrow as pa
pa.array([1.0, None], from_pandas=True)
assert "pandas" not in sys.modules
"""
WRITING = """
import sys, time
from pathlib import Path
from schemas.files import replacing
from stages import command_line
command_line.begin()
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""
REPOSITORY = Path(__file__).resolve().parents[2]


def test_pyarrow_works_and_finds_no_pandas() -> None:
    pytest.importorskip("pandas")
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_PANDAS], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_told_to_end_while_it_writes_it_leaves_no_file(tmp_path: Path) -> None:
    words = [sys.executable, "-c", WRITING, str(tmp_path / "table.parquet")]
    with subprocess.Popen(words, cwd=REPOSITORY, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "writing\n"
        assert [path.suffix for path in tmp_path.iterdir()] == [".tmp"]
        process.terminate()
        assert process.wait(10) == 128 + signal.SIGTERM
    assert not list(tmp_path.iterdir())
