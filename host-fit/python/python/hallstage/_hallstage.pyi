import os
from collections.abc import Sequence

__all__ = ["main_of", "write_demo"]

def main_of(arguments: Sequence[str]) -> int: ...
def write_demo(folder: str | os.PathLike[str]) -> None: ...
