"""python-canopen over python-can, a foreign master, meets our emulated drives through `masseter can serve`.

Boots a drive, reads and writes its objects, remaps a PDO, and takes the drive through the CiA 402 state machine. Moves its
axis in profile position and in cyclic synchronous position. Transfers data in blocks, both ways.

usage: drive_a_drive.py MASSETER
"""

import queue
import socket
import struct
import subprocess
import sys
import tempfile
import time

import canopen
import canopen.profiles.p402

AXIS, NODE, BUS = "d1", 1, "can0"
MOVE_INCREMENTS = 2000


def check(what, holds):
    if not holds:
        sys.exit(f"foreign master: {what}: does not hold")
    print(f"ok  {what}")


def wait_for(what, holds, seconds=10.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            print(f"ok  {what}")
            return
        time.sleep(0.01)
    sys.exit(f"foreign master: {what}: not within {seconds} s")


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def connect(port):
    network = canopen.Network()
    network.connect(interface="socketcand", host="127.0.0.1", port=port, channel=BUS)
    return network


def enable(node):
    """Through the state machine, one transition at a time, as CiA 402 has them."""
    for controlword, mask, expected, name in [
        (0x06, 0x6F, 0x21, "ready to switch on"),
        (0x07, 0x6F, 0x23, "switched on"),
        (0x0F, 0x6F, 0x27, "operation enabled"),
    ]:
        node.sdo[0x6040].raw = controlword
        wait_for(name, lambda: node.sdo[0x6041].raw & mask == expected)


def profile_position(node):
    node.sdo[0x6060].raw = 1
    start = node.sdo[0x6064].raw
    node.sdo[0x6081].raw = 50_000
    enable(node)
    node.sdo[0x607A].raw = start + MOVE_INCREMENTS
    node.sdo[0x6040].raw = 0x1F  # new set-point
    wait_for("set-point acknowledged", lambda: node.sdo[0x6041].raw & 1 << 12)
    node.sdo[0x6040].raw = 0x0F
    wait_for("target reached", lambda: node.sdo[0x6041].raw & 1 << 10)
    moved = node.sdo[0x6064].raw - start
    check(f"profile position moved the axis by {moved} increments", abs(moved - MOVE_INCREMENTS) < 20)
    node.sdo[0x6040].raw = 0x00
    wait_for("switched off", lambda: node.sdo[0x6041].raw & 0x4F == 0x40)


def remap(node):
    """TPDO1 carries statusword and velocity instead, by CiA 301's procedure."""
    node.tpdo.read()
    tpdo = node.tpdo[1]
    tpdo.clear()
    tpdo.add_variable(0x6041)
    tpdo.add_variable(0x606C)
    tpdo.trans_type = 1
    tpdo.enabled = True
    node.nmt.state = "PRE-OPERATIONAL"
    tpdo.save()
    check("the map reads back as written", [node.sdo[0x1A00][i].raw for i in (1, 2)] == [0x60410010, 0x606C0020])
    node.nmt.state = "OPERATIONAL"
    received = []
    tpdo.add_callback(lambda pdo: received.append(bytes(pdo.data)))
    node.network.sync.transmit()
    wait_for("the remapped TPDO answers the next SYNC", lambda: received)
    check("it carries statusword and velocity", len(received[0]) == 6)


def cyclic_position(node):
    node.nmt.state = "PRE-OPERATIONAL"
    node.sdo[0x6060].raw = 8
    node.sdo[0x607A].raw = node.sdo[0x6064].raw
    enable(node)
    node.nmt.state = "OPERATIONAL"
    start = node.sdo[0x6064].raw
    for step in range(1, 101):
        target = struct.pack("<Hi", 0x0F, start + step * MOVE_INCREMENTS // 100)
        node.network.send_message(0x200 + NODE, target)
        node.network.sync.transmit()
        time.sleep(0.002)

    def has_arrived():
        # SYNC wins arbitration against a target queued before it, so that the last one may need one more.
        node.network.sync.transmit()
        return abs(node.sdo[0x6064].raw - start - MOVE_INCREMENTS) < 20

    wait_for("cyclic synchronous position moved the axis as well", has_arrived)


def refused(node):
    for index, subindex, value, code in [(0x1000, 0, 1, 0x06010002), (0x5555, 0, 1, 0x06020000)]:
        try:
            node.sdo.download(index, subindex, struct.pack("<I", value))
        except canopen.SdoAbortedError as abort:
            check(f"{index:04X}h aborts with {code:08X}h", abort.code == code)
        else:
            sys.exit(f"foreign master: writing {index:04X}h was not refused")


def blocks(node):
    """SDO block transfer with CRC: a text, a number, and more than one block of segments each way."""
    with node.sdo.open(0x1008, 0, "rb", block_transfer=True) as name:
        text = name.read()
    # The transfer ends with the block: no other one may begin within.
    check("a text by block transfer", text == node.sdo[0x1008].raw.encode())
    data = bytes(place * 37 % 251 for place in range(1024))
    with node.sdo.open(0x2010, 0, "wb", size=len(data), block_transfer=True) as user_data:
        user_data.write(data)
    with node.sdo.open(0x2010, 0, "rb", block_transfer=True) as user_data:
        back = user_data.read()
    check("1024 bytes come back by block transfer", back == data)
    check("and in segments", node.sdo.upload(0x2010, 0) == data)
    with node.sdo.open(0x6081, 0, "wb", size=4, block_transfer=True) as velocity:
        velocity.write(struct.pack("<I", 50_000))
    check("a number by block transfer", node.sdo[0x6081].raw == 50_000)
    try:
        with node.sdo.open(0x2010, 0, "wb", size=1025, block_transfer=True) as user_data:
            user_data.write(bytes(1025))
    except canopen.SdoAbortedError as abort:
        check("too much for a block transfer aborts", abort.code == 0x06070012)
    else:
        sys.exit("foreign master: 1025 bytes were not refused")
    check("which changes nothing", node.sdo.upload(0x2010, 0) == data)


def session(masseter, port, sheet):
    network = connect(port)
    network.scanner.search(limit=10)
    wait_for("the scanner finds the drives of the bus", lambda: len(network.scanner.nodes) == 3)
    node = network.add_node(NODE, sheet)
    # Before the command: `wait_for_bootup` misses a message that comes before the wait.
    states = queue.SimpleQueue()
    node.nmt.add_heartbeat_callback(states.put)
    node.nmt.state = "RESET"
    while states.get(timeout=10) != 0:
        pass
    print("ok  booted")
    check("device type 402", node.sdo[0x1000].raw & 0xFFFF == 402)
    name = node.sdo[0x1008].raw
    check(f"device name by segmented transfer: {name}", len(name) > 4)
    node.sdo[0x1017].raw = 50
    node.nmt.wait_for_heartbeat(1)
    check("heartbeat time reads back", node.sdo[0x1017].raw == 50)
    refused(node)
    blocks(node)
    profile_position(node)
    remap(node)
    cyclic_position(node)
    network.disconnect()


def main():
    masseter = sys.argv[1]
    port = free_port()
    server = subprocess.Popen([masseter, "can", "serve", "--listen", f"127.0.0.1:{port}"])
    try:
        with tempfile.NamedTemporaryFile("w", suffix=".eds") as sheet:
            sheet.write(subprocess.run([masseter, "can", "eds", "--axis", AXIS], check=True, text=True,
                                       capture_output=True).stdout)
            sheet.flush()
            session(masseter, port, sheet.name)
    finally:
        server.terminate()
        code = server.wait(10)
    check("the server ends in order", code == 0)


if __name__ == "__main__":
    main()
