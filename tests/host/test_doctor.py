"""The host checks on machines that do not exist: what is found, and what would fix it."""

import json
from pathlib import Path

import pytest
from cli.tool import fsn
from host.made_up import CAPABILITIES, CLOCKS, CPUS, MASTER, good, status

from fsoe_net.host.doctor import examine
from fsoe_net.host.finding import MachineLevel
from fsoe_net.host.seam import Host, Unreadable

ROOT = Path(__file__).parents[2]
EVERY_WARNING = (MachineLevel.WARNING, MachineLevel.BAD)


def look(made, interface="eth1", program=MASTER):
    return examine(Host(made.root, made.seam), interface=interface, program=program)


def found(made, name, **more):
    (finding,) = [f for f in look(made, **more).findings if f.name == name]
    return finding


def test_a_good_host_has_nothing_to_mend(tmp_path):
    seen = look(good(tmp_path))
    assert [
        (f.name, f.level, f.text) for f in seen.findings if f.level is not MachineLevel.GOOD
    ] == []
    assert seen.healthy
    assert (seen.release, seen.cpus) == ("6.12.1-rt1", 4)
    assert all(f.why and not f.now and not f.keep for f in seen.findings)


FAULTS = [
    # what is changed, which check finds it, level, part of the text, part of what fixes it
    (
        {"proc/version": "Linux version 6.1.0-9 (x) #1 SMP PREEMPT_DYNAMIC",
         "sys/kernel/realtime": "0", "boot/config-6.1.0-9": "CONFIG_PREEMPT_VOLUNTARY=y"},
        ("kernel.preemption", "warning", "voluntary", "preempt=full"),
    ),
    (
        {"proc/version": "Linux version 6.1.0-9 (x) #1 SMP PREEMPT_DYNAMIC",
         "sys/kernel/realtime": "0", "boot/config-6.1.0-9": "#",
         "sys/kernel/debug/sched/preempt": "none voluntary (full)"},
        ("kernel.preemption", "note", "full", "linux-image-rt"),
    ),
    (
        {"proc/version": "Linux version 6.1.0-9 (x) #1 SMP PREEMPT_DYNAMIC",
         "sys/kernel/realtime": "0", "boot/config-6.1.0-9": "#",
         "proc/cmdline": "preempt=none rcu_nocbs=3"},
        ("kernel.preemption", "warning", "none", "debug/sched/preempt"),
    ),
    (
        {"proc/version": "Linux version 6.1.0-9 (x) #1 SMP", "sys/kernel/realtime": "0",
         "boot/config-6.1.0-9": "#"},
        ("kernel.preemption", "warning", "none or voluntary", "linux-image-rt"),
    ),
    (
        {"proc/sys/kernel/sched_rt_runtime_us": "950000"},
        ("kernel.rt_throttling", "note", "95 % of 1 s", "sched_rt_runtime_us=-1"),
    ),
    (
        {"proc/sys/kernel/sched_rt_runtime_us": "300000"},
        ("kernel.rt_throttling", "warning", "700 ms", "sysctl"),
    ),
    (
        {"proc/sys/kernel/sched_rt_runtime_us": "0"},
        ("kernel.rt_throttling", "bad", "no real-time thread", "sysctl"),
    ),
    (
        {"boot/config-6.12.1-rt1": "CONFIG_RT_GROUP_SCHED=y"},
        ("kernel.rt_group_sched", "warning", "EPERM", "rt_group_sched=0"),
    ),
    (
        {f"{CLOCKS}/current_clocksource": "hpet", f"{CLOCKS}/available_clocksource": "tsc hpet"},
        ("kernel.clocksource", "warning", "hpet", "echo tsc >"),
    ),
    (
        {f"{CLOCKS}/current_clocksource": "kvm-clock"},
        ("kernel.clocksource", "note", "hypervisor", ""),
    ),
    (
        {f"{CPUS}/isolated": "", "proc/cmdline": "quiet"},
        ("cpu.isolation", "note", "none of the 4 CPUs", "isolcpus=managed_irq,domain,3"),
    ),
    (
        {"proc/cmdline": "isolcpus=3"},
        ("cpu.isolation", "note", "RCU", "rcu_nocbs=3"),
    ),
    (
        {f"{CPUS}/isolated": "2-3", "proc/cmdline": "rcu_nocbs=2-3",
         "proc/self/status": status().replace("0-3", "0-1")},
        ("cpu.isolation", "note", "CPU 0-1 only: started from here, fsn-master --cpu 2 may be",
         "taskset -c 2 fsn-master"),
    ),
    ({f"{CPUS}/online": "0"}, ("cpu.isolation", "warning", "one CPU", "")),
    (
        {f"{CPUS}/cpu1/cpufreq/scaling_governor": "powersave",
         f"{CPUS}/cpu2/cpufreq/scaling_governor": "powersave"},
        ("cpu.frequency", "warning", "CPU 1-2: powersave", "echo performance"),
    ),
    (
        {f"{CPUS}/cpu2/cpuidle/state1/disable": "0"},
        ("cpu.idle", "warning", "C6, 133 us", "max_cstate=1"),
    ),
    (
        {f"{CPUS}/cpu2/cpuidle/state1/disable": "0", f"{CPUS}/cpu2/cpuidle/state1/latency": "50"},
        ("cpu.idle", "note", "C6, 50 us", "disable"),
    ),
    (
        {f"{CPUS}/smt/active": "1", f"{CPUS}/cpu3/topology/thread_siblings_list": "1,3"},
        ("cpu.smt", "warning", "CPU 1 shares", "cpu1/online"),
    ),
    (
        {"proc/self/status": status(no_new=1)},
        ("master.capabilities", "bad", "NoNewPrivileges", "AmbientCapabilities=CAP_NET_RAW"),
    ),
    (
        {"proc/self/mountinfo": "1 1 0:1 / / rw - a b rw\n2 1 0:2 / /usr/local rw,nosuid - a b rw"},
        ("master.capabilities", "bad", "/usr/local is mounted nosuid", "AmbientCapabilities"),
    ),
    (
        {"proc/cpuinfo": "processor : 0\nflags : fpu hypervisor",
         "sys/class/dmi/id/sys_vendor": "QEMU"},
        ("machine.virtual", "warning", "QEMU", "real hardware"),
    ),
    ({"proc/stat": "cpu 1000 0 0 90000 0 0 0 9"}, ("machine.steal", "warning", "0.01 %", "pin")),
    ({"proc/stat": "cpu 1000 0 0 90000 0 0 0 900"}, ("machine.steal", "bad", "0.98 %", "pin")),
    ({".dockerenv": ""}, ("machine.container", "note", "docker", "--cap-add NET_RAW")),
    (
        {"proc/swaps": "Filename\n/dev/sda2 partition 100 7 -2"},
        ("machine.swap", "note", "/dev/sda2: 7 KiB", "swapoff"),
    ),
    ({"sys/class/net/eth1/type": "772"}, ("interface.exists", "bad", "loopback", "")),
    ({"sys/class/net/eth1/wireless/x": ""}, ("interface.exists", "bad", "wireless", "")),
    ({"sys/class/net/eth1/bridge/x": ""}, ("interface.exists", "bad", "bridge", "master eth1")),
    (
        {"sys/class/net/eth1/flags": "0x1002"},
        ("interface.state", "bad", "down", "ip link set eth1 up"),
    ),
    ({"sys/class/net/eth1/carrier": "0"}, ("interface.state", "bad", "no link", "cable")),
    (
        {"sys/class/net/eth1/duplex": "half"},
        ("interface.speed", "bad", "half duplex", "ethtool -s eth1"),
    ),
    ({"sys/class/net/eth1/speed": "10"}, ("interface.speed", "bad", "10 Mbit/s", "cable")),
    ({"sys/class/net/eth1/mtu": "1400"}, ("interface.mtu", "bad", "1400", "mtu 1500")),
    (
        {"sys/class/net/eth1/statistics/rx_crc_errors": "5"},
        ("interface.errors", "warning", "rx_crc_errors 5", "cable"),
    ),
    (
        {"sys/class/net/eth1/statistics/rx_dropped": "5"},
        ("interface.errors", "note", "rx_dropped 5", ""),
    ),
    (
        {"proc/irq/40/smp_affinity_list": "0-3"},
        ("interface.irq_affinity", "note", "40 on CPU 0-3", "echo 3 > /proc/irq/40/"),
    ),
    (
        {"run/systemd/netif/links/3": "ADMIN_STATE=configured\nNETWORK_FILE=/etc/x.network"},
        ("interface.manager", "note", "systemd-networkd", "Unmanaged=yes"),
    ),
]  # fmt: skip


@pytest.mark.parametrize(("files", "expected"), FAULTS, ids=lambda v: str(v)[:60])
def test_one_thing_wrong_is_one_finding(files, expected, tmp_path):
    name, level, text, fix = expected
    made = good(tmp_path)
    made.write(files)
    seen = look(made)
    wrong = [f for f in seen.findings if f.level is not MachineLevel.GOOD]
    assert [(f.name, f.level.value) for f in wrong] == [(name, level)]
    assert text in wrong[0].text
    assert fix in " ".join(wrong[0].now + wrong[0].keep)
    assert wrong[0].now or wrong[0].keep or not fix
    assert seen.healthy == (level == "note")


@pytest.mark.parametrize(
    ("code", "words", "expected"),
    [
        (0x0E, {1: 50}, ("interface.coalescing", "warning", "50 us late", "rx-usecs 0")),
        (0x0E, {1: 3}, ("interface.coalescing", "note", "3 us", "rx-usecs 0")),
        (0x0E, {10: 1}, ("interface.coalescing", "warning", "adaptive", "adaptive-rx off")),
        (0x0E, {1: 50, 2: 1}, ("interface.coalescing", "good", "at once", "")),
        (0x2B, {1: 1}, ("interface.offloads", "note", "GRO on", "gro off")),
        (0x25, {1: 1 << 15}, ("interface.offloads", "warning", "LRO on", "lro off")),
        (0x44, {4: 1, 5: 1}, ("interface.eee", "warning", "sleeps", "eee off")),
        (0x44, {5: 1}, ("interface.eee", "note", "not in use", "eee off")),
    ],
)
def test_messages_of_the_driver(code, words, expected, tmp_path):
    name, level, text, fix = expected
    made = good(tmp_path)
    made.seam.driver[code] = words
    seen = found(made, name)
    assert (seen.level.value, text in seen.text) == (level, True), seen
    assert fix in " ".join(seen.now)


def test_a_driver_that_is_silent_is_not_known(tmp_path):
    made = good(tmp_path)
    made.seam.driver = {}
    unknown = {f.name for f in look(made).findings if f.level is MachineLevel.UNKNOWN}
    assert unknown == {"interface.coalescing", "interface.offloads", "interface.eee"}
    assert look(made).healthy
    assert "Operation not supported" in found(made, "interface.eee").text


@pytest.mark.parametrize(
    ("granted", "mine", "level", "text"),
    [
        (None, status(), "bad", "lacks CAP_NET_RAW, CAP_IPC_LOCK, CAP_SYS_NICE"),
        (1 << 13, status(), "warning", "lacks CAP_IPC_LOCK, CAP_SYS_NICE"),
        (None, status(ambient=CAPABILITIES), "good", "ambient"),
        (None, status(user=0, effective=CAPABILITIES), "note", "root has them"),
        (None, status(user=0), "bad", "lacks"),  # root of a container that was given nothing
    ],
)
def test_missing_capabilities_are_reported_with_setcap(granted, mine, level, text, tmp_path):
    made = good(tmp_path)
    made.seam.granted = granted
    made.write({"proc/self/status": mine})
    seen = found(made, "master.capabilities")
    assert (seen.level.value, text in seen.text) == (level, True), seen
    if level in ("bad", "warning"):
        assert seen.now == (f"setcap cap_net_raw,cap_sys_nice,cap_ipc_lock=ep {MASTER}",)
        assert "AmbientCapabilities=" in seen.keep[0]


def test_no_master_is_a_warning(tmp_path):
    seen = found(good(tmp_path), "master.capabilities", program=None)
    assert (seen.level, seen.now) == (MachineLevel.WARNING, ("fsoe-net install-master",))


def test_limits_count_only_without_capabilities(tmp_path):
    made = good(tmp_path)
    low = "Max locked memory 8388608 8388608 bytes\nMax realtime priority 0 0"
    made.write({"proc/self/limits": low})
    assert found(made, "master.limits").level is MachineLevel.GOOD
    made.seam.granted = None
    seen = found(made, "master.limits")
    assert seen.level is MachineLevel.WARNING
    assert "8192 KiB" in seen.text
    assert "priority up to 0" in seen.text
    assert "LimitRTPRIO=99" in " ".join(seen.keep)


@pytest.mark.parametrize(
    ("granted", "memory", "priority", "text"),
    [
        (0, "unlimited", 80, "locked memory unlimited, real-time priority 80"),
        (0, "unlimited", 79, "real-time priority up to 79, fsn-master asks for 80"),
        (1 << 14, "8192", 0, "real-time priority up to 0, fsn-master asks for 80"),
        (1 << 23, "8192", 0, "8 KiB of memory may be locked"),
    ],
)
def test_each_limit_counts_without_its_capability(granted, memory, priority, text, tmp_path):
    made = good(tmp_path)
    limits = f"Max locked memory {memory} x bytes\nMax realtime priority {priority} x"
    made.write({"proc/self/limits": limits})
    made.seam.granted = granted
    assert found(made, "master.limits").text == text


@pytest.mark.parametrize(
    ("policy", "priority", "user", "level", "text"),
    [
        (1, 80, 1000, "good", "fifo 80"),
        (0, 0, 1000, "warning", "without a real-time thread"),
        (1, 80, 0, "note", "as root"),
    ],
)
def test_a_running_master(policy, priority, user, level, text, tmp_path):
    made = good(tmp_path)
    made.process(700, "fsn-master", policy=policy, priority=priority)
    made.write({"proc/700/status": status(user=user)})
    seen = found(made, "master.running")
    assert (seen.level.value, text in seen.text) == (level, True), seen


def test_others_on_the_interface(tmp_path):
    made = good(tmp_path)
    made.write(
        {
            "proc/net/packet": "sk RefCnt Type Proto  Iface R Rmem   User   Inode\n"
            "0 3 3 88a4   3     1 0      0      501\n"
            "0 3 3 0003   0     1 0      0      502\n"
            "0 3 3 88a4   9     1 0      0      503\n"  # another interface
            "0 3 3 88a4   3     1 0      0      504\n"
            "0 3 3 88a4   3     1 0      0      505"
        }
    )
    for pid, name, inode in ((11, "simple_test", 501), (12, "tcpdump", 502), (13, "x", 503)):
        made.process(pid, name)
        made.link(f"proc/{pid}/fd/3", f"socket:[{inode}]")
    made.process(14, "fsn-master", policy=1, priority=80)
    made.link("proc/14/fd/3", "socket:[504]")
    rows = [f for f in look(made).findings if f.name == "interface.sockets"]
    assert [(f.level.value, f.text.split(" has ")[0]) for f in rows] == [
        ("bad", "simple_test (process 11)"),
        ("warning", "tcpdump (process 12)"),
        ("good", "fsn-master (process 14) drives it"),
        ("note", "1 packet sockets of processes not seen from here; root sees them"),
    ]


def test_managers_and_addresses(tmp_path):
    made = good(tmp_path)
    made.process(20, "NetworkManager")
    made.seam.commands["nmcli"] = "eth1:connected\nlo:unmanaged\n"
    seen = found(made, "interface.manager")
    assert (seen.level, seen.now) == (MachineLevel.WARNING, ("nmcli device set eth1 managed no",))
    made.seam.commands["nmcli"] = "eth1:unmanaged\n"
    assert found(made, "interface.manager").level is MachineLevel.GOOD
    del made.seam.commands["nmcli"]
    assert found(made, "interface.manager").level is MachineLevel.UNKNOWN
    address = {"local": "fe80::1", "prefixlen": 64, "scope": "link"}
    for rows, level in (
        ([address], "note"),
        ([address, {"local": "10.0.0.1", "prefixlen": 8, "scope": "global"}], "warning"),
    ):
        made.seam.commands["ip"] = json.dumps([{"addr_info": rows}])
        assert found(made, "interface.address").level.value == level
    for told in ("{}", "[1]", "nonsense", "[", '[{"addr_info":[{}]}]', None):
        made.seam.commands["ip"] = told
        assert found(made, "interface.address").level in (MachineLevel.UNKNOWN, MachineLevel.GOOD)


def test_a_bond_and_a_slow_interrupt_thread(tmp_path):
    made = good(tmp_path)
    made.link("sys/class/net/eth1/master", "../br0")
    made.process(90, "irq/40-eth1", policy=1, priority=50)
    made.process(91, "irqbalance")
    seen = {f.name: f for f in look(made).findings if f.level is not MachineLevel.GOOD}
    assert set(seen) == {"interface.member", "interface.irq_thread", "machine.irqbalance"}
    assert "part of br0" in seen["interface.member"].text
    assert seen["interface.irq_thread"].now == ("chrt -f -p 85 90",)


def test_an_interface_that_is_not_there_is_reported_once(tmp_path):
    rows = [f for f in look(good(tmp_path), "eth7").findings if f.name.startswith("interface")]
    assert [(f.level, f.text) for f in rows] == [
        (MachineLevel.BAD, "unknown interface eth7; there are: eth1")
    ]


@pytest.mark.parametrize("name", ["", "..", "../../etc", "a b", "x" * 16, "eth1/statistics"])
def test_invalid_interface_name_is_reported_once(name, tmp_path):
    rows = [f for f in look(good(tmp_path), name).findings if f.name.startswith("interface")]
    assert [f.level for f in rows] == [MachineLevel.BAD]


def test_a_container_without_sys(tmp_path):
    made = good(tmp_path)
    made.remove("sys", "boot")
    seen = look(made)
    assert seen.healthy
    rows = {f.name: f for f in seen.findings}
    assert rows["cpu.idle"].level is MachineLevel.UNKNOWN
    assert rows["interface.state"].level is MachineLevel.UNKNOWN
    assert "sysfs is missing" in rows["interface.state"].text


def test_unreadable_files_are_named_with_the_reason(tmp_path):
    made = good(tmp_path)
    made.remove("proc/swaps")
    made.write({"proc/sys/kernel/sched_rt_runtime_us": "many"})
    (made.root / "proc/swaps").mkdir()
    assert found(made, "machine.swap").text == "/proc/swaps: Is a directory"
    seen = found(made, "kernel.rt_throttling")
    assert (seen.level, "holds 'many', no number" in seen.text) == (MachineLevel.UNKNOWN, True)


def test_nothing_there_at_all(tmp_path):
    with pytest.raises(Unreadable, match="/proc/version: No such file"):
        examine(Host(tmp_path, good(tmp_path / "other").seam))


def test_each_file_may_be_missing_or_nonsense(tmp_path):
    """No single file can bring a look down; most are named when they are gone."""
    made = good(tmp_path)
    files = [p for p in sorted(made.root.rglob("*")) if p.is_file() and not p.is_symlink()]
    for path in files:
        if path.is_relative_to(made.root / CPUS) and {"cpu1", "cpu2"} & set(path.parts):
            continue  # as cpu0
        before = path.read_bytes()
        for after in (None, b"\xff\xfe nonsense : ( -1\n\n:::\n", b"9" * 400):
            path.unlink()
            if after is not None:
                path.write_bytes(after)
            try:
                look(made)
            except Unreadable:
                assert path.name in ("version", "online", "cpuinfo"), path
            path.write_bytes(before)


def test_the_command_on_this_machine():
    done = fsn("doctor", "--interface", "lo", "--format", "json")
    assert (done.returncode, done.stderr) == (1, "")
    document = json.loads(done.stdout)
    assert document["result"] == "fail"
    rows = {row["name"]: row for row in document["findings"]}
    assert rows["interface.exists"]["text"] in (
        "the loopback interface",
        "/sys/class/net/lo is not there: sysfs is missing or shows another network namespace",
    )
    page = (ROOT / "docs/reference/json-output.md").read_text("utf-8")
    keys = {*document, *document["findings"][0]}
    assert [k for k in sorted(keys) if f"`{k}`" not in page] == []
    text = fsn("doctor", "--interface", "lo")
    assert text.returncode == 1
    for row in document["findings"]:
        assert row["name"] in text.stdout
        if row["name"] == "master.running":
            continue  # other tests start and end one meanwhile
        for line in (*row["now"], *row["keep"]):
            assert line in text.stdout
    assert "\x1b" not in text.stdout


def test_doctor_reports_usage_errors():
    done = fsn("doctor", "--interface")
    assert (done.returncode, "requires an argument" in done.stderr) == (2, True)
    assert fsn("doctor", "x").returncode == 2


def test_every_check_is_on_the_page(tmp_path):
    page = (ROOT / "docs/howto/doctor.md").read_text("utf-8")
    names = {f.name for f in look(good(tmp_path)).findings}
    assert [n for n in sorted(names) if f"`{n}`" not in page] == []
