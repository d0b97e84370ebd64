"""The command ``runtime``, in a module of its own, which nothing of a user's can hide."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; packages that are hidden are reported in one sentence.

    Nothing is imported outside of it, since Ctrl-C would be a traceback there.
    """
    try:
        import spikeblocks  # noqa: F401 -- reports a hidden package
        from runtime.cli import main as run
    except ImportError as error:
        if "hides the package" not in str(error):
            raise
        print(error, file=sys.stderr)
        sys.exit(2)
    except MemoryError:  # a limit on memory, as of a container
        print("there is not enough memory to start", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:  # while Python still imports; runtime.cli handles all later ones
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
