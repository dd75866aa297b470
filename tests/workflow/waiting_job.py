"""A job that says when it has begun, and waits for the end of its standard input."""

import sys


def main(argv: list[str]) -> int:
    """Wait; the exit code is the number in argv, 0 without."""
    print("begun", flush=True)
    sys.stdin.read()
    return int(argv[0]) if argv else 0
