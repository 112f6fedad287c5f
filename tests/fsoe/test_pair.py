"""A main and a sub together: sizes, chunk counts, enables, wrap, session ids, configuration."""

import dataclasses
import math
import random

import pytest
from fsoe.pair import Bench, counted, make_main, make_sub, parts, right
from hypothesis import given, settings
from hypothesis import strategies as st
from weekly import examples, first

from fsoe_net.errors import ConfigError
from fsoe_net.fsoe.chain import reset_frame
from fsoe_net.fsoe.crc import frame_crcs
from fsoe_net.fsoe.event import EventKind, State
from fsoe_net.fsoe.pdu import SAFE_SIZES, Command, decode_pdu

SIZES = sorted(SAFE_SIZES)


def _chunks(size: int, total: int) -> int:
    return math.ceil(total / size)


def _cycles_to_data(out: int, inn: int, app: bytes) -> tuple[int, dict[int, int]]:
    """FSoE cycles from the first Reset to the first data frame, and frames per command."""
    bench = Bench(out, inn, app)
    count: dict[int, int] = {}
    while bench.sub.state is not State.DATA:
        sent = bench.main_turn()
        count[sent[0]] = count.get(sent[0], 0) + 1
        assert bench.sub_turn() is not None
    return sum(count.values()), count


@pytest.mark.uncounted
@pytest.mark.parametrize("app", [b"", bytes(range(5)), bytes(range(64))], ids=len)
@pytest.mark.parametrize("out", SIZES)
def test_chunk_counts_of_all_size_pairs(out, app):
    for inn in SIZES:
        size = min(out, inn)
        total, count = _cycles_to_data(out, inn, app)
        assert count == {
            Command.RESET: 1,
            Command.SESSION: _chunks(size, 2),
            Command.CONNECTION: _chunks(size, 4),
            Command.PARAMETER: _chunks(size, 6 + len(app)),
            Command.FAIL_SAFE_DATA: 1,
        }
        assert total == sum(count.values())


@pytest.mark.parametrize(("size", "cycles"), [(1, 14), (2, 8), (4, 6), (6, 5), (126, 5)])
def test_known_cycle_counts(size, cycles):
    assert _cycles_to_data(size, size, b"")[0] == cycles


@pytest.mark.uncounted
@pytest.mark.parametrize("out", SIZES)
def test_process_data_of_all_size_pairs(out):
    for inn in SIZES:
        bench = Bench(out, inn).to_data()
        to_sub, to_main = random.Random(out).randbytes(out), random.Random(inn).randbytes(inn)
        bench.main.set_safe_data(to_sub)
        bench.sub.set_safe_data(to_main)
        bench.main.enable = bench.sub.enable = True
        for _ in range(3):
            bench.cycle()
        assert (bench.sub.data_valid, bench.sub.received_safe_data) == (True, to_sub)
        assert (bench.main.data_valid, bench.main.received_safe_data) == (True, to_main)
        assert not [e for e in bench.main.take_events() if e.code]


def test_start_up_has_the_known_frames():
    """The complete start-up of §2."""
    bench = Bench(
        main=make_main(ids=counted(0x1122), watchdog_ms=100), sub=make_sub(ids=counted(0x3344))
    )
    for _ in range(8):
        bench.cycle()
    assert [frame.hex() for frame in bench.log] == [
        *("2a0000c42d0000", "2a0000c42d0000", "4e2211fddd0000", "4e4433f5760000"),
        *("64cdabac4dcdab", "64cdab018dcdab", "6434121350cdab", "643412dd7acdab"),
        *("52020024d1cdab", "520200cb9fcdab", "526400d592cdab", "5264004a68cdab"),
        *("520000e008cdab", "520000f5eacdab", "08000099f9cdab", "0800005ac6cdab"),
    ]


def test_known_start_of_one_byte():
    bench = Bench(main=make_main(1, 1), sub=make_sub(1, 1))
    for _ in range(4):
        bench.cycle()
    assert [frame.hex() for frame in bench.log] == [
        *("2a0086f80000", "2a0086f80000", "4e224ec10000", "4e4459ee0000"),
        *("4e11e7470000", "4e33053c0000", "64cd1ed9cdab", "64cda842cdab"),
    ]


@pytest.mark.parametrize("sizes", first(1, [(6, 14), (2, 2), (1, 1)]))
@pytest.mark.uncounted
def test_long_run_wraps_and_collides(sizes):
    """Constant data for more than one turn of the sequence number, natural collisions included."""
    bench = Bench(*sizes).to_data()
    main, sub = bench.main, bench.sub
    main.enable = sub.enable = True
    main.set_safe_data(b"\x5a" * sizes[0])
    wraps = collisions = 0
    for _ in range(140_000):
        before = main._chain.tx_sequence
        bench.cycle()
        bench.log.clear()
        after = main._chain.tx_sequence
        wraps += after < before
        collisions += (after - before) % 65535 == 2
    assert main.state is State.DATA is sub.state
    assert sub.data_valid
    assert wraps == 2
    assert collisions > 0


def test_enable_is_cleared_by_resets_and_survives_a_start_out_of_reset():
    bench = Bench()
    bench.cycle()  # both in Reset
    bench.main.enable = bench.sub.enable = True
    bench.until(lambda: bench.sub.state is State.DATA)
    assert bench.log[-1][0] == bench.log[-2][0] == Command.PROCESS_DATA  # the very first ones
    assert bench.sub.data_valid
    bench.sub.request_reset()
    bench.sub_turn()
    assert not bench.sub.enable
    assert bench.main.enable
    bench.main_turn()
    assert not bench.main.enable
    bench.to_data()
    assert not bench.sub.data_valid


def test_events_tell_states_and_resets_by_whom():
    bench = Bench().to_data()
    states = [State.RESET, State.SESSION, State.CONNECTION, State.PARAMETER, State.DATA]
    for end in (bench.main, bench.sub):
        events = end.take_events()
        assert [e.state_after for e in events] == states
        assert [e.state_before for e in events] == [State.RESET, *states[:-1]]
        assert end.take_events() == []
    bench.now_ns = 5
    bench.sub.request_reset()
    bench.sub_turn()
    bench.main_turn()
    (event,) = bench.sub.take_events()
    assert (event.kind, event.code, event.now_ns) == (EventKind.RESET_LOCAL, 0, 5)
    assert (event.state_before, event.state_after) == (State.DATA, State.RESET)
    (event,) = bench.main.take_events()
    assert (event.kind, event.code) == (EventKind.RESET_BY_PEER, 0)
    assert (event.state_before, event.state_after) == (State.DATA, State.SESSION)


def test_events_do_not_pile_up():
    main = make_main()
    for _ in range(3000):
        main.request_reset()
        main.step(0, None)
    assert len(main.take_events()) == 1024


@pytest.mark.parametrize("who", ["main", "sub"])
def test_power_cycle_starts_the_connection_again(who):
    bench = Bench().to_data()
    bench.main.enable = bench.sub.enable = True
    bench.cycle()
    end = getattr(bench, who)
    end.power_cycle()
    assert (end.state, end.connection_id, end.enable) == (State.RESET, 0, False)
    assert (end.data_valid, end.take_events()) == (False, [])
    bench.until(lambda: bench.main.state is not State.DATA or bench.sub.state is not State.DATA)
    bench.to_data()


def test_session_ids_that_look_like_a_reset_are_drawn_again():
    """§11.3: CRC_0 of the first Session frame is neither 0 nor that of a Reset frame."""
    crcs = {decode_pdu(reset_frame(code, 2)).crcs[0] for code in range(12)} | {0}
    bad = [
        word
        for word in range(0x10000)
        if frame_crcs(0, 0, 1, 0x4E, word.to_bytes(2, "little"))[0] in crcs
    ]
    assert len(bad) == 13
    main = make_main(ids=iter([*bad, 0x4711]).__next__)
    main.step(0, None)
    assert parts(main.step(0, reset_frame(0, 2))).safe_data == b"\x11\x47"
    session = main._chain.last
    bad = [
        word
        for word in range(0x10000)
        if frame_crcs(session, 0, 1, 0x4E, word.to_bytes(2, "little"))[0] in crcs
    ]
    sub = make_sub(ids=iter([*bad, 0x4712]).__next__)
    bench = Bench(main=make_main(ids=iter([0x4711]).__next__), sub=sub)
    bench.until(lambda: sub.state is State.SESSION)
    assert parts(bench.to_main).safe_data == b"\x12\x47"
    assert bad
    constant = make_main(ids=lambda: bad[0])
    constant.step(0, None)
    assert constant.step(0, reset_frame(0, 2)) is not None  # a stubborn source is believed


@pytest.mark.parametrize("size", [1, 4])
def test_session_ids_of_other_sizes_that_look_like_a_reset(size):
    """It is CRC_0 that counts, and of one byte only what the first frame carries."""
    crcs = {decode_pdu(reset_frame(code, size)).crcs[0] for code in range(12)} | {0}

    def first_crc(word):
        data = word.to_bytes(2, "little")[:size].ljust(size, b"\0")
        return frame_crcs(0, 0, 1, 0x4E, data)[0]

    bad = [word for word in range(0x10000) if first_crc(word) in crcs]
    good = next(word for word in range(0x4711, 0x10000) if first_crc(word) not in crcs)
    main = make_main(size, size, ids=iter([*bad[:12], good]).__next__)
    main.step(0, None)
    sent = parts(main.step(0, reset_frame(0, size))).safe_data
    assert sent == good.to_bytes(2, "little")[:size].ljust(size, b"\0")


def test_first_session_reply_is_received_without_the_collision_rule():
    """§11.3: also when its CRC_0 is 0 or that of the Reset before."""
    for wanted in (0, decode_pdu(reset_frame(0, 2)).crcs[0]):
        bench = Bench()
        bench.until(lambda bench=bench: bench.main.state is State.SESSION)
        main = bench.main
        for word in range(0x10000):
            data = word.to_bytes(2, "little")
            if frame_crcs(main._chain.last, 0, 1, 0x4E, data)[0] == wanted:
                break
        assert parts(main.step(0, right(main, Command.SESSION, data))).command == 0x64


def test_new_ids_for_every_session():
    bench = Bench()
    seen = set()
    for _ in range(5):
        bench.to_data()
        seen.add((bench.main._chain.last, bench.sub._session_id))
        bench.main.request_reset()
        bench.cycle()
    assert len(seen) == 5


@pytest.mark.parametrize(
    ("field", "bad", "allowed"),
    [
        ("connection_id", (0, 65536, -1), "1 … 65535"),
        ("address", (-1, 65536), "0 … 65535"),
        ("watchdog_ms", (0, 65536), "1 … 65535"),
        ("safe_out_bytes", (0, 3, 127, 128, -2), "1, 2, 4, 6 … 126"),
        ("safe_in_bytes", (0, 5, 127, 128), "1, 2, 4, 6 … 126"),
        ("app_parameters", (bytes(65536),), "0 … 65535"),
    ],
)
def test_main_config_names_the_field(field, bad, allowed):
    good = make_main().config
    for value in bad:
        with pytest.raises(ConfigError) as caught:
            dataclasses.replace(good, **{field: value})
        assert field in str(caught.value)
        assert allowed in str(caught.value)


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        ("address", (-1, 65536)),
        ("safe_out_bytes", (0, 3, 127)),
        ("safe_in_bytes", (0, 5, 128)),
        ("app_parameter_bytes", (-1, 65536)),
    ],
)
def test_sub_config_names_the_field(field, bad):
    for value in bad:
        with pytest.raises(ConfigError, match=field):
            dataclasses.replace(make_sub().config, **{field: value})


def test_safe_data_of_another_size_is_refused():
    with pytest.raises(ConfigError, match="4 safe data bytes given; this end sends 2"):
        make_main(2, 4).set_safe_data(bytes(4))
    with pytest.raises(ConfigError, match="2 safe data bytes given; this end sends 4"):
        make_sub(2, 4).set_safe_data(bytes(2))


IMAGE = st.one_of(st.none(), st.binary(max_size=20), st.binary(min_size=7, max_size=7))


@settings(max_examples=examples(200), deadline=None)
@given(st.integers(0, 30), st.sampled_from([1, 2, 6]), st.data())
@pytest.mark.uncounted
def test_no_bytes_ever_raise(cycles, size, data):
    """Noise, right commands with noise, bits turned in good frames: one frame or none comes out."""
    bench = Bench(size, size)
    for _ in range(cycles):
        bench.cycle()
    now_ns = 0
    for _ in range(12):
        end, good = data.draw(
            st.sampled_from([(bench.main, bench.to_main), (bench.sub, bench.to_sub)])
        )
        noise = data.draw(st.one_of(IMAGE, st.binary(min_size=end._rx_bytes, max_size=300)))
        if good is not None and data.draw(st.booleans()):
            at = data.draw(st.integers(0, len(good) - 1))
            noise = good[:at] + data.draw(st.binary(min_size=1, max_size=1)) + good[at + 1 :]
        now_ns += data.draw(st.integers(0, 30_000_000))
        answer = end.step(now_ns, noise)
        assert answer is None or len(answer) == len(reset_frame(0, size))
        assert end.data_valid is False or end.state is State.DATA
        assert end.data_valid or not any(end.received_safe_data)


@pytest.mark.parametrize("length", [0, 1, 3, 5, 6, 8, 11, 255, 4000])
def test_frames_of_a_wrong_length_are_not_event(length):
    bench = Bench().to_data()
    before = (bench.main._chain.last, bench.sub._chain.last)
    for end in (bench.main, bench.sub):
        good = end._seen
        assert end.step(0, (good * 600)[:length]) is None
        assert end.state is State.DATA
        assert end._seen == good
    assert before == (bench.main._chain.last, bench.sub._chain.last)


def test_an_empty_image_is_not_an_event_until_something_came():
    main, sub = make_main(), make_sub()
    main.step(0, None)
    assert main.step(1, bytes(7)) is None
    assert sub.step(1, bytes(7)) is None
    bench = Bench().to_data()
    assert bench.sub.step(1, bytes(7)) == reset_frame(2, 2)


@pytest.mark.parametrize("kind", [bytearray, memoryview])
def test_images_may_be_views(kind):
    bench = Bench()
    for _ in range(20):
        sent = bench.main.step(0, bench.to_main and kind(bench.to_main))
        bench.to_main = bench.sub.step(0, sent and kind(sent)) or bench.to_main
    assert bench.main.state is State.DATA is bench.sub.state
