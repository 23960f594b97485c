"""Compares the frames of a candump log with the log that was played and decode's poses.

Every row of the log must have come, in order, once; every pose must have the bits of the
pose file.
"""

import argparse
import re
import sys

from bus import Table, frames, rows, word

parser = argparse.ArgumentParser()
parser.add_argument("dbc")
parser.add_argument("record")
parser.add_argument("--log", required=True)
parser.add_argument("--pose", required=True)
parser.add_argument("--rows", type=int)
parser.add_argument("--live")
parser.add_argument("--times", type=float)
args = parser.parse_args()

table = Table(args.dbc)
got, arrived = {}, []
for frame in frames(args.record):
    decoded = table.decode(frame)
    if decoded:
        name, signals = decoded
        got.setdefault(name, []).append(signals)
        if name == "Hall":
            arrived.append(frame.timestamp)

HALL = {"HallA": "hall_a_cnt", "HallB": "hall_b_cnt", "HallC": "hall_c_cnt"}
GAPS = {f"Capacitive{k}": f"cap{k}_cnt" for k in (1, 2, 3)}
POSE = {"PoseX": ("X", "x_um"), "PoseY": ("Y", "y_um"), "PoseRz": ("Rz", "rz_urad")}
VERTICAL = {"PoseZ": ("Z", "z_um"), "PoseRx": ("Rx", "rx_urad"), "PoseRy": ("Ry", "ry_urad")}

sent = list(rows(args.log, args.rows))
poses = list(rows(args.pose, len(sent)))
wrong = 0


def expect(what, have, want):
    global wrong
    if have != want:
        wrong += 1
        if wrong <= 10:
            print(f"{what}: {have} instead of {want}")


for name, columns in (("Hall", HALL), ("Capacitive", GAPS)):
    expect(f"frames of {name}", len(got.get(name, [])), len(sent))
    for k, (frame, row) in enumerate(zip(got.get(name, []), sent)):
        for signal, column in columns.items():
            expect(f"row {k} {signal}", frame[signal], int(row[column]))
        expect(f"row {k} Missing", frame["Missing"], 0)

words = 0
for name, (signal, column) in POSE.items():
    expect(f"frames of {name}", len(got.get(name, [])), len(poses))
    for k, (frame, row) in enumerate(zip(got.get(name, []), poses)):
        expect(f"row {k} {signal}", word(frame[signal]), word(float(row[column]) * 1e-6))
        expect(f"row {k} status of {signal}", frame["Status"], int(row["status"]))
        words += 1
for turn, (name, (signal, column)) in enumerate(VERTICAL.items()):
    due = poses[turn * 4 // 3 :: 4]
    expect(f"frames of {name}", len(got.get(name, [])), len(due))
    for k, (frame, row) in enumerate(zip(got.get(name, []), due)):
        expect(f"turn {k} {signal}", word(frame[signal]), word(float(row[column]) * 1e-6))
        words += 1

count = sum(len(frames) for frames in got.values())
if args.times:
    times = 0.002 * len(sent) / (arrived[-1] - arrived[0])
    last = open(args.live).read().strip().splitlines()[-1]
    lost = re.search(r"lost (\d+),", last)[1]
    dropped = re.search(r"dropped (\d+),", last)[1]
    print(
        f"RESULT live_times_real_time={times:.1f} frames={count} lost={lost} dropped={dropped} "
        f"words={words} differing_words={wrong}"
    )
    print(last)
    if times < args.times:
        expect("times real time", times, f"at least {args.times}")
    for nothing in ("missed 0,", "dropped 0,", "not sent 0;", "lost 0,", "incomplete ticks 0,"):
        expect(nothing, nothing in last, True)
else:
    print(f"{count} frames, {words} words of pose, {wrong} differ")
sys.exit(wrong != 0)
