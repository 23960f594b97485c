"""Two candump logs must hold the same frames of each identifier, in the same order.
What ends the log of candump, 7FF, is in none."""

import sys

from bus import frames


def by_id(path):
    found = {}
    for frame in frames(path):
        if frame.arbitration_id == 0x7FF:
            continue
        found.setdefault(frame.arbitration_id, []).append(bytes(frame.data))
    return found


one, other = by_id(sys.argv[1]), by_id(sys.argv[2])
print({f"{k:03X}": len(v) for k, v in one.items()})
print({f"{k:03X}": len(v) for k, v in other.items()})
sys.exit(one != other)
