"""Which study a run is of."""

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
"""Study of a run that names none."""


def study_file(files: Sequence[Path], config: Mapping[str, Any], is_module: bool) -> Path:
    """The file that describes the study: Snakemake's --configfile, or the demo's in this folder.

    is_module : of a module of another workflow, whose keys are a study: that of one of the files, or written
    to a file of this folder. Raises InputError where there are several files, or where --config would change
    what the file says, which the stages read.
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
        raise InputError("--configfile: names several files; a run is of one study")
    path = Path(files[0]) if files else DEMO
    if config and dict(config) not in (read_config(path, "study", with_defaults=False), as_yaml_1_1(path)):
        raise InputError(f"--config: a study is described by its file alone; write it into {path}")
    return path
