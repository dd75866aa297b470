"""The setup done by make, without installing anything."""

import os
import re
from pathlib import Path

from program_files import REPOSITORY, printed_by


def test_uv_is_pinned_by_hash_and_uses_pips_settings(tmp_path: Path) -> None:
    assert re.match(
        r"uv==[\d.]+ \\\n( +--hash=sha256:\w{64}( \\)?\n)+\Z",
        (REPOSITORY / "requirements-uv.lock").read_text(),
    )
    python = tmp_path / "python"
    python.write_text(
        "#!/bin/sh\ncat <<'END'\n"
        ":env:.index-url='https://mine.invalid/a'\n"
        "global.index-url='https://theirs.invalid/a'\n"
        "global.extra-index-url='\\nfile:///b\\nfile:///c'\n"
        "END\n"
    )
    python.chmod(0o755)
    script = f"include {REPOSITORY}/Makefile\nshown:\n\t@$(pip_settings); env | grep ^UV_ | sort\n"
    words = ("make", "-f", "-", f"python={python}", "shown")
    shown = printed_by(*words, input=script, env={"PATH": os.environ["PATH"]})
    assert shown.split("\n")[:3] == [
        "UV_DEFAULT_INDEX=https://mine.invalid/a",
        "UV_INDEX= file:///b file:///c",
        "UV_INDEX_STRATEGY=unsafe-best-match",
    ]
