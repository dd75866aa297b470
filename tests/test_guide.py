"""The guide's examples are correct: valid files, working links, existing commands and options.

tests/studies/test_guide_runs.py runs the commands.
"""

import contextlib
import io
import re
import runpy
import shlex
import sys
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from babel.messages.pofile import read_po
from guide_pages import NAMES, PAGES, REPOSITORY, Block, anchors, blocks, commands, links, pictures, prose

from shukotsu.study.config_files import json_schema
from shukotsu.study.layout import read_layout
from shukotsu.study.model import read_model

SHELL = [block for page in PAGES for block in blocks(page, "sh", "bash", "shell", "console")]
YAML = [block for page in PAGES for block in blocks(page, "yaml")]
TAGS = ("br", "details", "div", "figure", "figcaption", "p", "span", "style", "sub", "summary", "sup")
"""HTML tags that a page may use."""
RUN_LANGUAGES = ("sh", "bash", "shell", "console", "python", "sql")
KINDS = ("study", "layout", "model", "mapping")


def first_yaml(page: str) -> str:
    return blocks(REPOSITORY / "docs" / page, "yaml")[0].text


def test_the_example_layout_is_valid(tmp_path: Path) -> None:
    (tmp_path / "finger.yaml").write_text(first_yaml("layouts.md"))
    layout = read_layout(tmp_path / "finger.yaml")
    assert [joint.name for joint in layout.solvable] == ["index_mcp", "index_pip", "wrist"]


def test_the_example_model_is_valid(tmp_path: Path) -> None:
    (tmp_path / "half-twist.yaml").write_text(first_yaml("choose-a-model.md"))
    assert read_model(tmp_path / "half-twist.yaml").metacarpals.twist_factor == 0.5


def schema_of(keys: set[str]) -> dict[str, Any]:
    """Return the schema of the kind of file that a block with the given keys is, or is part of."""
    fitting = [schema for kind in KINDS if keys <= (schema := json_schema(kind))["properties"].keys()]
    whole = [schema for schema in fitting if set(schema["required"]) <= keys]
    assert fitting, f"no file of the program has the keys {', '.join(sorted(keys))}"
    return (whole or [schema | {"required": []} for schema in fitting])[0]


@pytest.mark.parametrize("block", YAML, ids=str)
def test_a_file_in_the_guide_is_valid(block: Block) -> None:
    content = yaml.safe_load(block.text)
    jsonschema.validate(content, schema_of(set(content)))


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_have_existing_targets(page: Path) -> None:
    for file, anchor in links(page):
        target = (page.parent / file).resolve() if file else page
        assert target.exists(), file
        assert not anchor or anchor in anchors(target), f"{file}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_pictures_have_alternative_texts(page: Path) -> None:
    assert [
        file for text, file in pictures(page) if len(text.split()) < 3 and not page.stem.endswith(".ja")
    ] == []
    assert [file for text, file in pictures(page) if len(text) < 8] == []


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_pages_contain_no_accidental_html(page: Path) -> None:
    """Browsers would not show text in angle brackets outside of code."""
    tags = re.findall(r"<(/?([a-zA-Z]+)[^>\n]*)>", prose(page))
    assert [tag for tag, name in tags if name not in TAGS] == []


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_project_files_named_in_the_guide_exist(page: Path) -> None:
    rooms = "schemas|stages|workflow|shukotsu|docs|benchmarks|config|tests|container|profiles"
    named = re.findall(rf"`((?:{rooms})/[\w./-]+)`", page.read_text("utf-8"))
    named = [path for path in named if not re.search("NAME|TABLE|CODE", path)]
    assert sorted(path for path in named if not (REPOSITORY / path.rstrip(".")).exists()) == []


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_a_block_that_is_not_run_has_a_reason(page: Path) -> None:
    """Marks without a reason, or not followed by a block, are mistakes."""
    marked = [block for block in blocks(page, *RUN_LANGUAGES) if block.not_run]
    assert len(re.findall(r"^\s*<!-- not run", page.read_text("utf-8"), re.MULTILINE)) == len(marked)


PROGRAM = re.compile(
    r"^(?:\S*/)?(?:(shukotsu)|python -m ((?:stages|benchmarks|schemas|workflow|shukotsu)\S*))\s*"
)
WITH_SUBCOMMANDS = ("shukotsu", "benchmarks")
PLACES = {"COMMAND", "NAME", "..."}
"""Placeholders in commands."""


def argv_of(line: str) -> tuple[str, ...] | None:
    """Return the module and arguments of a line that runs this project, or None for other lines."""
    match = PROGRAM.match(line.strip().removeprefix("$ "))
    if match is None:
        return None
    rest = re.split(r"[|;>#&)]", line.strip().removeprefix("$ ")[match.end() :])[0]
    return (match[1] or match[2], *shlex.split(rest))


def inline_commands(page: Path) -> list[str]:
    return re.findall(r"`([^`\n]+)`", page.read_text("utf-8"))


LINES = [line for block in SHELL for line in commands(block)]
LINES += [line for page in PAGES if page.name != "CHANGELOG.md" for line in inline_commands(page)]
COMMANDS = sorted({argv for line in LINES if (argv := argv_of(line)) and not PLACES & set(argv)})


@cache
def help_of(*command: str) -> str:
    """Return a command's `--help`, run in this process so that large packages are imported once."""
    module, *arguments = command
    printed = io.StringIO()
    with pytest.MonkeyPatch.context() as patched, contextlib.redirect_stdout(printed):
        patched.setattr(sys, "argv", [module, *arguments, "--help"])
        with pytest.raises(SystemExit) as ended:
            runpy.run_module(module, run_name="__main__")
    assert ended.value.code == 0
    return printed.getvalue()


def subcommand(module: str, arguments: list[str]) -> list[str]:
    """Return the arguments that select a parser: a command, and the stage of `shukotsu stage`."""
    named = module in WITH_SUBCOMMANDS and arguments and re.fullmatch(r"[a-z_-]+", arguments[0])
    if not named or arguments[0].startswith("-"):
        return []
    deeper = (module, arguments[0]) == ("shukotsu", "stage")
    return arguments[: 2 if deeper else 1]


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_commands_of_the_guide_exist_with_their_options(command: tuple[str, ...]) -> None:
    module, *arguments = command
    printed = help_of(module, *subcommand(module, arguments))
    before = arguments[: arguments.index("--")] if "--" in arguments else arguments
    options = [argument.partition("=")[0] for argument in before if argument.startswith("--")]
    assert [option for option in options if not re.search(rf"(?<![\w-]){option}(?![\w-])", printed)] == []


CATALOGUE = read_po(io.BytesIO((REPOSITORY / "shukotsu/report/languages/ja.po").read_bytes()))
HEADINGS = {
    (page.name, words)
    for page in PAGES
    for words in re.findall(r"(?<!!\[)“([^”]+)”", re.sub(r"!\[[^\]]*\]", "", prose(page)))
    if page.name != "CHANGELOG.md"
}


@pytest.mark.parametrize(("page", "words"), sorted(HEADINGS))
def test_words_quoted_in_the_guide_are_in_the_report(page: str, words: str) -> None:
    """They are headings or buttons; the Japanese guide quotes the words of the Japanese pages."""
    message = CATALOGUE.get(words)
    assert message is not None, f"the report nowhere says “{words}”"
    twin = REPOSITORY / "docs" / page.replace(".md", ".ja.md")
    assert not twin.exists() or f"「{message.string}」" in twin.read_text("utf-8")
