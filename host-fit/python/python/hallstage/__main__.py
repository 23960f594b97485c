"""The program `host-fit`."""

import signal
import sys

from ._hallstage import main_of


def main() -> int:
    """Runs the command line that this process was started with; gives its exit status."""
    # The program handles Ctrl-C itself: it keeps the best so far.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return main_of(["host-fit", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
