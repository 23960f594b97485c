"""A JSON file must hold these values: tells.py FILE PLACE=JSON..., a place as a.b.c."""

import functools
import json
import sys

report = json.load(open(sys.argv[1]))
wrong = 0
for argument in sys.argv[2:]:
    place, _, text = argument.partition("=")
    found = functools.reduce(lambda part, key: (part or {}).get(key), place.split("."), report)
    print(place, json.dumps(found))
    wrong += found != json.loads(text)
sys.exit(wrong > 0)
