"""The console against a server that answers from memory: language, commands, scripts, lease."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from live.console_rig import Rig
from patience import PATIENCE_S

from fsoe_net.errors import ConsoleError, ControlRefused, EnvironmentFault
from fsoe_net.live.client import Client
from fsoe_net.live.console.commands_flow import ConsoleEnd
from fsoe_net.live.console.completion import complete
from fsoe_net.live.console.console import COMMANDS
from fsoe_net.live.console.names import batches
from fsoe_net.live.console.script import ScriptError, parse
from fsoe_net.live.control_values import BusState
from fsoe_net.testing.fake_master import STATUS, SUBDEVICE, FakeMaster


@pytest.fixture
def master():
    with FakeMaster() as found:
        yield found


@pytest.fixture
def rig(master):
    found = Rig(master.path)
    yield found
    found.link.close()


def words(text):
    return [list(c.words) for c in parse(text)]


def test_words_quotes_and_comments_are_split():
    assert words("a b;c # d\n\n 'e;f' \"g # h\"x # i") == [
        ["a", "b"],
        ["c"],
        ["e;f", "g # hx"],
    ]
    assert words("set a=1;b") == [["set", "a=1"], ["b"]]
    assert [(c.line, c.column) for c in parse("\n  a;  b")] == [(2, 3), (2, 7)]


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        ("a\n b 'c", 2, 4),
        ("a\x07", 1, 1),
    ],
)
def test_an_unknown_command_is_rejected(text, line, column):
    with pytest.raises(ScriptError) as caught:
        parse(text)
    assert (caught.value.line, caught.value.column) == (line, column)


@given(st.text(alphabet="x=1;#'\"\\ \n\t*é\x00\ud800", max_size=60))
def test_any_text_is_commands_or_a_located_mistake(text):
    place = None
    found = []
    try:
        found = [c.words for c in parse(text)]
    except ScriptError as exc:
        place = exc.line, exc.column
    assert place is None or (1 <= place[0] <= text.count("\n") + 1 and place[1] >= 1)
    assert all(word.isprintable() for row in found for word in row)


def test_several_outputs_go_out_in_one_request(master, rig):
    assert rig.do("set drive_1.0x6040 6 logic.ack=1") == ["2 set: drive_1.0x6040:00 logic.ack"]
    rig.do("set all 0x6040 7")
    rig.do("set drive_2 0x6040 15 drive_1 0x6040 2")
    rig.do("set drive_*.0x6040 0x10")
    assert [line for line in master.asked if line.startswith("set")] == [
        "set drive_1.0x6040:00=6 logic.ack=1",
        "set drive_1.0x6040:00=7 drive_2.0x6040:00=7",
        "set drive_2.0x6040:00=15 drive_1.0x6040:00=2",
        "set drive_1.0x6040:00=0x10 drive_2.0x6040:00=0x10",
    ]
    assert len(rig.do("get all.0x6041")) == 2
    assert rig.do("get drive_1.0x6040:00 drive_1.0x6041") == [
        "drive_1.0x6040:00  16  0x0010",
        "drive_1.0x6041:00  39  0x0027",
    ]
    rig.do("set drive_1.position 1.5 --typed")
    assert master.asked[-1] == "set --typed drive_1.position=1.5"


def test_list_names_whose_an_output_is(master, rig):
    rig.do("set drive_1.0x6040 6")
    with Client(master.path) as other:
        other.set({"drive_2.0x6040:00": 1})
        found = {line.split()[0]: line for line in rig.do("list")}
    assert found["drive_1.0x6040:00"].endswith("you")
    assert "client 2" in found["drive_2.0x6040:00"]
    assert found["logic.ack"].split()[-3:] == ["free", "restart", "relevant"]
    assert "input" in found["drive_1.0x6041:00"]
    assert "free" in found["out:drive_1.position"]
    assert "input" in found["in:drive_1.position"]
    assert rig.console.owned() == ["drive_1.0x6040:00"]


def test_an_input_and_an_output_of_one_name_are_never_mistaken(master, rig):
    rig.do("set drive_1.position 700")
    assert [line.split() for line in rig.do("get drive_1.position")] == [
        ["out:drive_1.position", "700"],
        ["in:drive_1.position", "0"],
    ]
    assert rig.do("get in:drive_1.position")[0].split() == ["in:drive_1.position", "0"]
    rig.do("set out:drive_1.position 9")
    assert master.outputs["drive_1.position"] == 9
    assert master.inputs["drive_1.position"] == 0
    assert rig.do("get in:drive_*")[-1].split() == ["in:drive_1.position", "0"]
    with pytest.raises(ConsoleError, match=r"drive_1\.position is an input and cannot be set"):
        rig.do("set in:drive_1.position 1")
    with pytest.raises(ConsoleError, match="selects inputs only"):
        rig.do("set in:drive_* 1")
    with pytest.raises(ConsoleError, match=r"no output is called drive_1\.0x6041"):
        rig.do("get out:drive_1.0x6041")
    seen = rig.do("watch drive_1.position every 10 for 100ms")
    assert "out:drive_1.position = 9  in:drive_1.position = 0" in seen[0]


def test_start_stop_restart(master, rig):
    assert rig.do("start") == ["already running"]
    assert rig.do("stop; stop; start; restart") == ["stopped", "already stopped", *["running"] * 2]
    assert [w for w in master.asked if w in ("start", "stop", "restart")] == [
        "stop",
        "start",
        "restart",
    ]
    master.refuse["stop"] = {"text": "no"}
    with pytest.raises(ControlRefused, match="stop: no"):
        rig.do("stop")


def test_observed_values(master, rig):
    assert rig.do("state") == [
        "running, cycle 1 ms, 5 cycles, working counter 9 of 9, 2 of 2 SubDevices in OP, "
        "1 of 1 connection in Data"
    ]
    assert rig.do("state drive_1") == [
        "drive_1  OP  alias 0 position 0",
        "c1  logic - drive_1  data_process  7 / 7 frames",
    ]
    assert len(rig.do("state all")) == 2
    assert rig.do("connections") == ["c1  logic - drive_1  data_process  7 / 7 frames"]
    with pytest.raises(ConsoleError, match="there are: drive_1, drive_2"):
        rig.do("state x")
    assert rig.do("incident a") == ["incident x.fsnincident"]
    master.send_event(event="wkc", text="gone")
    while not (told := rig.do("events")):
        pass
    assert told == ["U info gone"]


def test_device_commands_send_their_requests(master, rig, tmp_path):
    assert rig.do("sdo read drive_1 0x1c12:0a uint16") == ["drive_1 0x1c12:0a  551  2 bytes: 27 02"]
    rig.do("sdo write drive_1 0x6060 int8 -1")
    assert rig.do("sii drive_1")[1] == "0010  00 11 22 33 00 11 22 33 00 11 22 33 00 11 22 33"
    rig.do(f"sii drive_1 {tmp_path}/sii; alias drive_1 0x10")
    assert (tmp_path / "sii").stat().st_size == 32
    assert rig.do("history drive_1") == ["1  warning  0.003000 s  text 0x0010  7"]
    assert rig.do("scan")[1].split() == ["0", "?", "OP", "alias", "0", "0x00000001", "0x00000002"]
    assert [w for w in master.asked if w.startswith(("sdo", "alias"))] == [
        "sdo-read drive_1 0x1c12 10 uint16",
        "sdo-write drive_1 0x6060 0 int8 -1",
        "alias-write drive_1 16",
    ]


def test_watch_reports_cycles_and_those_left_out(master, rig):
    assert rig.do("watch drive_1.0x6041 every 10 for 300ms") == [
        "cycle 10  drive_1.0x6041:00 = 39",
        "cycle 20  drive_1.0x6041:00 = 39",
        "… 2 left out: this client or the recorder was too slow",
        "cycle 50  drive_1.0x6041:00 = 39",
    ]
    rig.do("state")
    assert "watch off" in master.asked
    rig.do("watch drive_1.0x6041 for 1ms")
    assert "watch 100 drive_1.0x6041:00" in master.asked  # ten a second


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("get", "usage: get NAME"),
        ("get drive_2.0x6042", "did you mean drive_2"),
        ("get logic.0x7000", "; logic has ack$"),  # no other index is guessed for a named output
        ("get x*", "like x"),
        ("set", "usage: set"),
        ("set drive_1.0x6040", "gets no value"),
        ("set all 0x9999 1", "no SubDevice has an output 0x9999"),
        ("set drive_*.0x6041 1", "inputs only"),
        ("get drive_1.0x6041 --type", "unknown option --type"),
        ("wait", "usage: wait"),
        ("wait 5", "not a time"),
        ("wait 1000h", "more than a week"),
        ("watch drive_1 every x", "no number of cycles"),
        ("sdo read drive_1", "usage: sdo"),
        ("sdo read drive_1 0x1018:100", "not a subindex"),
        ("alias drive_1 99999", "from 0 to 65535"),
        ("on-error x", "usage: on-error"),
        ("help nix", "unknown command nix"),
        ("stat", "did you mean state"),
        ("run /no/such", "No such file"),
        ("lease 999999", "from 0 to 600000"),
    ],
)
def test_mistakes_are_reported_with_the_next_step(rig, text, message):
    with pytest.raises(ConsoleError, match=message):
        rig.do(text)


def test_scripts_call_scripts(master, rig, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.fsn").write_text("run b.fsn # beside this one\n", "utf-8")
    (tmp_path / "sub" / "b.fsn").write_text("set drive_1 0x6040 5\n\n  get nothing\n")
    with pytest.raises(ConsoleError, match=r"b\.fsn:3:3: no input or output is called nothing"):
        rig.console.run_file(str(tmp_path / "sub" / "a.fsn"))
    assert master.outputs["drive_1.0x6040:00"] == 5
    (tmp_path / "loop").write_text(f"run {tmp_path}/loop")
    with pytest.raises(ConsoleError, match="inside each other"):
        rig.do(f"run {tmp_path}/loop")
    (tmp_path / "bad").write_bytes(b"\xff")
    with pytest.raises(ConsoleError, match="not UTF-8"):
        rig.do(f"run {tmp_path}/bad")


def test_a_script_names_where_it_failed(master, rig):
    with pytest.raises(ConsoleError, match=r"^s\.fsn:2:9: no input or ") as caught:
        rig.script("echo a\necho b; get nothing; echo c")
    assert not caught.value.is_usage
    assert rig.lines == ["a", "b"]


def test_nothing_is_done_when_a_word_is_not_a_command(master, rig):
    asked = list(master.asked)
    with pytest.raises(ConsoleError, match=r"^s\.fsn:3:2: unknown command sett") as caught:
        rig.script("set drive_1 0x6040 1\n\n sett x 1")
    assert caught.value.is_usage
    assert master.asked == asked


def test_a_script_may_go_on_after_failures(master, rig):
    rig.script("on-error continue\nget nothing\nset nix 1\necho end")
    assert rig.lines == ["end"]
    assert rig.console.failures == 2
    assert [n.partition(" ")[0] for n in rig.notes] == ["error:"] * 2
    assert rig.notes[1].startswith("error: s.fsn:3:1: ")


def test_the_lease_is_renewed_while_nothing_is_asked(master):
    rig = Rig(master.path, lease_ms=100)
    assert "lease 100" in master.asked
    for _ in range(3):
        master.renewed.clear()
        assert master.renewed.wait(PATIENCE_S)
    assert rig.do("lease 0") == ["lease without an end"]
    rig.link.close()


def test_a_slow_request_does_not_hold_the_lease_up(master):
    rig = Rig(master.path, lease_ms=100)
    renewed = rig.link.aside(
        lambda _: [master.renewed.clear(), master.renewed.wait(PATIENCE_S)][1],
    )
    assert renewed
    rig.link.close()


def test_a_script_ends_when_the_connection_breaks(master, rig):
    master.drop()
    with pytest.raises(EnvironmentFault, match=r"^s\.fsn:1:1: the connection to .* broke"):
        rig.script("wait 1h\nstate")
    with pytest.raises(EnvironmentFault):
        rig.script("state")


def test_the_prompt_connects_again(master):
    rig = Rig(master.path, reconnect=True)
    rig.do("set drive_1.0x6040 1")
    master.drop()
    with contextlib.suppress(EnvironmentFault):
        rig.do("state")  # this one, or the renewal before it, finds it broken
    rig.do("state")
    assert any("connected again" in note for note in rig.notes)
    assert rig.link.client_number == 2
    rig.link.close()


def test_outputs_that_fell_back_are_reported(master, rig):
    rig.do("set drive_1.0x6040 1 drive_1.position 5")
    master.send_event(event="fallback", outputs=["drive_2.0x6040:00"], text="others")
    mine = ["drive_1.0x6040:00", "drive_1.position", "drive_2.0x6040:00"]
    master.send_event(event="fallback", outputs=mine, text="late")
    while not rig.notes:
        rig.do("wait 1ms")
    assert rig.notes == ["U info late: drive_1.0x6040:00 drive_1.position"]


def test_every_command_has_help_and_an_example_that_parses(rig):
    listed = rig.do("help")
    assert [line.split()[0] for line in listed[:-1]] == list(COMMANDS)
    for name, form in COMMANDS.items():
        assert form.example.split()[0] == name
        assert parse(form.example)
        assert rig.do(f"help {name}")[2] == f"  example: {form.example}"


def test_quit_ends_the_console(rig):
    with pytest.raises(ConsoleEnd):
        rig.do("quit")


@pytest.mark.parametrize(
    ("before", "word", "found"),
    [
        ("", "sta", ["start", "state"]),
        ("state; ", "st", ["start", "state", "stop"]),
        ("get ", "drive_2.", ["drive_2.0x6040:00", "drive_2.0x6041:00"]),
        ("set ", "drive_2", ["drive_2", "drive_2.0x6040:00"]),
        ("set all ", "po", ["position"]),
        ("get ", "in", ["in:drive_1.position"]),
        ("state ", "d", ["drive_1", "drive_2"]),
        ("arm ", "", ["logic.ack"]),
        ("sdo ", "", ["read", "write"]),
        ("sdo read drive_1 0x1 ", "uint1", ["uint16"]),
        ("help ", "conn", ["connections"]),
        ("events ", "o", ["off", "on"]),
        ("watch a ", "e", ["every"]),
    ],
)
def test_word_is_completed(rig, before, word, found):
    names = rig.console.names()
    assert complete(before, word, names, list(COMMANDS)) == found


def test_names_are_asked_for_in_portions_a_request_can_hold():
    portions = list(batches(f"drive_{n}.0x6041:00" for n in range(1000)))
    assert sum(map(len, portions)) == 1000
    assert max(len(" ".join(p)) for p in portions) < 8000
    assert max(map(len, portions)) < 256


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("start now", "usage: start [for TIME]"),
        ("stop for", "usage: stop [for TIME]"),
        ("state a b", "usage: state [SUBDEVICE|all]"),
        ("state drive_9", "no SubDevice is called drive_9; there are: drive_1, drive_2"),
        ("connections x", "usage: connections"),
        ("snapshot x", "usage: snapshot"),
        ("sii", "usage: sii SUBDEVICE [FILE]"),
        ("sii 1 2 3", "usage: sii SUBDEVICE [FILE]"),
        ("sii 0 /no/such/file", "/no/such/file: No such file or directory"),
        ("alias a", "usage: alias SUBDEVICE ALIAS"),
        ("alias a b", "'b' is no alias; write 12 or 0x0c"),
        ("history a b", "usage: history SUBDEVICE"),
        ("scan x", "usage: scan"),
        ("list a b", "usage: list [PATTERN] [--typed]"),
        ("arm", "usage: arm NAME"),
        ("watch", "usage: watch NAME… [every N] [for TIME] [--typed]"),
        ("events maybe", "usage: events [on|off|for TIME]"),
        ("get", "usage: get NAME…|SUBDEVICE|all [--typed]"),
        ("set a", "a gets no value; set NAME VALUE"),
        ("lease x", "'x' is no lease in ms; write 12 or 0x0c"),
        ("release x", "unknown command release; did you mean lease?"),
    ],
)
def test_words_that_are_wrong(rig, line, message):
    with pytest.raises(ConsoleError) as caught:
        rig.do(line)
    if message is None:
        message = f"'up' is no state of fsn-master: {' '.join(BusState)}"
    assert str(caught.value) == message


def test_events_are_asked_for_and_no_longer(rig):
    assert rig.do("events on") == ["events on"]
    assert rig.do("events off") == ["events off"]


def test_problems_are_shown_with_the_state(monkeypatch):
    monkeypatch.setitem(STATUS, "fault", "the bus is lost")
    monkeypatch.setitem(SUBDEVICE, "al", "SAFEOP")
    with FakeMaster() as found:
        rig = Rig(found.path)
        first, fault, *rows = rig.do("state")
        rig.link.close()
    assert first.startswith("running, cycle 1 ms, 5 cycles, working counter 9 of 9")
    assert fault == "error: the bus did not open: the bus is lost"
    assert all("SAFEOP" in row for row in rows)
