"""The start of the command ``sledenv``: an interrupt while Python loads the package is told in one line too."""

import sys


def main() -> int:
    """Run the command and return its exit status."""
    try:
        from sledenv.command.cli import main as run

        return run()
    except KeyboardInterrupt:
        print("sledenv: interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
