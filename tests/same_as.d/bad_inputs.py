"""Inputs that host-fit refuses, with exit status 2, 3 or 4."""

import gzip

from cases import IN, Case

FIT = ["--out", "p.bin", "--json", "fit.json"]


def bad_inputs(inputs):
    """Writes the files and names the runs."""
    with gzip.open(inputs / "shipped.csv.gz", "rt", newline="") as file:
        whole = file.read().splitlines()
    header = whole[0]
    thin = [header, *whole[1::20]]
    names = header.split(",")
    stage = (inputs / "shipped.toml").read_text()
    good = (inputs / "shipped-31.bin").read_bytes()

    def text(lines):
        return "\n".join(lines) + "\n"

    def cell(row, column, value):
        lines = list(thin)
        cells = lines[row + 1].split(",")
        cells[names.index(column)] = value
        lines[row + 1] = ",".join(cells)
        return text(lines)

    def movements(keep):
        return text([header, *(line for line in thin[1:] if keep(int(line.split(",")[0])))])

    swapped = [{"hall_a_cnt": "hall_c_cnt", "hall_c_cnt": "hall_a_cnt"}.get(n, n) for n in names]
    blob = f"{IN}/shipped-31.bin"
    packed = gzip.compress(text(thin).encode(), mtime=0)
    logs = {
        "sound": text(thin),
        "semicolons": text(thin).replace(",", ";"),
        "crlf": text(thin).replace("\n", "\r\n"),
        "comments": "# made by hand\n" + text(thin),
        "one row more": text([*thin, "99,0,0,0,0,1,2,3,10,20,30"]),
        "empty": "",
        "header only": header + "\n",
        "binary": bytes([0, 159, 146, 150, 0, 1, 2, 255, 254]) * 50,
        "half of gzip": packed[: len(packed) // 2],
        "gzip without its end": packed[:-4],
        "gzip with rubbish behind": packed + b"rubbish",
        "cut line": text(thin)[:-30],
        "unknown column": text(thin).replace("hall_b_cnt", "hall_bee"),
        "column missing": text([line.rsplit(",", 1)[0] for line in thin]),
        "column twice": text([f"{line},{line.rsplit(',', 1)[1]}" for line in thin]),
        "no number": cell(4, "ifm_x_nm", "abc"),
        "NaN": cell(4, "ifm_x_nm", "NaN"),
        "infinite": cell(4, "ifm_x_nm", "inf"),
        "empty cell": cell(4, "ifm_x_nm", ""),
        "absurd": cell(4, "ifm_x_nm", "1e300"),
        "fraction of a code": cell(4, "hall_a_cnt", "1.5"),
        "saturated": cell(10, "hall_b_cnt", "32767"),
        "gap saturated": cell(20, "cap2_cnt", "-32768"),
        "time backwards": text([*thin[:5], thin[6], thin[5], *thin[7:]]),
        "row twice": text([*thin[:5], thin[4], *thin[5:]]),
        "movement comes back": text([*thin, thin[1]]),
        "nothing moves": text([header, *(f"0,{2000 * k},5,6,7,1,2,3,10,20,30" for k in range(500))]),
        "no height": movements(lambda m: m < 3),
        "no tilt": movements(lambda m: m < 21),
        "only Y": movements(lambda m: m % 3 == 0),
        "dead probe": text([header, *(line.rsplit(",", 1)[0] + ",7" for line in thin[1:])]),
        "swapped probes": text([",".join(swapped), *thin[1:]]),
    }
    for name, content in logs.items():
        data = content.encode() if isinstance(content, str) else content
        file = f"{name.replace(' ', '-')}.csv"
        (inputs / file).write_bytes(data)
        log = [f"{IN}/{file}", "--stage", f"{IN}/shipped.toml"]
        decode = ["decode", blob, *log, "--out", "pose.csv"]
        yield Case(f"log, {name}: fit", ["fit", *log, *FIT])
        yield Case(f"log, {name}: fit, skip", ["fit", *log, *FIT, "--bad-rows", "skip"])
        yield Case(f"log, {name}: fit (30)", ["fit", *log, *FIT, "--model", "30"])
        yield Case(f"log, {name}: eval", ["eval", blob, *log, "--json", "e.json"])
        yield Case(f"log, {name}: decode", decode)

    stages = {
        "negative scale": ("m_per_count = 6.25e-8", "m_per_count = -6.25e-8"),
        "absurd coordinate": ("h1x_m = 0.1975 ", "h1x_m = 1975.0 "),
        "key missing": ("h3y_m = 0.36", ""),
        "no baseline": ("y_baseline_m = 0.10", "y_baseline_m = 0.0"),
        "period is no number": ("period_s = 0.002", "period_s = nan"),
        "reversed range": ("h2x_m = [0.1475, 0.2475]", "h2x_m = [0.2475, 0.1475]"),
        "range without the design": ("h2x_m = [0.1475, 0.2475]", "h2x_m = [0.21, 0.2475]"),
        "unknown section": ("[search]", "[serach]"),
        "unknown key": ("[search]", "[search]\nh9x_m = [0.0, 1.0]"),
        "text for a number": ("h1x_m = 0.1975 ", 'h1x_m = "0.1975" '),
        "whole number": ("m_per_count = 6.25e-8", "m_per_count = 1"),
        "not TOML": ("[search]", "[search"),
        "key twice": ("period_s = 0.002", "period_s = 0.002\nperiod_s = 0.002"),
        "unknown column kept": ("[search]", '[log]\nhall_a = "ADC 1"\n\n[search]'),
        "another unit": ("[search]", '[log]\nifm_x = { column = "ifm_x_nm", unit = "um" }\n\n[search]'),
        "another scale": (
            "[search]",
            '[log]\nifm_x = { column = "ifm_x_nm", scale = -1e-9 }\n\n[search]',
        ),
        "column ignored": ("[search]", '[log]\nignore = ["hall_a_cnt"]\n\n[search]'),
    }
    for name, (old, new) in stages.items():
        if stage.count(old) < 1:
            raise SystemExit(f"the shipped stage file has no `{old}`")
        file = f"{name.replace(' ', '-')}.toml"
        (inputs / file).write_text(stage.replace(old, new, 1))
        log = [f"{IN}/sound.csv", "--stage", f"{IN}/{file}"]
        yield Case(f"stage, {name}: fit", ["fit", *log, *FIT])
        yield Case(f"stage, {name}: eval", ["eval", blob, *log, "--json", "e.json"])
        yield Case(f"stage, {name}: decode", ["decode", blob, *log, "--out", "pose.csv"])

    flipped = bytearray(good)
    flipped[100] ^= 4
    newer = bytearray(good)
    newer[4] = 9
    damaged = {
        "cut": good[:-1],
        "header cut": good[:5],
        "empty": b"",
        "flipped": bytes(flipped),
        "newer": bytes(newer),
        "padded": good + b"\xff" * 16,
        "erased": b"\xff" * len(good),
        "log": header.encode(),
    }
    sound = [f"{IN}/sound.csv", "--stage", f"{IN}/shipped.toml"]
    for name, content in damaged.items():
        file = f"bad-{name.replace(' ', '-')}.bin"
        (inputs / file).write_bytes(content)
        bad = f"{IN}/{file}"
        yield Case(f"blob, {name}: inspect", ["inspect", bad, "--json", "i.json"])
        yield Case(f"blob, {name}: eval", ["eval", bad, *sound])
        yield Case(f"blob, {name}: decode", ["decode", bad, *sound, "--out", "pose.csv"])
        yield Case(f"blob, {name}: export", ["export", bad, "--slot", "0", "--out", "x.hex"])
        yield Case(f"blob, {name}: live", ["live", bad, "--can", "no-such-bus"])

    record = f"{IN}/bus-16.log"
    import_record = ["import", record, f"{IN}/interferometer.csv", *sound[1:], "--out", "x.csv"]
    any_bus = ["--can", "no-such-bus"]
    usage = {
        "nothing": [],
        "unknown command": ["calibrate"],
        "fit of nothing": ["fit"],
        "no stage": ["fit", sound[0], "--out", "p.bin"],
        "unknown model": ["fit", *sound, *FIT, "--model", "13"],
        "unknown solver": ["fit", *sound, *FIT, "--solver", "magic"],
        "no rows": ["fit", *sound, *FIT, "--train", "0"],
        "too many rows": ["fit", *sound, *FIT, "--train", "100000"],
        "negative seed": ["fit", *sound, *FIT, "--seed", "-1"],
        "no threads": ["fit", *sound, *FIT, "--threads", "0"],
        "population of one": ["fit", *sound, *FIT, "--population", "1", "--solver", "shtlbo"],
        "no generations": ["fit", *sound, *FIT, "--generations", "0", "--solver", "shtlbo"],
        "long serial": ["fit", *sound, *FIT, "--serial", "x" * 33],
        "output twice": ["fit", *sound, "--out", "p.bin", "--json", "p.bin"],
        "no such folder": ["fit", *sound, "--out", "no/such/p.bin"],
        "no such log": ["fit", "nowhere.csv", *sound[1:], *FIT],
        "a folder as log": ["fit", ".", *sound[1:], *FIT],
        "the same log twice": ["fit", sound[0], *sound, *FIT],
        "no output": ["decode", blob, *sound],
        "another stage": ["live", blob, *any_bus, "--serial", "other"],
        "no such bus, live": ["live", blob, *any_bus],
        "address not aligned": ["export", blob, "--address", "0x08000001", "--out", "x.hex"],
        "no such slot": ["export", blob, "--slot", "2", "--out", "x.hex"],
        "slot and address": ["export", blob, "--slot", "0", "--address", "0", "--out", "x.hex"],
        "import of a log": ["import", sound[0], f"{IN}/interferometer.csv", *sound[1:], "--out", "x.csv"],
        "import without reference": ["import", record, record, *sound[1:], "--out", "x.csv"],
        "import far off": [*import_record, "--offset-us", "900000000"],
        "import of another bus": [*import_record, "--interface", "can7"],
    }
    for name, arguments in usage.items():
        yield Case(f"usage, {name}", arguments)
