"""Dependencies point one way, names say what they hold; the checks themselves find what is planted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from architecture import (
    BELOW,
    cycles,
    empty_names,
    imports,
    modules,
    repeated_names,
    snakefile_rooms,
    stages_in_stages,
    wrong_rooms,
)

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize(
    ("check", "of", "advice"),
    [
        (wrong_rooms, imports, "Move what is needed to a room below:"),
        (stages_in_stages, imports, "Move what both stages need to a room below:"),
        (cycles, imports, "Move what both modules need to a third:"),
        (repeated_names, modules, "Say in the name what the module holds, or add to REPEATED_NAMES:"),
        (empty_names, modules, "Say in the name what the module holds:"),
    ],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_the_project_keeps_its_rules(check: Any, of: Any, advice: str) -> None:
    offenders = check(of(REPOSITORY))
    assert not offenders, "\n".join([advice, *offenders])


def test_the_snakefile_imports_what_it_may() -> None:
    assert snakefile_rooms((REPOSITORY / "Snakefile").read_text("utf-8")) == []


def tree(root: Path, files: dict[str, str]) -> Path:
    """Write modules below a root, every package with its `__init__`."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
        for folder in path.parents:
            if folder == root:
                break
            (folder / "__init__.py").touch()
    return root


@pytest.mark.parametrize(
    ("room", "text"),
    [
        ("schemas", "import skeleton.rotations"),
        ("trackers", "def read():\n    from stages.capture import samples"),
        ("skeleton", "class A:\n    def read(self):\n        import trackers.archive"),
        ("stages", "try:\n    from workflow import wiring\nexcept ImportError:\n    pass"),
        ("workflow", "from benchmarks import processes"),
    ],
)
def test_an_import_against_the_arrow_is_found(tmp_path: Path, room: str, text: str) -> None:
    targets = ("skeleton/rotations", "stages/capture/samples", "trackers/archive", "workflow/wiring")
    files = {f"{name}.py": "" for name in (*targets, "benchmarks/processes")}
    offenders = wrong_rooms(imports(tree(tmp_path, files | {f"{room}/planted.py": text})))
    assert len(offenders) == 1
    assert offenders[0].startswith(f"{room}.planted:")


def test_imports_along_the_arrow_are_right(tmp_path: Path) -> None:
    files = {f"{room}/{room}_module.py": "" for room in BELOW}
    for room, below in BELOW.items():
        files[f"{room}/other.py"] = "".join(f"from {one} import {one}_module\n" for one in (*below, room))
    assert wrong_rooms(imports(tree(tmp_path, files))) == []


def test_a_stage_in_a_stage_is_found_also_inside_a_function(tmp_path: Path) -> None:
    files = {
        "stages/command_line.py": "",
        "stages/solve/closed.py": "from stages import command_line\nfrom stages.solve import parts",
        "stages/solve/parts.py": "from . import closed\nfrom ..fit import chain",
        "stages/fit/chain.py": "def fit():\n    if True:\n        from stages.solve.closed import x",
        "stages/fit/lazy.py": "read = import_module('stages.solve.parts')\nat = 'stages.solve.closed:solve'",
    }
    found = imports(tree(tmp_path, files))
    assert [one.partition(":")[0] for one in stages_in_stages(found)] == [
        "stages.fit.chain",
        "stages.fit.lazy",
        "stages.fit.lazy",
        "stages.solve.parts",
    ]


def test_a_circle_is_found_and_one_that_is_for_types_is_none(tmp_path: Path) -> None:
    for_types = "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from schemas import a\n"
    files = {
        "schemas/a.py": "from schemas import b",
        "schemas/b.py": "import schemas.c",
        "schemas/c.py": "from schemas.a import x",
        "schemas/d.py": f"{for_types}else:\n    from schemas import e",
        "schemas/e.py": "def later():\n    from schemas import d",
    }
    (circle,) = cycles(imports(tree(tmp_path, files)))
    assert sorted(circle.split(" imports ")[1:]) == ["schemas.a", "schemas.b", "schemas.c"]
    assert "schemas.a imports schemas.b" in circle


def test_names_that_repeat_or_say_nothing_are_found(tmp_path: Path) -> None:
    names = ("stages/a/reading.py", "stages/b/reading.py", "schemas/utils.py", "schemas/common/x.py")
    files = dict.fromkeys((*names, "stages/a/__main__.py", "stages/b/__main__.py"), "")
    found = modules(tree(tmp_path, files))
    assert repeated_names(found) == ["reading: stages.a.reading, stages.b.reading"]
    assert empty_names(found) == ["schemas.common", "schemas.utils"]


def test_a_stage_in_the_snakefile_is_found() -> None:
    assert snakefile_rooms("from workflow.wiring import W\nimport stages.gather\nrule a:\n    input: 1") == [
        "stages"
    ]
