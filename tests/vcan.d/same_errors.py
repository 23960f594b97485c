"""Two reports of eval must show the same rms errors within 20 %: a busy machine sends and receives late."""

import json
import sys

reports = [json.load(open(path))["errors"] for path in sys.argv[1:3]]
worst = 0.0
for axis, unit in (("x", "um"), ("y", "um"), ("rz", "urad")):
    one, other = (report[axis][f"rmse_{unit}"] for report in reports)
    print(axis, one, other)
    worst = max(worst, abs(one - other) / other)
print(f"RESULT import_rms_difference={worst:.4f}")
sys.exit(worst > 0.2)
