"""After the last sensor frame the pose must be published as invalid within 4 ms."""

import sys

from bus import Table, frames

INVALID, MISSED = 1 << 13, 1 << 17
table = Table(sys.argv[1])
last, after = None, None
for frame in frames(sys.argv[2]):
    name, s = table.decode(frame)
    if name in ("Hall", "Capacitive"):
        last, after = frame.timestamp, None
    elif name == "PoseX" and last and after is None and s["Status"] & INVALID:
        after = (frame.timestamp - last) * 1e3
        status = s["Status"]
print(f"RESULT stale_published_after_ms={after:.2f}")
sys.exit(not (after <= 4.0 and status & MISSED))
