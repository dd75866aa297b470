"""A job that says when it has begun, and waits for the end of its standard input."""

import sys


def main(argv: list[str] | None = None) -> int:
    """Wait; the exit code is 7."""
    del argv
    print("begun", flush=True)
    sys.stdin.read()
    return 7


if __name__ == "__main__":
    sys.exit(main())
