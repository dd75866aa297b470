"""Command line: draw the data flow from the rules of the demo study into docs/architecture.md (Mermaid)."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

from shukotsu.tables.text_files import replaced_between
from shukotsu.tables.whole_files import write_text

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
DEMO = ROOT / "config" / "demo.yaml"
START, END = "<!-- diagram: start -->", "<!-- diagram: end -->"
TARGET = "all"

_NODE = re.compile(r"^(\d+) \[.*?label=<(.*?)</table>>\]$", re.MULTILINE | re.DOTALL)
_EDGE = re.compile(r"^\s*(\d+) -> (\d+)$", re.MULTILINE)
_RULE = re.compile(r'<b><font point-size="18">(.*?)</font></b>')
_FILE = re.compile(r'<font face="monospace">(.*?)</font>')
_OUTPUT = "output &rarr;"


@dataclass(frozen=True)
class RuleGraph:
    """Rules of a workflow with the names of the files that each writes; edges : from writer to reader."""

    outputs: Mapping[str, Sequence[str]]
    edges: Sequence[tuple[str, str]]


def read_filegraph(dot: str) -> RuleGraph:
    """Read what `snakemake --filegraph` prints; the rule `all` is left out."""
    rules: dict[str, str] = {}
    outputs: dict[str, list[str]] = {}
    for number, label in _NODE.findall(dot):
        rule = rules[number] = _RULE.findall(label)[0]
        names = [file_name(html.unescape(file)) for file in _FILE.findall(label.partition(_OUTPUT)[2])]
        outputs[rule] = list(dict.fromkeys(names))
    del outputs[TARGET]
    read_by: dict[str, set[str]] = {rule: set() for rule in outputs}
    for writer, reader in _EDGE.findall(dot):
        if rules[reader] != TARGET:
            read_by[rules[writer]].add(rules[reader])
    return RuleGraph(outputs, direct_edges(read_by))


def direct_edges(read_by: Mapping[str, Set[str]]) -> list[tuple[str, str]]:
    """Edges without those that a longer way implies (the transitive reduction), sorted."""

    def after(rule: str) -> set[str]:
        return {later for reader in read_by[rule] for later in (reader, *after(reader))}

    return [
        (writer, reader)
        for writer, readers in sorted(read_by.items())
        for reader in sorted(readers)
        if not any(reader in after(other) for other in readers)
    ]


def file_name(path: str) -> str:
    """A table by its name, a file by its last part, a folder with the one above; wildcards by capitals."""
    plain = re.sub(r"\{(\w)[^{}]*\}", lambda wildcard: wildcard[1].upper(), path)
    *_, folder, name = plain.split("/")
    if folder.endswith("_truth"):
        return "truth"
    if "." not in name:
        return f"{folder}/{name}"
    return name if name.startswith("sub-") else name.removesuffix(".parquet")


def mermaid(graph: RuleGraph) -> str:
    """The graph as a Mermaid flowchart, a rule a node with the files that it writes."""
    lines = ["flowchart TB"]
    for rule, files in sorted(graph.outputs.items()):
        lines.append(f'    {rule}["<b>{rule}</b><br/>{"<br/>".join(_by_stem(files))}"]')
    lines += [f"    {writer} --> {reader}" for writer, reader in graph.edges]
    return "\n".join(lines)


def _by_stem(files: Sequence[str]) -> list[str]:
    """Files that differ in their endings alone as one."""
    endings: dict[str, list[str]] = {}
    for file in files:
        stem, _, ending = file.partition(".")
        endings.setdefault(stem, []).append(ending)
    return [
        f"{stem} ({', '.join(parts)})" if len(parts) > 1 else stem + f".{parts[0]}" * bool(parts[0])
        for stem, parts in endings.items()
    ]


def demo_filegraph() -> str:
    """Return Snakemake's graph of the rules of the demo study with exports, planned in an empty folder."""
    with tempfile.TemporaryDirectory() as folder:
        sheets = shutil.ignore_patterns("recordings")
        shutil.copytree(ROOT / "data" / "demo", Path(folder, "data", "demo"), ignore=sheets)
        study = Path(folder, "config", "demo.yaml")
        study.parent.mkdir()
        study.write_text(f"{DEMO.read_text('utf-8')}\nexports: [bvh, bids]\n", "utf-8")
        command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--forceall"]
        command += ["--directory", folder, "--configfile", str(study), "--cores", "1", "--filegraph"]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder)
    return done.stdout


def page_with_diagram(page: str) -> str:
    """The page with today's diagram between its marks."""
    diagram = mermaid(read_filegraph(demo_filegraph()))
    return replaced_between(page, START, END, f"```mermaid\n{diagram}\n```")


def main() -> int:
    """Write the diagram into the page."""
    write_text(PAGE, page_with_diagram(PAGE.read_text("utf-8")))
    return 0


if __name__ == "__main__":
    sys.exit(main())
