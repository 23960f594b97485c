"""How far long work is, where somebody sees it: a notebook or a terminal."""

import sys

_shown = ""


def _is_seen() -> bool:
    if "ipykernel" in sys.modules:
        return True
    return sys.stderr is not None and sys.stderr.isatty()


def show(what: str, done: int, total: int) -> None:
    """Shows how many tenths of this work are done, in place of what was shown before."""
    global _shown
    text = f"{what}: {10 * (10 * min(done, total) // total)} %"
    if text != _shown and _is_seen():
        _shown = text
        sys.stderr.write(f"\r{text}   ")
        sys.stderr.flush()


def end() -> None:
    """Takes away what is shown."""
    global _shown
    if _shown:
        _shown = ""
        sys.stderr.write("\r" + 30 * " " + "\r")
        sys.stderr.flush()
