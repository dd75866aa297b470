"""Servers of OpenIGTLink by others, where they are installed: pyigtl, examples of the reference library."""

import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from tracker_processes import REPOSITORY, capture

from shukotsu.trackers.archive import open_archive
from shukotsu.trackers.decode.stream import Tally, blocks_of
from shukotsu.trackers.protocols.records import Records, concatenated

pytestmark = pytest.mark.tools
PYTHON = Path(os.environ.get("SHUKOTSU_TOOLS", REPOSITORY / ".tools")) / "python" / "bin" / "python"
EXAMPLES = Path("/usr/share/doc/openigtlink-examples/examples")
HEADERS = Path("/usr/include/openigtlink")
SECONDS = 5
PYIGTL = """
import collections, sys, time, numpy, pyigtl
server = pyigtl.OpenIGTLinkServer(port=int(sys.argv[1]))
server.outgoing_messages = collections.deque()  # its own holds a hundred, and drops
while not server.is_connected():
    time.sleep(0.01)
start, matrix = time.time(), numpy.eye(4)[[1, 2, 0, 3]]
for frame in range(int(sys.argv[2])):
    time.sleep(max(0, start + frame / 240 - time.time()))
    for tool in range(1, 17):
        matrix[:3, 3] = frame // 500, frame % 500, tool
        stamp = 1.7e9 + frame / 240
        message = pyigtl.TransformMessage(matrix.copy(), timestamp=stamp, device_name=f"T{tool}")
        server.send_message(message, wait=False)
time.sleep(60)
"""


def recorded(server: list[str], tmp_path: Path, duration_s: float) -> Records:
    """Record a program that serves at the port that `PORT` stands for; gives its good records."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = str(free.getsockname()[1])
    words = [port if word == "PORT" else word for word in server]
    out = tmp_path / "rom.arrows"
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        time.sleep(2)  # a trial connection would be its only one
        try:
            to = f"igtl://127.0.0.1:{port}"
            done = capture("record", "--port", to, "--out", str(out), "--duration", str(duration_s))
        finally:
            process.kill()
    assert done.returncode == 0, done.stderr
    blocks = list(blocks_of(open_archive(out), Tally()))
    assert all(block.good.all() for block in blocks)
    return concatenated([block.records for block in blocks])


def test_nothing_is_lost_of_sixteen_tools_of_pyigtl(tmp_path: Path) -> None:
    if not list(PYTHON.parents[1].glob("lib/*/site-packages/pyigtl")):
        pytest.skip(f"pyigtl is not installed beside {PYTHON}")
    records = recorded([str(PYTHON), "-c", PYIGTL, "PORT", str(240 * (SECONDS + 5))], tmp_path, SECONDS)
    sent = records.position_mm @ [500, 1, 0]
    for station in range(1, 17):
        mine = records.station == station
        assert np.diff(sent[mine]).tolist() == [1] * (mine.sum() - 1)
        assert mine.sum() > 200 * SECONDS
    assert (records.position_mm[:, 2] == records.station).all()
    assert (np.diff(sent) == np.diff(records.frame)).all()
    assert np.abs(records.quaternion) == pytest.approx(0.5)


@pytest.mark.parametrize("name", ["Tracker", "TrackingData", "QuaternionTrackingData"])
def test_examples_of_the_reference_library_are_read(name: str, tmp_path: Path) -> None:
    source, compiler = EXAMPLES / name / f"{name}Server.cxx", shutil.which("c++")
    if not (source.exists() and HEADERS.exists() and compiler):
        pytest.skip("openigtlink-examples, libopenigtlink-dev or a compiler is not installed")
    program = str(tmp_path / name)
    command = [compiler, "-w", str(source), f"-I{HEADERS}", "-lOpenIGTLink", "-lpthread", "-o", program]
    subprocess.run(command, check=True)
    records = recorded([program, "PORT", *(["20"] if name == "Tracker" else [])], tmp_path, 1.5)
    assert {*records.station.tolist()} == ({1} if name == "Tracker" else {1, 2, 3})
    x, y, z = records.position_mm.T
    assert x == pytest.approx(z)
    assert np.hypot(x, y) == pytest.approx(50, abs=1e-3)
    assert np.linalg.norm(records.quaternion, axis=1) == pytest.approx(1)
    assert len(records) > 20
