"""Records of a bus that carries the sensor frames of a log, as `candump -L` writes them.

Written from the tables of stage.dbc and protocol.md, not by the code under test.
"""

import csv
import gzip
import re

ROWS = 4000


def crc8(data):
    """CRC-8 with polynomial 0x2F, start and final XOR 0xFF (AUTOSAR E2E Profile 2)."""
    crc = 0xFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x2F if crc & 0x80 else 0)) & 0xFF
    return crc ^ 0xFF


def candump(root, inputs):
    """Writes bus-16.log and bus-24.log, and interferometer.csv beside them."""
    dbc = (root / "hal-adapters/stage.dbc").read_text()
    base = bytes.fromhex(re.search(r'BA_ "E2EDataIdBaseList" "(\w+)"', dbc)[1])
    keys = {int(i): int(key) for i, key in re.findall(r'BA_ "E2EDataIdKey" BO_ (\d+) (\d+)', dbc)}

    def line(time_us, identifier, counter, payload):
        """`payload` holds bits 12 to 63."""
        data = (payload << 12 | counter << 8).to_bytes(8, "little")
        check = crc8(data[1:] + bytes([base[counter] ^ keys[identifier]]))
        text = (bytes([check]) + data[1:]).hex().upper()
        return f"({time_us // 1_000_000}.{time_us % 1_000_000:06}) can0 {identifier:03X}#{text}\n"

    def codes(row, names, bits):
        mask = (1 << bits) - 1
        packed = sum((int(row[name]) & mask) << k * bits for k, name in enumerate(names))
        return packed << 4

    hall = ["hall_a_cnt", "hall_b_cnt", "hall_c_cnt"]
    gaps = ["cap1_cnt", "cap2_cnt", "cap3_cnt"]
    layouts = {
        16: {0x100: hall, 0x10F: gaps},
        24: {0x133: hall[:2], 0x13C: [hall[2], gaps[0]], 0x155: gaps[1:]},
    }
    with gzip.open(inputs / "shipped.csv.gz", "rt", newline="") as file:
        rows = [row for _, row in zip(range(ROWS), csv.DictReader(file))]
    for bits, frames in layouts.items():
        with open(inputs / f"bus-{bits}.log", "w", encoding="ascii") as record:
            for k, row in enumerate(rows):
                start = 2_000 * k
                if k % 16 == 0:
                    # Number and time of the tick that follows.
                    payload = k | start << 20
                    record.write(line(start, 0x15A, k // 16 % 16, payload))
                for place, (identifier, names) in enumerate(frames.items()):
                    payload = codes(row, names, bits)
                    record.write(line(start + 150 * (place + 1), identifier, k % 16, payload))
    columns = ["movement", "t_us", "ifm_x_nm", "ifm_y1_nm", "ifm_y2_nm"]
    with open(inputs / "interferometer.csv", "w", newline="", encoding="ascii") as file:
        writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
