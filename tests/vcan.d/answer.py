"""A request to identify must have been answered as done: answer.py DBC RECORD TOKEN."""

import sys

from bus import Table, frames

ANSWER = 0x1F0
table = Table(sys.argv[1])
answers = [table.decode(frame)[1] for frame in frames(sys.argv[2]) if frame.arbitration_id == ANSWER]
found = [(s["Command"], s["Token"], s["Outcome"]) for s in answers]
print(found)
sys.exit(found != [(2, int(sys.argv[3]), 0)])
