"""A job that prints when it begins and waits for the end of its standard input."""

import sys


def main(argv: list[str] | None = None) -> int:
    """Wait for the end of standard input and return exit code 7."""
    del argv
    print("begun", flush=True)
    sys.stdin.read()
    return 7


if __name__ == "__main__":
    sys.exit(main())
