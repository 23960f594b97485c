"""While the state of a node is "updating" every pose must be invalid, before and after none:
updating.py DBC RECORD."""

import sys

from bus import Table, frames

INVALID, RUNNING, UPDATING = 1 << 13, 1, 7
table = Table(sys.argv[1])
valid, states = [], []
for frame in frames(sys.argv[2]):
    decoded = table.decode(frame)
    if not decoded:
        continue
    name, s = decoded
    if name == "PoseX":
        valid.append(not s["Status"] & INVALID)
    elif name == "NodeStatus":
        states.append((s["State"], len(valid)))
updating = [poses for state, poses in states if state == UPDATING]
if not updating:
    sys.exit('no state was "updating"')
during = valid[updating[0] : updating[-1]]
print(f"{len(valid)} poses, {valid.count(False)} invalid, {len(during)} while its state was updating")
wrong = any(during) or len(during) < 20 or not (valid[0] and valid[-1])
sys.exit(wrong or {state for state, _ in states} != {RUNNING, UPDATING})
