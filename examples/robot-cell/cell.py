"""The robot cell in one command: emulated devices, fsn-master, a motion program, an e-stop.

cell.py [FOLDER]: all of it in a network namespace of its own, as root, or as an ordinary user where
the system lets it. Presses the e-stop while both axes move, releases and acknowledges it, starts
again; writes robot-cell.svg and motion.csv into FOLDER, and fails when an axis did what it must
not. EMULATION: no safety function, and nothing here is safe.
"""

import csv
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

sys.dont_write_bytecode = True  # an installation has no file that its record does not name

from motion import COUNTS_PER_REV  # noqa: E402
from plot import FSOE, STATES, Picture, fsoe_word, state_of  # noqa: E402

import fsoe_net  # noqa: E402

HERE = Path(__file__).parent
AXES = ("axis_1", "axis_2")
ESTOP = ("el1904.0x6001:01", "el1904.0x6001:02")
PATIENCE_S = 60.0
REACTION_S = 1.0  # required_reaction_ms of the safety function in network.yaml
OWN = "ROBOT_CELL_NAMESPACE"
BUSY = (
    "A machine that is busy for 100 ms loses FSoE connections, as it should. Try again on an idle "
    "one, or as root for real-time priority"
)
STARTS = 5


def enter_namespace() -> None:
    """Start again in a network namespace with one cable, from near to far."""
    for tool in ("unshare", "ip"):
        if shutil.which(tool) is None:
            sys.exit(f"{tool} is needed: apt install util-linux iproute2")
    root = os.geteuid() == 0
    cable = (
        "ip link set lo up && ip link add near type veth peer name far && ip link set near up && "
        'ip link set far up && exec "$@"'
    )
    # Whatever becomes of this program: what it has started ends with its namespace of processes.
    apart = ["unshare", "-n" if root else "-rn", "--pid", "--fork", "--kill-child", "--mount-proc"]
    command = [*apart, "sh", "-c", cable, "sh", sys.executable]
    environment = os.environ | {OWN: "1"}
    done = subprocess.run([*command, *sys.argv], env=environment, check=False)
    if (
        done.returncode == 1
        and not root
        and subprocess.run([*apart, "true"], capture_output=True, check=False).returncode
    ):
        sys.exit("this system lets ordinary users have no network namespace; run it with sudo")
    sys.exit(done.returncode)


def wait_for(what: str, found: Callable[[], object]) -> float:
    """Return the time at which something is so."""
    until = time.monotonic() + PATIENCE_S
    while not found():
        if time.monotonic() > until:
            sys.exit(f"never came: {what}")
        time.sleep(0.005)
    return time.monotonic()


class Cell:
    """The processes of the cell, and what has happened: ``marks`` are times with words."""

    def __init__(self, folder: Path, work: Path) -> None:
        self.record = folder / "motion.csv"
        self.marks: list[tuple[float, str]] = []
        self.states: list[tuple[float, dict[str, fsoe_net.ConnectionState]]] = []
        self.said = ""
        self._started: list[subprocess.Popen] = []
        self._work, self._end = work, threading.Event()
        self._socket, self._log = str(work / "cell.sock"), work / "master.log"

    def __enter__(self):
        return self

    def start(self) -> None:
        """Start devices and MainDevice, and wait until all SubDevices are in OP."""
        motors = work_scenario(self._work)
        fsn = [sys.executable, "-m", "fsoe_net.cli"]
        network, plan = str(HERE / "network.yaml"), str(self._work / "cell.fsnplan")
        subprocess.run([*fsn, "plan", network, "-o", plan], check=True, stdout=subprocess.DEVNULL)
        self._emulator = self._run(
            *fsn, "emulate", network, "--interface", "far", "--scenario", motors, "--commands",
            stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self.do("status")
        master = shutil.which(
            "fsn-master", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        )
        if master is None:
            sys.exit("no fsn-master; `make master` or `fsoe-net install-master` builds it")
        with self._log.open("w") as log:
            self._master = self._run(
                master, plan, "--interface", "near", "--socket", self._socket, "--wait", "60s",
                stdout=subprocess.DEVNULL, stderr=log,
            )  # fmt: skip
        self.client = self._connected()
        self._watcher = threading.Thread(target=self._watch)
        self._watcher.start()

    def _run(self, *command: str, **how) -> subprocess.Popen:
        process = subprocess.Popen(command, **how)
        self._started.append(process)
        return process

    def _connected(self) -> fsoe_net.Client:
        client = None

        def connect() -> bool:
            nonlocal client
            if self._master.poll() is not None:
                sys.exit(f"fsn-master has ended: {self._log.read_text()}")
            try:
                client = fsoe_net.connect(self._socket)
                return all(sub.in_op for sub in client.subdevices())
            except fsoe_net.FsnError:
                return False

        wait_for("all SubDevices in OP", connect)
        return client

    def __exit__(self, *_: object) -> None:
        self._end.set()
        for process in reversed(self._started):
            process.terminate()
            process.wait()

    def do(self, line: str) -> None:
        """Do a command of the emulation."""
        self._emulator.stdin.write(line + "\n")
        self._emulator.stdin.flush()
        for answer in self._emulator.stderr:
            if answer.startswith(("refused", "error")):
                sys.exit(answer)
            if answer == "ok\n" or " frames, " in answer:
                return
        sys.exit("the emulation has ended")

    def mark(self, text: str) -> float:
        """Note what happens now."""
        self.marks.append((time.monotonic(), text))
        return self.marks[-1][0]

    def move(self) -> None:
        """Start the motion program."""
        command = [sys.executable, str(HERE / "motion.py"), self._socket, str(self.record)]
        process = self._run(*command, stdout=subprocess.PIPE, text=True)
        threading.Thread(target=lambda: [self._say(line) for line in process.stdout]).start()

    def _say(self, line: str) -> None:
        self.said = line.rstrip()
        print(f"  motion program: {self.said}", flush=True)

    def _watch(self) -> None:
        """Note the states of the FSoE connections."""
        with fsoe_net.connect(self._socket) as client:
            while not self._end.wait(0.005):
                try:
                    rows = {c.name: c.state for c in client.connections()}
                except fsoe_net.FsnError:
                    return
                self.states.append((time.monotonic(), rows))

    def has_process_data(self) -> bool:
        """Return whether every FSoE connection carries ProcessData."""
        process = fsoe_net.ConnectionState.DATA_PROCESS
        return bool(self.states) and all(s is process for s in self.states[-1][1].values())

    def drives_in(self, state: str) -> bool:
        """Return whether both drives are in a state."""
        found = self.client.get(*(f"{name}.status_word" for name in AXES)).inputs
        return all(state_of(int(word)) == state for word in found.values())

    def moving(self, rev_s: float) -> bool:
        """Return whether both axes are so fast."""
        if self.said == "waiting":
            sys.exit(f"the axes stopped before the e-stop was pressed. {BUSY}")
        found = self.client.get(*(f"{name}.velocity" for name in AXES)).inputs
        return all(abs(int(v)) > rev_s * COUNTS_PER_REV for v in found.values())


def work_scenario(work: Path) -> str:
    """Return a scenario with logic and motors of scenario.yaml; the steps come when they fit."""
    head = (HERE / "scenario.yaml").read_text("utf-8").partition("\nsteps:")[0]
    path = work / "motors.yaml"
    path.write_text(head.replace("duration_s", "# duration_s"), "utf-8")
    return str(path)


def play(cell: Cell) -> None:
    """Let everything happen."""

    def press_start() -> None:
        cell.said = "start pressed"
        cell.mark("start")
        cell.do("set el1008.start 1")
        time.sleep(0.1)
        cell.do("set el1008.start 0")

    def press_reset() -> None:
        cell.do("press")
        time.sleep(0.1)
        cell.do("release")

    print("all SubDevices in OP; the safety logic is acknowledged")
    wait_for("Data", lambda: cell.states and all(s.in_data for s in cell.states[-1][1].values()))
    cell.move()
    wait_for("the reset of the safety logic", lambda: press_reset() or cell.has_process_data())
    wait_for("the motion program", lambda: cell.client.status().clients >= 3)
    time.sleep(0.3)
    for _ in range(STARTS):
        press_start()
        wait_for("motion, or a stop", lambda: cell.said in ("moving", "waiting"))
        if cell.said == "moving":
            break
        print("the axes did not come up; acknowledge, and start again")
        cell.marks.clear()
        wait_for("the reset", lambda: press_reset() or cell.has_process_data())
    else:
        sys.exit(f"the axes did not come up. {BUSY}")
    wait_for("motion", lambda: cell.moving(4.0))
    time.sleep(1.0)
    wait_for("both axes fast", lambda: cell.moving(5.0))
    print("e-stop pressed while both axes move")
    cell.mark("e-stop")
    for name in ESTOP:
        cell.do(f"set {name} 0")
    wait_for("torque off", lambda: cell.drives_in("Switch on disabled"))
    time.sleep(0.7)
    print("e-stop released, safety logic acknowledged: nothing may move")
    cell.mark("released")
    for name in ESTOP:
        cell.do(f"set {name} 1")
    time.sleep(0.5)
    cell.mark("reset")
    wait_for("the reset of the safety logic", lambda: press_reset() or cell.has_process_data())
    time.sleep(0.7)
    print("start pressed again")
    press_start()
    wait_for("motion again", lambda: cell.moving(4.0))
    time.sleep(1.5)


def judged(
    rows: list[list[float]], marks: dict[str, float], again: float
) -> list[tuple[str, str, bool]]:
    """Return what must be so: what, what was seen, whether it holds."""
    found: list[tuple[str, str, bool]] = []
    pressed, at_rest = marks["e-stop"], marks["released"]
    for number, name in enumerate(AXES):
        place = 3 + 4 * number
        off = next(r[0] for r in rows if r[0] > pressed and int(r[place + 3]) & 0x4F == 0x40)
        after = [r for r in rows if off <= r[0] < again]
        torque = max(abs(r[place + 2]) for r in after)
        found.append((f"{name}: e-stop to torque off", f"{(off - pressed) * 1000:.0f} ms",
                      off - pressed < REACTION_S and torque == 0))  # fmt: skip
        still = [r[place] for r in rows if at_rest <= r[0] < again]
        found.append((f"{name}: moved before the restart", f"{max(still) - min(still):g} counts",
                      max(still) - min(still) <= 1))  # fmt: skip
        enabled = next(r[0] for r in rows if r[0] >= again and int(r[place + 3]) & 0x6F == 0x27)
        first = [r[place] for r in rows if enabled <= r[0] < enabled + 0.03]
        jump = max(abs(position - still[-1]) for position in first) / COUNTS_PER_REV
        found.append((f"{name}: way in the first 30 ms of the restart", f"{jump:.3f} rev",
                      jump < 0.05))  # fmt: skip
    wrong = sum(int(r[1]) for r in rows)
    found.append(("FSoE frames sent that are not those that came",
                  f"{wrong} in {len(rows)} cycles", wrong == 0))  # fmt: skip
    return found


def draw(cell: Cell, rows: list[list[float]], path: Path) -> None:
    """Write the picture."""
    zero = cell.marks[0][0] - 0.3
    seen = [r for r in rows if r[0] >= zero]
    end = seen[-1][0] - zero
    picture = Picture(0.0, end, [(t - zero, text) for t, text in cell.marks])
    kinds = (("Position", "rev", 0, COUNTS_PER_REV), ("Velocity", "rev/s", 1, COUNTS_PER_REV),
             ("Torque", "N·m", 2, 1000))  # fmt: skip
    for title, unit, column, scale in kinds:
        picture.lines(title, unit, {
            name: [(r[0] - zero, r[3 + 4 * n + column] / scale) for r in seen]
            for n, name in enumerate(AXES)
        })  # fmt: skip
    drives = {
        name: [(r[0] - zero, state_of(int(r[6 + 4 * n]))) for r in seen]
        for n, name in enumerate(AXES)
    }
    picture.bands("State of the drives", drives, {w: s[2] for w, s in STATES.items()})
    states = [(t - zero, row) for t, row in cell.states if 0 <= t - zero <= end]
    fsoe = {
        name: [(t, fsoe_word(row[f"el6910-{name}"])) for t, row in states]
        for name in ("el1904", *AXES)
    }
    picture.bands("FSoE connections", fsoe, FSOE)
    path.write_text(picture.svg(), "utf-8")


def main() -> int:
    if OWN not in os.environ:
        enter_namespace()
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="fsn-") as work, Cell(folder, Path(work)) as cell:
        cell.start()
        play(cell)
    with open(cell.record, newline="", encoding="ascii") as file:
        rows = [[float(word) for word in row] for row in csv.reader(file)]
    picture = folder / "robot-cell.svg"
    draw(cell, rows, picture)
    again = cell.marks[-1][0]
    found = judged(rows, {text: t for t, text in cell.marks}, again)
    for what, seen, holds in found:
        print(f"{'ok  ' if holds else 'FAIL'} {what}: {seen}")
    print(f"picture: {picture}; every cycle: {cell.record}")
    return 0 if all(holds for *_, holds in found) else 1


if __name__ == "__main__":
    sys.exit(main())
