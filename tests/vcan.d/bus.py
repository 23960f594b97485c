"""What the other scripts share: the .dbc, Profile 2 by an independent package, logs."""

import csv
import struct

import can
import cantools
import e2e.p02


class Table:
    """The messages of the .dbc, coded by cantools, protected by autosar-e2e."""

    def __init__(self, path):
        self.dbc = cantools.database.load_file(path)
        base = bytes.fromhex(self.dbc.dbc.attributes["E2EDataIdBaseList"].value)
        self.ids = {}
        for message in self.dbc.messages:
            key = message.dbc.attributes["E2EDataIdKey"].value
            self.ids[message.name] = bytes(b ^ key for b in base)

    def encode(self, name, **signals):
        message = self.dbc.get_message_by_name(name)
        data = bytearray(message.encode({"Check": 0, **signals}))
        e2e.p02.e2e_p02_protect(data, self.ids[name], increment_counter=False)
        return message.frame_id, bytes(data)

    def decode(self, frame):
        """Name and signals of a frame, or None for a foreign one; the check must hold."""
        try:
            message = self.dbc.get_message_by_frame_id(frame.arbitration_id)
        except KeyError:
            return None
        data = bytes(frame.data)
        assert e2e.p02.e2e_p02_check(data, self.ids[message.name]), f"{message.name}: check fails"
        return message.name, message.decode(data, decode_choices=False)


def frames(path):
    """The frames of a candump log."""
    return can.CanutilsLogReader(path)


def rows(path, count=None):
    """The rows of a CSV file as dictionaries."""
    with open(path, newline="") as file:
        for k, row in enumerate(csv.DictReader(file)):
            if count is not None and k == count:
                return
            yield row


def word(value):
    """The bits of a value as a 32-bit float."""
    return struct.pack("<f", value)
