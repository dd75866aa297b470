"""Run the guide's notebook on the results in a folder, print its output and save its picture.

After `make demo` and `make site`:

.venv/bin/python tests/report_samples/run_notebook.py . notebook.png
"""

import base64
import sys
from pathlib import Path

import nbclient
import nbformat

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "notebooks" / "which-joint-moves-most.ipynb"


def main(folder: str, picture: str) -> None:
    """Run every cell in a folder; a failing cell ends the script with its traceback."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    resources = {"metadata": {"path": folder}}
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()
    for output in (output for cell in notebook.cells for output in cell.get("outputs", [])):
        print(output.get("text") or output.get("data", {}).get("text/plain", ""))
        if drawn := output.get("data", {}).get("image/png"):
            Path(picture).write_bytes(base64.b64decode(drawn))


if __name__ == "__main__":
    main(*sys.argv[1:])
