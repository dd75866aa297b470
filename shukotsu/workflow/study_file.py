"""Selection of the study file that a run of the Snakefile uses."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from shukotsu.errors import InputError
from shukotsu.study.config_files import as_yaml_1_1, check_config, read_config, read_yaml, yaml_text
from shukotsu.tables.subjects import path_token
from shukotsu.tables.whole_files import write_text

DEMO = Path("config", "demo.yaml")
"""Study file of a run without --configfile."""


def study_file(files: Sequence[Path], config: Mapping[str, Any], is_module: bool) -> Path:
    """Return the study file: Snakemake's --configfile, or the demo's in the working directory.

    is_module : whether this workflow is a module of another one, whose `config` is then a study. Its file is
    the one of `files` with this content, or else is written to the working directory. Raises InputError if
    there are several files, or if --config would change values, since stages read the file itself.
    """
    if is_module:
        for path in map(Path, files):
            if read_yaml(path, "study") == config:
                return path
        content = json.loads(json.dumps(config))  # plain mappings and lists
        check_config(content, "study", "config")
        path = Path(f"{path_token(content['study'])}.module.yaml")
        if not path.is_file() or read_yaml(path, "study") != content:
            write_text(path, yaml_text(content))
        return path
    if len(files) > 1:
        raise InputError("--configfile: names several files; expected that of one study")
    path = Path(files[0]) if files else DEMO
    if config and dict(config) not in (read_config(path, "study", with_defaults=False), as_yaml_1_1(path)):
        raise InputError(f"--config: a study's settings come from its file only; write them into {path}")
    return path
