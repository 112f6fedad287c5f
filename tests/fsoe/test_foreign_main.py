"""A third party's main talks to our sub: optional, only when `fsoe_master` is installed.

Its licence is non-commercial, so it is never a dependency; only its public interface is used.
"""

import pytest
from fsoe.pair import ADDRESS, CONNECTION_ID, make_sub

from fsoe_net.fsoe import State, decode_pdu

foreign = pytest.importorskip("fsoe_master.fsoe_master", reason="fsoe_master is not installed")


@pytest.fixture
def make_foreign():
    """Mains of the package; each runs a thread that must be ended."""
    made = []

    def make(out_words, in_words):
        kind = foreign.DictionaryItem.DataTypes.UINT16
        outs = [
            foreign.DictionaryItemOutput(key=n, name=f"out {n}", data_type=kind)
            for n in range(out_words)
        ]
        ins = [
            foreign.DictionaryItemInput(
                key=100 + n, name=f"in {n}", data_type=kind, fail_safe_value=0
            )
            for n in range(in_words)
        ]
        main = foreign.MasterHandler(
            dictionary=foreign.Dictionary([*outs, *ins]),
            slave_address=ADDRESS,
            connection_id=CONNECTION_ID,
            watchdog_timeout_s=30.0,
            application_parameters=[],
        )
        made.append(main)
        for item in outs:
            main.master.dictionary_map.add(item)
        for item in ins:
            main.slave.dictionary_map.add(item)
        return main, outs, ins

    yield make
    for main in made:
        main.delete()


@pytest.mark.parametrize(("out_words", "in_words"), [(1, 1), (2, 1), (1, 3), (8, 8)])
def test_foreign_main_with_our_sub(make_foreign, out_words, in_words):
    main, outs, ins = make_foreign(out_words, in_words)
    sub = make_sub(2 * out_words, 2 * in_words)
    main.start()
    commands = set()

    def cycle(now_ns):
        answer = sub.step(now_ns, bytes(main.get_request()))
        if answer is not None:
            commands.add(decode_pdu(answer).command)
            main.set_reply(answer)

    for _ in range(60):
        cycle(0)
    assert sub.state is State.DATA
    assert {0x2A, 0x4E, 0x64, 0x52, 0x08} <= commands
    assert not sub.data_valid
    main.set_fail_safe(False)
    sub.enable = True
    for n, item in enumerate(outs):
        item.set(0x1100 + n)
    sub.set_safe_data(b"".join((0x2200 + n).to_bytes(2, "little") for n in range(in_words)))
    for _ in range(2000):
        cycle(0)
    assert sub.state is State.DATA
    assert sub.data_valid
    words = [0x1100 + n for n in range(out_words)]
    assert sub.received_safe_data == b"".join(word.to_bytes(2, "little") for word in words)
    assert [item.get() for item in ins] == [0x2200 + n for n in range(in_words)]
