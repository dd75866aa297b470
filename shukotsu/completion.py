"""Command line: print what makes a shell complete `shukotsu`: commands, stages, options; else files."""

from __future__ import annotations

import argparse
import importlib
import io
import re
import shlex
from contextlib import redirect_stdout, suppress

from shukotsu.commands import COMMANDS
from shukotsu.run_stage import stages
from stages import command_line

SHELLS = ("bash", "zsh", "fish")

BASH = """_shukotsu() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} command=${{COMP_WORDS[1]-}} words=
    if [ "$COMP_CWORD" -eq 1 ]; then
        words={commands}
    elif [ "$COMP_CWORD" -eq 2 ] && [ "$command" = stage ]; then
        words={stages}
    elif [[ $word == -* ]]; then
        [ "$command" = stage ] && command="stage ${{COMP_WORDS[2]}}"
        case $command in
{cases}
        esac
    fi
    COMPREPLY=()
    [ -z "$words" ] || COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _shukotsu shukotsu
"""
ZSH = "autoload -Uz compinit bashcompinit && compinit && bashcompinit\n"


def build_parser() -> argparse.ArgumentParser:
    """Give the command's argument parser."""
    parser = command_line.parser(
        "shukotsu completion",
        "Print what makes a shell complete commands, stages and options. For good: put the example into "
        "~/.bashrc; fish: `shukotsu completion fish > ~/.config/fish/completions/shukotsu.fish`.",
        'eval "$(shukotsu completion bash)"',
        records_failure=False,
    )
    parser.add_argument("shell", choices=SHELLS)
    return parser


def options() -> dict[str, list[str]]:
    """Give the long options of every command, and of every stage as `stage NAME`, from its --help."""
    of = {name: _options(c.module, [*c.before]) for name, c in COMMANDS.items() if name != "stage"}
    return of | {f"stage {name}": _options(module, []) for name, module in stages().items()}


def _options(module: str, before: list[str]) -> list[str]:
    shown = io.StringIO()
    with redirect_stdout(shown), suppress(SystemExit):
        importlib.import_module(module).main([*before, "--help"])
    return sorted(set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", shown.getvalue().partition("example:")[0])))


def completion(arguments: argparse.Namespace) -> None:
    """Print the shell's lines."""
    if arguments.shell == "fish":
        print("\n".join(_fish()))
        return
    cases = "\n".join(
        f"            {shlex.quote(command)}) words={shlex.quote(' '.join(own))} ;;"
        for command, own in options().items()
    )
    commands, names = shlex.quote(" ".join(COMMANDS)), shlex.quote(" ".join(stages()))
    text = BASH.format(commands=commands, stages=names, cases=cases)
    print(ZSH + text if arguments.shell == "zsh" else text, end="")


def _fish() -> list[str]:
    lines = [
        f"complete -c shukotsu -f -n __fish_use_subcommand -a {name} -d {shlex.quote(command.summary)}"
        for name, command in COMMANDS.items()
    ]
    lines.append(f"complete -c shukotsu -f -n '__fish_seen_subcommand_from stage' -a '{' '.join(stages())}'")
    for command, own in options().items():
        seen = f"'__fish_seen_subcommand_from {command.removeprefix('stage ')}'"
        lines += [f"complete -c shukotsu -n {seen} -l {option[2:]}" for option in own]
    return lines


def main(argv: list[str]) -> int:
    """Print the completion; give the exit code."""
    return command_line.run(build_parser().parse_args(argv), completion)
