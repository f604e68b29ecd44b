"""What a process keeps of the memory that it has freed."""

import subprocess
import sys

# Blocks that are freed, but for the last one: it lies at the heap's top, where the others came from the heap.
BLOCKS = """
import sys
from aerialdojo_gen.base import memory
if sys.argv[1] == "set up":
    memory.set_up()
del_first = bytearray(20 << 20)
del del_first
blocks = [bytearray(b"x" * (12 << 20)) for _ in range(20)]
last = blocks[-1]
del blocks
print([line.split()[1] for line in open("/proc/self/status") if line.startswith("VmRSS")][0])
"""


def test_freed_blocks_go_back_to_the_system_though_one_above_them_is_kept():
    held_mb = {
        how: int(subprocess.run([sys.executable, "-c", BLOCKS, how], capture_output=True, check=True).stdout) / 1024
        for how in ("set up", "not set up")
    }
    assert held_mb["set up"] < 60
    assert held_mb["not set up"] > 150
