"""Hands whose motion is known, as the tables of a study, and a real browser to look at them.

The browser is Chromium, driven over its debugging pipe (JSON messages ended by a zero byte). That needs
nothing but the browser: no driver program, no package, no port that another program could use.
"""

from __future__ import annotations

import base64
import fcntl
import itertools
import json
import os
import select
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schemas.catalogue import BONE_POSES, JOINT_CENTRES, POSED_TIPS, POSES, RECEIVERS, TIPS
from schemas.layout import read_layout
from schemas.model import read_model
from schemas.results import Results
from schemas.study import Hand, Recording
from schemas.tables import Provenance, Table, columns_from_rows, read_table, rows_of, write_table
from stages.report.viewer.motion import HandMotion, read_motion
from stages.simulate.anatomy import BONES, DIGITS
from stages.simulate.realism import Realism
from stages.simulate.simulation import Simulated, simulate
from stages.simulate.truth import write_truth

LAYOUT = read_layout("liberty16")
MODELS = ("paper-fig4", "whole-hand")
UNSEEN = slice(50, 60)
"""Frames in which the index finger's distal receiver is not valid and its middle bone has no pose."""


@dataclass(frozen=True)
class KnownHand:
    """A recording with its truth, its tables below `paths` under each of MODELS."""

    paths: Results
    recording: Recording
    made: Simulated

    def motion(self, *models: str) -> HandMotion:
        """The recording's motion under those models."""
        return read_motion(self.paths, self.recording, LAYOUT, [read_model(name) for name in models])


def make_hand(folder: Path, hand: str, n_frames: int) -> KnownHand:
    """Write an exact recording of opposition, as seen through receivers that never slip, and its tables."""
    made = simulate("01", hand, "opposition", 7, Realism.exact(), n_frames)
    who, paths = Hand("01", hand), Results(folder)
    recording = Recording(
        who, "opposition", "", "both", folder / "x", "x", folder / "x", "csv", None, "+x", ""
    )
    _write(paths.poses(recording), POSES, _pose_columns(made))
    write_truth(folder / "truth", made.truth, made.written(), Provenance())
    for model in MODELS:
        for table in (JOINT_CENTRES, TIPS):
            rows = list(rows_of(read_table(folder / "truth" / f"{table.name}.parquet", table)))
            rows = [{**row, "model": model, **({"sd_mm": 1.5} if "sd_mm" in row else {})} for row in rows]
            _write(paths.hand_table(model, who, table.name), table, columns_from_rows(table, rows))
    key = {"subject": "01", "hand": hand, "trial": "", "model": "whole-hand"}
    worn = [
        {"subject": "01", "hand": hand, "model": "whole-hand", "segment": f"{digit}_distal"}
        | {"bone_tip_sd_mm": 2.5, "loose_task": "", "status": "ok", "message": ""}
        for digit in DIGITS
    ]
    for table, rows in (
        (RECEIVERS, worn),
        (BONE_POSES, [*_elsewhere(_bone_rows(made, key)), *_bone_rows(made, key)]),
        (POSED_TIPS, [*_elsewhere(_tip_rows(made, key)), *_tip_rows(made, key)]),
    ):
        _write(paths.hand_table("whole-hand", who, table.name), table, columns_from_rows(table, rows))
    return KnownHand(paths, recording, made)


def _write(path: Path, table: Table, columns: dict[str, Any]) -> None:
    segments = columns.get("segment", [])
    rows = len(columns["frame"]) // len(set(segments)) if table is POSES else 1 << 17
    write_table(path, table, columns, Provenance(), row_group_rows=rows)


def _pose_columns(made: Simulated) -> dict[str, Any]:
    n, count = len(made.frame), len(made.segments)
    valid = np.ones((count, n), bool)
    valid[made.segments.index("index_distal"), UNSEEN] = False
    numbers = np.concatenate([made.position_mm, made.quaternion], -1).swapaxes(0, 1).reshape(n * count, 7)
    names = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
    return {
        "segment": np.repeat(made.segments, n).tolist(),
        "frame": np.tile(made.frame, count),
        "time_s": np.tile(made.time_s, count),
        **dict(zip(names, numbers.T, strict=True)),
        "valid": valid.ravel(),
        "flags": [""] * (n * count),
    }


def _bone_rows(made: Simulated, key: dict[str, str]) -> list[dict[str, Any]]:
    rows = []
    for bone, segment in enumerate(BONES):
        for i, frame in enumerate(made.frame):
            known = not (segment == "index_middle" and UNSEEN.start <= i < UNSEEN.stop)
            place = made.truth.bone_position_mm[i, bone] if known else [None] * 3
            row = {**key, "task": "opposition", "segment": segment, "frame": int(frame)}
            rows.append(row | dict(zip(("x_mm", "y_mm", "z_mm"), place, strict=True)))
    return rows


def _tip_rows(made: Simulated, key: dict[str, str]) -> list[dict[str, Any]]:
    rows = []
    for d, digit in enumerate(DIGITS):
        for i, frame in enumerate(made.frame):
            row = {**key, "task": "opposition", "digit": digit, "frame": int(frame), "error_mm": d + i / 100}
            place = zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), made.truth.tip_mm[i, d], strict=True)
            rows.append(row | dict(place))
    return rows


def _elsewhere(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The same of another task, a metre off: a reader that does not look at the task goes wrong."""
    return [
        {k: v + 1000.0 if k.endswith("_mm") and v is not None else v for k, v in row.items()}
        | {"task": "rom"}
        for row in rows
    ]


@pytest.fixture(scope="session", params=["right", "left"])
def known(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    """A short recording of either hand."""
    return make_hand(tmp_path_factory.mktemp("known"), request.param, 120)


@pytest.fixture(scope="session")
def right(tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    """A short recording of a right hand."""
    return make_hand(tmp_path_factory.mktemp("right"), "right", 120)


@pytest.fixture(scope="session")
def make_known(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], KnownHand]:
    """Make a short recording of the right or the left hand."""
    return lambda hand: make_hand(tmp_path_factory.mktemp(hand), hand, 120)


@pytest.fixture(scope="session")
def long_hand(tmp_path_factory: pytest.TempPathFactory) -> KnownHand:
    """A recording as long as the paper's."""
    return make_hand(tmp_path_factory.mktemp("long"), "right", 3774)


NAMES = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = (
    "--headless=new",
    "--remote-debugging-pipe",
    "--use-angle=swiftshader",  # drawn by the processor: as slow as it gets, and the same everywhere
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-extensions",
    "--disable-background-networking",
    "--hide-scrollbars",
)


class Browser:
    """One page of a headless Chromium; what it wrote to the console and what it asked for is kept."""

    def __init__(self, program: str, profile: Path) -> None:
        to_browser, self._write = os.pipe()
        self._read, from_browser = os.pipe()
        ends = [fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in (to_browser, from_browser)]
        root = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium refuses its sandbox to root
        self._process = subprocess.Popen(
            [program, *OPTIONS, *root, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=lambda: [os.dup2(end, place) for end, place in zip(ends, (3, 4), strict=True)],
            pass_fds=(3, 4),
        )
        for end in (to_browser, from_browser, *ends):
            os.close(end)
        self._numbers, self._rest, self._session = itertools.count(1), b"", ""
        self.console: list[str] = []
        self.requests: list[str] = []
        target = next(t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page")
        found = self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = found["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Do one thing and give its result; what the browser says meanwhile is noted."""
        number = next(self._numbers)
        message: dict[str, Any] = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message(60.0)
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                result: dict[str, Any] = answer["result"]
                return result

    def _message(self, seconds: float) -> dict[str, Any]:
        end = time.monotonic() + seconds
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._read], [], [], max(0.0, end - time.monotonic()))
            assert ready, f"the browser said nothing for {seconds:g} s"
            piece = os.read(self._read, 1 << 20)
            assert piece, "the browser ended"
            self._rest += piece
        text, _, self._rest = self._rest.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        self._note(message)
        return message

    def _note(self, message: dict[str, Any]) -> None:
        what, details = message.get("method"), message.get("params", {})
        if what == "Runtime.exceptionThrown":
            self.console.append(str(details["exceptionDetails"]))
        elif what == "Runtime.consoleAPICalled" and details["type"] in ("error", "warning", "assert"):
            self.console.append(str(details["args"]))
        elif what == "Log.entryAdded" and details["entry"]["level"] in ("error", "warning"):
            self.console.append(details["entry"]["text"])
        elif what == "Network.requestWillBeSent":
            self.requests.append(details["request"]["url"])

    def window(self, width: int, height: int, *, dark: bool = False) -> None:
        """Set the page's size in CSS pixels, and the reader's taste."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=False,
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, page: Path) -> None:
        """Load a page and wait until its viewer is there."""
        self.call("Page.navigate", url=page.as_uri())
        ready = "document.readyState === 'complete' && document.querySelector('[data-hand-viewer]')?.viewer"
        self.wait(f"!!({ready})")

    def wait(self, condition: str, seconds: float = 30.0) -> None:
        """Wait until a JavaScript expression is true."""
        end = time.monotonic() + seconds
        while not self.value(condition):
            assert time.monotonic() < end, f"never true: {condition}; console: {self.console}"
            time.sleep(0.05)

    def value(self, expression: str) -> Any:
        """Value of a JavaScript expression, a promise's once it is kept."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def press(self, key: str, text: str = "", modifiers: int = 0) -> None:
        """Press and release one key."""
        code = {"text": text} if text else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, modifiers=modifiers, **code)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, modifiers=modifiers)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag the mouse with its left button down."""
        points = [("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)]
        for kind, (x, y) in points:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def picture(self) -> bytes:
        """The page as it is seen, PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        """End the browser."""
        self._session = ""
        try:
            self.call("Browser.close")
            self._process.wait(20)
        finally:
            self._process.kill()
            self._process.wait()
            os.close(self._read)
            os.close(self._write)


@pytest.fixture(scope="session")
def start_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[], Browser]]:
    """Start a browser, which ends with the tests; they are skipped where there is none."""
    program = next((found for name in NAMES if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is on the path")
    started: list[Browser] = []

    def start() -> Browser:
        started.append(Browser(program, tmp_path_factory.mktemp("profile")))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.fixture(scope="session")
def browser(start_browser: Callable[[], Browser]) -> Browser:
    """One browser for all tests; each test opens its page anew."""
    return start_browser()
