"""A request to identify must have been answered as done: answer.py DBC RECORD TOKEN."""

import sys

from bus import Table, frames

table = Table(sys.argv[1])
decoded = (table.decode(frame) for frame in frames(sys.argv[2]))
answers = [s for name, s in filter(None, decoded) if name == "Answer"]
found = [(s["Command"], s["Token"], s["Outcome"]) for s in answers]
print(found)
sys.exit(found != [(2, int(sys.argv[3]), 0)])
