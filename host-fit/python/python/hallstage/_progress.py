"""How far long work is, where somebody sees it: a notebook or a terminal."""

import sys

_shown = False


def _is_seen() -> bool:
    if "ipykernel" in sys.modules:
        return True
    return sys.stderr is not None and sys.stderr.isatty()


def show(what: str, done: int, total: int) -> None:
    """Shows that `done` of `total` steps of this are done, in place of what was shown before."""
    global _shown
    if _is_seen():
        _shown = True
        sys.stderr.write(f"\r{what}: {100 * min(done, total) // total} %   ")
        sys.stderr.flush()


def end() -> None:
    """Takes away what is shown."""
    global _shown
    if _shown:
        _shown = False
        sys.stderr.write("\r" + 30 * " " + "\r")
        sys.stderr.flush()
