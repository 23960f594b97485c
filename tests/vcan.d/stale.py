"""After the last sensor frame of each of so many runs the pose must be published as invalid, in the
shortest case within 4 ms: stale.py DBC RECORD RUNS."""

import sys

from bus import Table, frames

INVALID, MISSED = 1 << 13, 1 << 17
table = Table(sys.argv[1])
last, after, delays = None, None, []


def end_of_run():
    assert after is not None, f"nothing was published after {last}"
    delays.append(after)


for frame in frames(sys.argv[2]):
    name, s = table.decode(frame)
    if name == "SensorTime" and s["Sequence"] == 0 and last:
        end_of_run()
    if name in ("Hall", "Capacitive"):
        last, after = frame.timestamp, None
    elif name == "PoseX" and last and after is None and s["Status"] & INVALID and s["Status"] & MISSED:
        after = (frame.timestamp - last) * 1e3
end_of_run()
print(f"RESULT stale_published_after_ms={min(delays):.2f}")
print(*(f"{delay:.2f}" for delay in sorted(delays)), "ms")
sys.exit(len(delays) < int(sys.argv[3]) or not 2.0 <= min(delays) <= 4.0)
