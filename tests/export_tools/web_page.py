"""The pages of docs/web.md, served to a browser from this machine, and their picture for that guide.

python tests/export_tools/web_page.py HAND.glb NODE_MODULES OUT.png, with tests/ on the path of modules
"""

from __future__ import annotations

import re
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "web.md"
PICTURE_AFTER_MS = 1700


class _Silent(SimpleHTTPRequestHandler):
    def log_message(self, *words: object) -> None:
        """Say nothing."""


def page_under(heading: str) -> str:
    """The HTML page that the guide shows under a heading."""
    found = re.search(rf"## {heading}\n.*?```html\n(.*?)```", GUIDE.read_text("utf-8"), re.DOTALL)
    assert found, heading
    return found.group(1)


@contextmanager
def served(page: str, glb: Path, modules: Path, folder: Path) -> Iterator[str]:
    """Address of a page that has the file and the modules beside it, as the guide says, in that folder."""
    (folder / "index.html").write_text(page, "utf-8")
    (folder / "favicon.ico").touch()  # browsers ask for it
    (folder / "hand.glb").write_bytes(glb.read_bytes())
    (folder / "node_modules").symlink_to(modules.resolve(), target_is_directory=True)
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Silent, directory=str(folder))) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/"
        finally:
            server.shutdown()
            thread.join()


def take_picture(glb: Path, modules: Path, out: Path) -> None:
    """Write what the three.js page shows after a while."""
    from browser import chromium

    with (
        tempfile.TemporaryDirectory() as folder,
        served(page_under("With three.js"), glb, modules, Path(folder)) as address,
        chromium() as browser,
    ):
        page = browser.new_page(viewport={"width": 720, "height": 420})
        page.goto(address)
        page.wait_for_function("document.querySelector('output').textContent")
        page.wait_for_timeout(PICTURE_AFTER_MS)
        page.screenshot(path=out)


if __name__ == "__main__":
    take_picture(*map(Path, sys.argv[1:4]))
