"""The pages of docs/web.md, served to a browser from this machine."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "web.md"


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
