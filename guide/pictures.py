"""Command line that draws the guide's pictures: every one, in one language of the guide or in all."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from guide.movement_pictures import movement_picture
from guide.movements import movements
from guide.picture_words import LANGUAGES
from guide.receiver_pictures import receivers_picture, side_picture, which_way_picture
from guide.room_pictures import hemisphere_picture, rigid_pair_picture, room_picture

PICTURES: Mapping[str, Callable[[str], str]] = {
    "receivers": receivers_picture,
    "which-way-round": which_way_picture,
    "receivers-from-the-side": side_picture,
    "room": room_picture,
    "hemisphere": hemisphere_picture,
    "rigid-pair": rigid_pair_picture,
    **{f"movement-{name}": partial(movement_picture, name) for name in movements()},
}
"""Every picture by its name: from a language to the file's text."""


def file_name(name: str, language: str) -> str:
    """Of a picture: English ones have no suffix for their language."""
    return f"{name}.svg" if language == "en" else f"{name}.{language}.svg"


def write_pictures(folder: Path, languages: tuple[str, ...] = LANGUAGES) -> list[Path]:
    """Draw every picture in each of the languages; give the files. The same code gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for language in languages:
        for name, draw in PICTURES.items():
            path = folder / file_name(name, language)
            path.write_text(draw(language), "utf-8", newline="\n")
            written.append(path)
    return written


def main(argv: list[str] | None = None) -> int:
    """Run the command; give its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m guide.pictures", description="Draw the guide's pictures."
    )
    parser.add_argument("folder", type=Path, help="where they are written: docs/pictures for the guide")
    parser.add_argument("--language", choices=LANGUAGES, help="one language alone (default: all)")
    arguments = parser.parse_args(argv)
    languages = (arguments.language,) if arguments.language else LANGUAGES
    try:
        written = write_pictures(arguments.folder, languages)
    except OSError as error:
        print(f"{error.filename}: cannot be written ({error.strerror})", file=sys.stderr)
        return 2
    print(f"{len(written)} pictures in {arguments.folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
