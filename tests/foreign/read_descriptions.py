"""python-canopen reads the drives' electronic data sheets, cantools the link's DBC file and decodes with it.

Usage: read_descriptions.py MASSETER [RUN_FOLDER]: the executable, and a run folder whose candump logs are
decoded frame by frame.
"""

import io
import subprocess
import sys
from pathlib import Path

import canopen
import cantools

AXES = ["d1", "d2", "d3", "l1", "l2", "l3"]
PDO_LENGTHS = {"RPDO1": 6, "TPDO1": 8}


def written(*arguments):
    return subprocess.run([sys.argv[1], "can", *arguments], check=True, capture_output=True, text=True).stdout


def check_sheet(axis, node):
    sheet = io.StringIO(written("eds", "--axis", axis))
    sheet.name = f"{axis}.eds"
    dictionary = canopen.import_od(sheet, node_id=node)
    assert dictionary[0x1018][1].default == 0x004D5354, "vendor"
    assert dictionary[0x1000].default & 0xFFFF == 402, "device type"
    assert dictionary[0x1014].default == 0x80 + node, "EMCY follows the node id"
    assert dictionary[0x1400][1].default == 0x200 + node, "RPDO1 follows the node id"
    assert dictionary[0x1008].default == "Masseter emulated drive"
    assert dictionary["Controlword"].pdo_mappable and dictionary["Statusword"].access_type == "ro"
    limits = dictionary[0x607D]
    assert limits[1].default < limits[2].default, "software limits are the axis' strokes"
    # Mapping parameters name objects of the same sheet, with their lengths.
    for index in (0x1600, 0x1A00):
        record = dictionary[index]
        for place in range(1, record[0].default + 1):
            entry = record[place].default
            assert len(dictionary[entry >> 16]) == entry & 0xFF, f"{index:04X}h:{place}"
    return len(dictionary)


def check_messages(text):
    database = cantools.database.load_string(text, "dbc", strict=True)
    for axis in AXES:
        for pdo, length in PDO_LENGTHS.items():
            assert database.get_message_by_name(f"{axis}_{pdo}").length == length
    tpdo = database.get_message_by_name("l1_TPDO1")
    values = tpdo.decode(bytes.fromhex("3712301F0400F4FF"))
    assert values["Statusword"] == 0x1237
    assert abs(values["Position_actual_value"] - 0.270128) < 1e-9, values
    assert abs(values["Torque_actual_value"] + 6.0) < 1e-9, values
    assert str(database.get_message_by_name("l1_heartbeat").decode(b"\x05")["State"]) == "operational"
    return database


def decode_log(database, path):
    """Every frame of a candump log has a message of its length; returns every position of l1, m."""
    positions = []
    for line in path.read_text().splitlines():
        identifier, data = line.split()[2].split("#")
        message = database.get_message_by_frame_id(int(identifier, 16))
        data = bytes.fromhex(data)
        assert message.length == len(data), line
        values = message.decode(data) if data else {}
        if message.name == "l1_TPDO1":
            positions.append(values["Position_actual_value"])
    return positions


def main():
    entries = [check_sheet(axis, node) for node, axis in enumerate(AXES, start=1)]
    database = check_messages(written("dbc"))
    print(f"python-canopen: {len(entries)} sheets of {entries[0]} objects; cantools: {len(database.messages)} messages")
    if len(sys.argv) > 2:
        logs = sorted(Path(sys.argv[2]).glob("can*.log"))
        assert logs, "the run left no candump log"
        positions = [position for log in logs for position in decode_log(database, log)]
        assert positions and max(positions) - min(positions) > 1e-3, "l1 moved"
        print(f"decoded {len(logs)} logs; l1 between {min(positions):.4f} m and {max(positions):.4f} m")


if __name__ == "__main__":
    main()
