"""What a record lacks at its end must be younger than a second when its program is killed:
kept.py DBC CANDUMP RECORD.

The last pose that candump saw is as good as the moment of the kill. A busy machine may have
halted live before that for as long as no pose came.
"""

import sys

from bus import Table, frames

table = Table(sys.argv[1])
seen, poses = [], []
for frame in frames(sys.argv[2]):
    decoded = table.decode(frame)
    if decoded:
        seen.append((frame.arbitration_id, bytes(frame.data)))
        if decoded[0] == "PoseX":
            poses.append(frame.timestamp)
kept = list(frames(sys.argv[3]))
halt = max(later - sooner for sooner, later in zip(poses, poses[1:]))
lost = poses[-1] - kept[-1].timestamp
print(f"{len(kept)} of {len(seen)} frames, the last {lost:.3f} s before the kill; no pose for {halt:.3f} s at most")
lacks = set((frame.arbitration_id, bytes(frame.data)) for frame in kept) - set(seen)
sys.exit(bool(lacks) or lost > 1.0 + halt)
