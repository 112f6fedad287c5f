"""What an expression in a xacro file can do to the machine, watched from outside: nothing.

Each payload runs twice. Trusted, it leaves its mark, so the escape works and the watching sees it;
confined, the same payload leaves none.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import pytest
from patience import PATIENCE_S
from weekly import first

from fsoe_net.diag.diagnostic import Diagnostic
from fsoe_net.formats.own.options import LoadOptions
from fsoe_net.formats.ros2 import confine
from fsoe_net.formats.ros2.urdf import load_urdf
from fsoe_net.formats.ros2.xacro_expand import LIMITS

_T = TypeVar("_T")
SECRET = "kept-to-itself"
XMLNS = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
# Ways from an expression to the builtins of the interpreter. xacro only looks at the names of the
# outermost code; a lambda hides the others from it.
BUILTINS = {
    "frames of a generator": (
        "[b for s in [lambda s, f: f.f_builtins if 'open' in f.f_builtins else s(s, f.f_back)] "
        "for g in [[]] for _ in [g.append((s(s, g[0].gi_frame) for _ in [0]))] for b in g[0]][0]"
    ),
    "globals of a function": "(lambda: xacro.load_yaml.__globals__['__builtins__'])()",
    "globals of a method": "(lambda: xacro.dotify.__getattr__.__globals__['__builtins__'])()",
    "subclasses of object": (
        "(lambda: [c for c in ().__class__.__base__.__subclasses__() if c.__name__ == "
        "'_wrap_close'][0].__init__.__globals__['__builtins__'])()"
    ),
    "builtins of a function": "(lambda: xacro.arg.__builtins__)()",
    "nested lambdas": ("(lambda: (lambda m: m.fatal.__globals__['__builtins__'])(xacro))()"),
}


@dataclass
class World:
    """What can be seen from outside.

    Attributes:
        robot: Folder of the file, which it may read.
        away: Another folder, with a victim and a secret.
        calls: Bytes and connections that came in.
        shown: Return code and everything the tool printed.
    """

    robot: Path
    away: Path
    tcp: socket.socket
    udp: socket.socket
    unix: socket.socket
    abstract: socket.socket
    calls: list[str] = field(default_factory=list)
    code: int = 0
    shown: str = ""

    @property
    def victim(self) -> Path:
        return self.away / "victim"

    def run(self, *, trusted: bool) -> None:
        program = (
            "import sys\n"
            "from fsoe_net.formats.own.options import LoadOptions\n"
            "from fsoe_net.formats.own.network import load_network\n"
            "options = LoadOptions(trust_xacro=sys.argv[2] == 'True')\n"
            "for d in load_network([sys.argv[1]], options).diagnostics: print(d.message)\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", program, str(self.robot / "main.xacro"), str(trusted)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=os.environ | {"FSN_SECRET": SECRET, "HOME": str(self.away)},
            cwd=self.away,
            check=False,
            start_new_session=True,
        )
        self.code, self.shown = done.returncode, done.stdout.decode(errors="replace")
        self._take_calls()

    def _take_calls(self) -> None:
        for name, listener in (("tcp", self.tcp), ("unix", self.unix), ("abstract", self.abstract)):
            with contextlib.suppress(BlockingIOError):
                listener.accept()[0].close()
                self.calls.append(name)
        with contextlib.suppress(BlockingIOError):
            self.udp.recv(100)
            self.calls.append("udp")


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    robot, away = tmp_path / "robot", tmp_path / "away"
    robot.mkdir()
    away.mkdir()
    (away / "victim").write_text("as it was")
    (away / "secret").write_text(SECRET)
    with contextlib.ExitStack() as stack:
        tcp, udp, unix, abstract = (
            stack.enter_context(socket.socket(family, kind))
            for family, kind in (
                (socket.AF_INET, socket.SOCK_STREAM),
                (socket.AF_INET, socket.SOCK_DGRAM),
                (socket.AF_UNIX, socket.SOCK_STREAM),
                (socket.AF_UNIX, socket.SOCK_STREAM),
            )
        )
        tcp.bind(("127.0.0.1", 0))
        udp.bind(("127.0.0.1", 0))
        unix.bind(str(away / "u"))
        abstract.bind(f"\0fsn-test-{os.getpid()}-{id(tcp)}")
        for one in (tcp, udp, unix, abstract):
            one.setblocking(False)
            if one is not udp:
                one.listen()
        yield World(robot, away, tcp, udp, unix, abstract)


def _write(world: World, code: str, builtins: str = BUILTINS["globals of a function"]) -> None:
    """Write a robot whose expression runs a program."""
    names = {
        "AWAY": str(world.away),
        "TCP": world.tcp.getsockname(),
        "UDP": world.udp.getsockname(),
        "ABSTRACT": world.abstract.getsockname(),
    }
    head = "".join(f"{name} = {value!r}\n" for name, value in names.items())
    imports = "import ctypes, os, resource, signal, socket, subprocess, sys, threading\n"
    program = f"{head}{imports}V = AWAY + '/victim'\nC = ctypes.CDLL(None)\n{code}\n"
    (world.robot / "program.py").write_text(program, "utf-8")
    (world.robot / "main.xacro").write_text(
        f"""<robot name="r" {XMLNS}>
<xacro:property name="b" value="${{{builtins.replace("<", "&lt;")}}}"/>
<xacro:property name="g" value="${{python.dict([('__builtins__', b)])}}"/>
<a b="${{b['exec'](b['open'](xacro.abs_filename('program.py')).read(), g)}}"/>
</robot>
""",
        "utf-8",
    )


def _victim_differs(world: World) -> bool:
    info = os.stat(world.victim) if world.victim.exists() else None
    kept = info is not None and stat.S_IMODE(info.st_mode) == 0o644 and info.st_mtime > 1000
    return not kept or world.victim.read_text() != "as it was"


def _new_file(world: World) -> bool:
    return {p.name for p in world.away.iterdir()} > {"victim", "secret", "u"}


def _new_below_robot(world: World) -> bool:
    return {p.name for p in world.robot.iterdir()} != {"main.xacro", "program.py"}


def _secret_shown(world: World) -> bool:
    return SECRET in world.shown


def _called(world: World) -> bool:
    return bool(world.calls)


def _tool_hurt(world: World) -> bool:
    return world.code != 0 or "hurt" in world.shown


# name: (program, what it does when nothing holds it)
PAYLOADS: dict[str, tuple[str, Callable[[World], bool]]] = {
    # files
    "write": ("open(V, 'w').write('x')", _victim_differs),
    "append": ("open(V, 'a').write('x')", _victim_differs),
    "cut off": ("os.truncate(V, 0)", _victim_differs),
    "cut off by an open that reads": ("os.open(V, os.O_RDONLY | os.O_TRUNC)", _victim_differs),
    "delete": ("os.unlink(V)", _victim_differs),
    "rename": ("os.rename(V, AWAY + '/other')", _victim_differs),
    "change rights": ("os.chmod(V, 0o777)", _victim_differs),
    "change times": ("os.utime(V, (1, 1))", _victim_differs),
    "write through libc": ("C.close(C.creat(V.encode(), 0o644))", _victim_differs),
    "create": ("open(AWAY + '/new', 'x')", _new_file),
    "create beside the file": ("open(sys.argv[0] and ROBOT + '/new', 'x')", _new_below_robot),
    "folder": ("os.mkdir(AWAY + '/new')", _new_file),
    "link": ("os.link(V, AWAY + '/new')", _new_file),
    "symbolic link": ("os.symlink(V, AWAY + '/new')", _new_file),
    "pipe": ("os.mkfifo(AWAY + '/new')", _new_file),
    "start file of the shell": (
        "open(os.path.expanduser(os.environ.get('HOME', AWAY)) + '/.bashrc', 'a')",
        _new_file,
    ),
    "unnamed file with a name later": (
        "f = os.open(AWAY, os.O_TMPFILE | os.O_RDWR)\n"
        "C.linkat(-100, f'/proc/self/fd/{f}'.encode(), -100, (AWAY + '/new').encode(), 0x400)",
        _new_file,
    ),
    # reading
    "read": ("raise ValueError(open(AWAY + '/secret').read())", _secret_shown),
    "read through a link": (
        "raise ValueError(open(ROBOT + '/../away/secret').read())",
        _secret_shown,
    ),
    "environment": ("raise ValueError(os.environ['FSN_SECRET'])", _secret_shown),
    "environment of the parent": (
        "text = open(f'/proc/{os.getppid()}/environ').read()\n"
        "raise ValueError([v for v in text.split('\\0') if v.startswith('FSN_SECRET=')])",
        _secret_shown,
    ),
    # network
    "TCP": ("socket.create_connection(TCP)", _called),
    "UDP": ("socket.socket(type=socket.SOCK_DGRAM).sendto(b'x', UDP)", _called),
    "unix socket": ("socket.socket(socket.AF_UNIX).connect(AWAY + '/u')", _called),
    "abstract socket": ("socket.socket(socket.AF_UNIX).connect(ABSTRACT)", _called),
    "TCP through libc": (
        "f = C.socket(2, 1, 0)\n"
        "C.connect(f, bytes([2, 0, TCP[1] >> 8, TCP[1] & 255, 127, 0, 0, 1]) + bytes(8), 16)",
        _called,
    ),
    # processes
    "shell": ("os.system('/bin/touch ' + AWAY + '/new')", _new_file),
    "subprocess": ("subprocess.run(['/bin/touch', AWAY + '/new'])", _new_file),
    "spawn": (
        "os.waitpid(os.posix_spawn('/bin/touch', ['touch', AWAY + '/new'], {}), 0)",
        _new_file,
    ),
    "fork": (
        "p = os.fork()\nif p: os.waitpid(p, 0)\nelse: open(AWAY + '/new', 'x'); os._exit(0)",
        _new_file,
    ),
    "become another program": ("os.execv('/bin/touch', ['touch', AWAY + '/new'])", _new_file),
    "program in memory": (
        "f = os.memfd_create('x')\n"
        "os.write(f, open('/bin/touch', 'rb').read())\n"
        "os.execv(f'/proc/self/fd/{f}', ['touch', AWAY + '/new'])",
        _new_file,
    ),
    "thread": (
        "t = threading.Thread(target=lambda: open(AWAY + '/new', 'x'))\nt.start()\nt.join()",
        _new_file,
    ),
    # the tool itself
    "end the parent": ("os.kill(os.getppid(), signal.SIGKILL)", _tool_hurt),
    "signal to the parent by a pipe": (
        "import fcntl\n"
        "r, w = os.pipe()\n"
        "fcntl.fcntl(r, fcntl.F_SETOWN, os.getppid())\n"
        "fcntl.fcntl(r, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)\n"
        "os.write(w, b'x')",
        _tool_hurt,
    ),
    "limits of the parent": (
        "resource.prlimit(os.getppid(), resource.RLIMIT_CPU, (1, 1))\n"
        "open(AWAY + '/done', 'x') if resource.prlimit(os.getppid(), resource.RLIMIT_CPU)[0] == 1 "
        "else 0",
        _new_file,
    ),
}


@pytest.mark.uncounted
@pytest.mark.shows("R7")
@pytest.mark.parametrize("name", first(12, PAYLOADS))
def test_a_confined_payload_leaves_no_mark(name: str, world: World):
    code, happened = PAYLOADS[name]
    _write(world, f"ROBOT = {str(world.robot)!r}\n{code}")
    world.run(trusted=False)
    assert not happened(world), world.shown
    assert world.shown.count("\n") == 1, world.shown
    world.run(trusted=True)
    assert happened(world), world.shown


@pytest.mark.shows("R7")
@pytest.mark.parametrize("name", BUILTINS)
def test_each_way_to_the_interpreter_ends_at_the_kernel(name: str, world: World):
    _write(world, "open(V, 'w').write('x')", BUILTINS[name])
    world.run(trusted=False)
    assert not _victim_differs(world)
    assert world.shown == (
        f"xacro: '{world.victim}' is outside the folders that this file may read\n"
    )
    world.run(trusted=True)
    assert _victim_differs(world), world.shown


def _robot(folder: Path, body: str) -> Path:
    path = folder / "main.xacro"
    path.write_text(f'<robot name="r" {XMLNS}>\n{body}\n</robot>\n', "utf-8")
    return path


def _only(path: Path, options: LoadOptions | None = None) -> Diagnostic:
    (found,) = load_urdf(path, options).diagnostics
    return found


# -- the answer ------------------------------------------------------------------------------------

# Programs that write the answer themselves: it is a file of unknown origin.
ANSWERS = {
    "endless": "while True: os.write(F, b'[' * 2**20)",
    "deep": "os.write(F, b'[' * 10**6)",
    "long number": "os.write(F, b'9' * 10**6)",
    "no object": "os.write(F, b'[]')",
    "row of nothing": """os.write(F, b'{"sources": [], "rows": [[0]]}')""",
    "wrong types": """os.write(F, b'{"sources": [], "rows": [["0", 1, [], {}, null]]}')""",
    "attribute is a list": (
        """os.write(F, b'{"sources": [], "rows": [[0, "robot", {"a": []}, null, ""]]}')"""
    ),
    "depth below nothing": (
        """os.write(F, b'{"sources": [], "rows": [[0, "a", {}, null, ""], """
        """[-1, "b", {}, null, ""]]}')"""
    ),
    "message that is no text": (
        """os.write(F, b'{"sources": [], "error": {"code": "FSN119", "message": 1, "hint": "", """
        """"place": null, "via": []}}')"""
    ),
    "place in another file": (
        """os.write(F, b'{"sources": ["/etc/passwd"], "rows": [[0, "robot", {}, """
        """["/etc/passwd", 1, 1, 0, 0], ""]]}')"""
    ),
}


def _answer(world: World, code: str) -> None:
    """Write a robot whose expression writes the answer: to the one file open for writing."""
    find = "import stat\nF = [f for f in range(3, 20) if stat.S_ISREG(_mode(f))][0]\n"
    mode = (
        "def _mode(f):\n  try: return os.write(f, b'') or os.fstat(f).st_mode\n"
        "  except OSError: return 0\n"
    )
    _write(world, f"{mode}{find}{code}\nos._exit(0)")


@pytest.mark.parametrize("name", ANSWERS)
def test_a_forged_answer_is_refused(name: str, world: World):
    _answer(world, ANSWERS[name])
    result = load_urdf(world.robot / "main.xacro")
    assert [d.code for d in result.diagnostics] == ["FSN119"]
    assert result.systems == ()
    assert "/etc/passwd" not in str(result)


# The longest answer that the kernel lets pass, of what takes most memory for its length.
# Begin, item, end.
_ERROR = (
    '{"sources": [], "error": {"code": "FSN119", "place": null, "via": [], "hint": "", "message"'
)
LONGEST = {
    "lists": ("[", "[],", "[]]"),
    "objects": ("[", "{},", "{}]"),
    "texts": ("[", '"ab",', '""]'),
    "numbers": ("[", "999,", "0]"),
    "rows": (
        '{"sources": [], "rows": [[0,"a",{},null,""]',
        ',[1,"a",{},null,""]',
        "]}",
    ),
    "message": (f'{_ERROR}: "', "x", '"}}'),
}


@pytest.mark.uncounted
@pytest.mark.shows("R7")
@pytest.mark.parametrize("name", LONGEST)
def test_the_longest_answer_takes_little_memory(name: str, world: World):
    begin, item, end = (text.encode() for text in LONGEST[name])
    _answer(
        world,
        f"begin, item, end = {begin!r}, {item!r}, {end!r}\n"
        f"room = {LIMITS.answer_bytes} - len(begin + end)\n"
        "many = item * 1000\n"
        "for piece in (begin, *[many] * (room // len(many)), end): os.write(F, piece)",
    )
    program = (
        "import resource, sys\n"
        "from fsoe_net.formats.ros2.urdf import load_urdf\n"
        "peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "before = peak()\n"
        "found = str(load_urdf(sys.argv[1]).diagnostics)\n"
        "print(peak() - before, len(found), found[:300])\n"
    )
    path = str(world.robot / "main.xacro")
    shown = subprocess.check_output([sys.executable, "-c", program, path], text=True)
    grown_kib, length, found = shown.split(" ", 2)
    expected = {"rows": "FSN125", "message": "xacro: xxx"}
    assert expected.get(name, "more time or memory") in found
    assert int(grown_kib) < 200 * 1024, shown
    assert int(length) < 10_000


def test_named_sources_are_read_up_to_a_total(world: World):
    """The answer names one large file by many names."""
    with open(world.robot / "large", "wb") as large:
        large.truncate(30 * 2**20)
    (world.robot / "names").mkdir()
    for number in range(20):
        (world.robot / "names" / str(number)).symlink_to("../large")
    _answer(
        world,
        f"names = [b'\"{world.robot}/names/%d\"' % n for n in range(20)]\n"
        """rows = b'[[0, "robot", {}, null, ""]]'\n"""
        """os.write(F, b'{"sources": [%s], "rows": %s}' % (b', '.join(names), rows))""",
    )
    result = load_urdf(world.robot / "main.xacro")
    assert [d.code for d in result.diagnostics] == ["FSN125"]
    assert [Path(row.path).name for row in result.sources] == ["main.xacro", "0", "1"]


# -- what a file may read --------------------------------------------------------------------------


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    robot, other = tmp_path / "robot", tmp_path / "other"
    robot.mkdir()
    other.mkdir()
    (other / "part.xacro").write_text("<robot><a/></robot>")
    (other / "values.yaml").write_text("a: 1\n")
    return robot, other


@pytest.mark.parametrize(
    "body",
    [
        '<xacro:include filename="../other/part.xacro"/>',
        '<xacro:include filename="../other/part.xacro" optional="true"/>',
        '<xacro:include filename="../other/*.xacro"/>',
        '<xacro:include filename="link.xacro"/>',
        "<a>${xacro.load_yaml('../other/values.yaml')['a']}</a>",
    ],
)
def test_another_folder_is_refused_with_the_option_that_allows_it(
    body: str, folders: tuple[Path, Path]
):
    robot, other = folders
    (robot / "link.xacro").symlink_to(other / "part.xacro")
    path = _robot(robot, body)
    found = _only(path)
    assert (found.code, found.span.line) == ("FSN119", 2)
    assert found.message.endswith("is outside the folders that this file may read")
    assert found.hint.startswith("pass --package NAME=")
    assert _only(path, LoadOptions(packages={"any": str(other)})).code == "FSN125"
    assert _only(path, LoadOptions(trust_xacro=True)).code == "FSN125"


@pytest.mark.parametrize("name", ["env", "optenv"])
def test_variables_are_read_by_name_only(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = _robot(tmp_path, f'<xacro:include filename="$({name} FSN_PART)"/>')
    (tmp_path / "part.xacro").write_text("<robot/>")
    monkeypatch.setenv("FSN_PART", "part.xacro")
    found = _only(path)
    assert (found.code, found.span.line) == ("FSN119", 2)
    assert (
        found.message
        == "xacro: environment variable 'FSN_PART' is set, but this file may not read it"
    )
    assert found.hint == "pass --env FSN_PART if it may"
    assert _only(path, LoadOptions(xacro_env=("FSN_PART",))).code == "FSN125"
    assert _only(path, LoadOptions(trust_xacro=True)).code == "FSN125"


def test_a_variable_that_is_not_set_has_its_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.delenv("FSN_PART", raising=False)
    (tmp_path / "part.xacro").write_text("<robot/>")
    path = _robot(tmp_path, '<xacro:include filename="$(optenv FSN_PART part.xacro)"/>')
    assert _only(path).code == "FSN125"


# -- machines --------------------------------------------------------------------------------------

NOTHING = "xacro: this machine cannot confine the expansion, and the file may hold any program"


@pytest.mark.shows("R7")
def test_without_confinement_nothing_is_expanded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = _robot(tmp_path, "<a>${1}</a>")
    monkeypatch.setattr(confine, "_libseccomp", lambda: None)
    found = _only(path)
    assert (found.code, found.message) == ("FSN119", NOTHING)
    assert "--trust-xacro" in found.hint
    assert _only(path, LoadOptions(trust_xacro=True)).code == "FSN125"


@pytest.mark.shows("R7")
def test_without_landlock_nothing_is_expanded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(confine, "_landlock_version", lambda: 0)
    assert _only(_robot(tmp_path, "<a>${1}</a>")).message == NOTHING


def test_the_child_ends_with_the_tool(tmp_path: Path):
    path = _robot(tmp_path, "<a>${python.sum(x for x in range(10 ** 12))}</a>")
    program = "import sys; from fsoe_net.formats.ros2.urdf import load_urdf; load_urdf(sys.argv[1])"
    tool = subprocess.Popen([sys.executable, "-c", program, str(path)])
    children = Path(f"/proc/{tool.pid}/task/{tool.pid}/children")
    child = _wait_for(lambda: children.read_text().split())[0]
    # It confines itself before it evaluates; from then on the kernel ends it.
    _wait_for(lambda: "Seccomp:\t2" in Path(f"/proc/{child}/status").read_text())
    tool.send_signal(signal.SIGKILL)
    tool.wait()
    _wait_for(lambda: not _is_running(child))


def _is_running(pid: str) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False


def _wait_for(fact: Callable[[], _T]) -> _T:
    end = time.monotonic() + PATIENCE_S
    while not (found := fact()):
        assert time.monotonic() < end
        time.sleep(0.01)
    return found
