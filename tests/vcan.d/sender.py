"""A sensor node in Python: sends the first rows of a log, or prints a request for cansend.

sender.py DBC LOG ROWS | sender.py DBC --identify TOKEN
"""

import sys
import time

import can

from bus import Table, rows

table = Table(sys.argv[1])
if sys.argv[2] == "--identify":
    token = int(sys.argv[3])
    number, data = table.encode("Command", Counter=0, Command=2, Token=token, Argument=3)
    print(f"{number:03X}#{data.hex().upper()}")
    sys.exit()

with can.Bus(interface="socketcan", channel="vcan0") as bus:

    def send(name, **signals):
        number, data = table.encode(name, **signals)
        bus.send(can.Message(arbitration_id=number, data=data, is_extended_id=False))

    for k, row in enumerate(rows(sys.argv[2], int(sys.argv[3]))):
        if k % 16 == 0:
            send("SensorTime", Counter=k // 16 % 16, Sequence=k, Time=2000 * k)
        code = lambda column: int(row[column])
        send("Hall", Counter=k % 16, Missing=0, HallA=code("hall_a_cnt"), HallB=code("hall_b_cnt"), HallC=code("hall_c_cnt"))
        send("Capacitive", Counter=k % 16, Missing=0, Capacitive1=code("cap1_cnt"), Capacitive2=code("cap2_cnt"), Capacitive3=code("cap3_cnt"))
        time.sleep(0.001)
