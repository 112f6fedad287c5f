"""Machines that do not exist: a folder of files and a seam that answers as told."""

from __future__ import annotations

import errno
import os
import struct
from pathlib import Path

CPUS = "sys/devices/system/cpu"
CLOCKS = "sys/devices/system/clocksource/clocksource0"
CAPABILITIES = 1 << 13 | 1 << 14 | 1 << 23
MASTER = "/usr/local/bin/fsn-master"


class FakeSeam:
    """Answers of commands by their first word, of drivers by request code, of attributes."""

    def __init__(self):
        self.commands = {"ip": "[]"}
        self.driver = {}
        self.granted = CAPABILITIES
        self.asked = []

    def command(self, *words):
        self.asked.append(words)
        return self.commands.get(words[0])

    def ethtool(self, interface, request):
        (code,) = struct.unpack_from("=I", request)
        if code not in self.driver:
            raise OSError(errno.EOPNOTSUPP, "Operation not supported")
        answer = bytearray(request)
        for word, value in self.driver[code].items():
            struct.pack_into("=I", answer, 4 * word, value)
        return bytes(answer)

    def attribute(self, path, name):
        if self.granted is None:
            raise OSError(errno.ENODATA, "No data available")
        return struct.pack("<5I", 0x02000001, self.granted, 0, 0, 0)


class MadeUp:
    """A machine in a folder; the one of `good` unless changed."""

    def __init__(self, folder: Path) -> None:
        self.root = folder
        self.seam = FakeSeam()

    def write(self, files: dict[str, str]) -> None:
        for name, text in files.items():
            path = self.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n", encoding="utf-8")

    def remove(self, *names: str) -> None:
        import shutil

        for name in names:
            path = self.root / name
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()

    def link(self, name: str, target: str) -> None:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        os.symlink(target, path)

    def process(self, pid: int, comm: str, *, policy: int = 0, priority: int = 0) -> None:
        fields = ["S", *["0"] * 36, str(priority), str(policy), "0"]
        stat = f"{pid} ({comm}) {' '.join(fields)}"
        self.write(
            {
                f"proc/{pid}/comm": comm,
                f"proc/{pid}/stat": stat,
                f"proc/{pid}/task/{pid}/stat": stat,
                f"proc/{pid}/status": status(user=1000, effective=CAPABILITIES),
            }
        )


def status(*, user=1000, effective=0, ambient=0, no_new=0):
    return (
        f"Name:\tx\nUid:\t{user}\t{user}\t{user}\t{user}\nCapEff:\t{effective:016x}\n"
        f"CapAmb:\t{ambient:016x}\nNoNewPrivs:\t{no_new}\nCpus_allowed_list:\t0-3"
    )


def good(folder: Path) -> MadeUp:
    """Return a machine on which nothing is to be fixed, with eth1 for the bus."""
    host = MadeUp(folder)
    host.write(
        {
            "proc/version": "Linux version 6.12.1-rt1 (x) #1 SMP PREEMPT_RT",
            "sys/kernel/realtime": "1",
            "boot/config-6.12.1-rt1": "CONFIG_PREEMPT_RT=y\n# CONFIG_RT_GROUP_SCHED is not set",
            "proc/cmdline": "root=/dev/sda isolcpus=managed_irq,domain,3 rcu_nocbs=3",
            "proc/sys/kernel/sched_rt_runtime_us": "-1",
            "proc/sys/kernel/sched_rt_period_us": "1000000",
            f"{CLOCKS}/current_clocksource": "tsc",
            f"{CPUS}/online": "0-3",
            f"{CPUS}/isolated": "3",
            f"{CPUS}/smt/active": "0",
            f"{CPUS}/cpuidle/current_driver": "intel_idle",
            "proc/self/status": status(),
            "proc/self/limits": "Limit Soft Hard Units\n"
            "Max locked memory         unlimited unlimited bytes\n"
            "Max realtime priority     99 99",
            "proc/self/mountinfo": "1 1 0:1 / / rw - ext4 /dev/sda rw",
            "proc/cpuinfo": "".join(f"processor : {n}\nflags : fpu tsc\n" for n in range(4)),
            "proc/stat": "cpu  100 0 100 1000 0 0 0 0 0 0\ncpu0 1",
            "proc/swaps": "Filename Type Size Used Priority",
            "proc/net/dev": "Inter-|\n face |\n    lo: 0\n  eth1: 0",
            "proc/net/packet": "sk RefCnt Type Proto  Iface R Rmem   User   Inode",
            "proc/interrupts": " CPU0 CPU1\n 40: 0 7 PCI-MSI eth1\n 41: 0 7 PCI-MSI eth10",
            "proc/irq/40/smp_affinity_list": "3",
        }
    )
    for n in range(4):
        host.write(
            {
                f"{CPUS}/cpu{n}/cpufreq/scaling_governor": "performance",
                f"{CPUS}/cpu{n}/cpuidle/state0/name": "POLL",
                f"{CPUS}/cpu{n}/cpuidle/state0/latency": "0",
                f"{CPUS}/cpu{n}/cpuidle/state0/disable": "0",
                f"{CPUS}/cpu{n}/cpuidle/state1/name": "C6",
                f"{CPUS}/cpu{n}/cpuidle/state1/latency": "133",
                f"{CPUS}/cpu{n}/cpuidle/state1/disable": "1",
            }
        )
    eth = "sys/class/net/eth1"
    host.write(
        {
            f"{eth}/type": "1",
            f"{eth}/flags": "0x1003",
            f"{eth}/carrier": "1",
            f"{eth}/speed": "100",
            f"{eth}/duplex": "full",
            f"{eth}/mtu": "1500",
            f"{eth}/ifindex": "3",
            f"{eth}/device/irq": "40",
            f"{eth}/statistics/rx_errors": "0",
        }
    )
    host.link(f"{eth}/device/driver", "../../bus/pci/drivers/igb")
    host.seam.driver = {0x0E: {}, 0x2B: {}, 0x25: {}, 0x44: {}}
    host.process(1, "systemd")
    host.process(90, "irq/40-eth1", policy=1, priority=85)
    return host
