"""A request to identify must have been answered: answer.py DBC RECORD TOKEN SERIAL."""

import struct
import sys

from bus import Table, frames

table = Table(sys.argv[1])
text, outcome = {}, None
for frame in frames(sys.argv[2]):
    if frame.arbitration_id not in (0x1F0, 0x203):
        continue
    name, s = table.decode(frame)
    if name == "Identity":
        text[s["Part"]] = struct.pack("<HI", s["Text12"], s["Text3456"])
    else:
        outcome = (s["Command"], s["Token"], s["Outcome"])
serial = b"".join(text[k] for k in sorted(text)).rstrip(b"\0").decode()
print(serial, outcome)
sys.exit(serial != sys.argv[4] or outcome != (2, int(sys.argv[3]), 0))
