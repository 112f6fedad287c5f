"""Where safe data lie in a frame, and how they are named."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulate.bench import ESTOP, ROBOT, bench

from fsoe_net.model.signals import Signal, write_bits
from fsoe_net.simulate.bus import normal_name


def test_names_of_a_small_device():
    network = bench(ESTOP).network
    assert sorted(network.safe_inputs) == ["ek1914.0x6001:01", "ek1914.0x6001:02"]
    assert sorted(network.safe_outputs) == ["ek1914.0x7001:01", "ek1914.0x7001:02"]


def test_entries_after_a_crc_have_their_place_in_the_safe_data():
    """Drive frame, 31 bytes: word 2 of the safe data is the position behind two CRCs."""
    sends = bench(ROBOT).network.subs["el6910-drive_1"].sends
    places = {name.partition(".")[2]: (s.bit, s.bits) for name, s in sends.items()}
    assert places["0x6640:00"] == (0, 1)
    assert places["0x6668:01"] == (3, 1)
    assert places["0x6690:04"] == (15, 1)
    assert places["0x6630:00"] == (16, 1)
    assert places["0x6611:00"] == (32, 16)
    assert places["0x6613:00"] == (64, 16)
    assert places["0x2605:03"] == (96, 16)


def test_command_crc_and_connection_id_are_not_safe_data():
    sends = bench(ROBOT).network.subs["el6910-drive_1"].sends
    objects = {name.partition(".")[2].partition(":")[0] for name in sends}
    assert not objects & {"0x6760", "0x6768", "0x0000"}


def test_both_ends_agree_where_a_signal_is():
    network = bench(ROBOT).network
    for name, main in network.mains.items():
        sub = network.subs[name]
        assert main.receives == sub.sends
        assert main.sends == sub.receives


def test_default_logic_leaves_drive_status_out():
    names = [f"el1904.0x6001:0{n}" for n in (1, 2, 3, 4)]
    assert bench(ROBOT).network.default_inputs() == names


@pytest.mark.parametrize("text", ["ek1914.0x6001:01", "ek1914.6001:1", "ek1914.0x6001:0x1"])
def test_spellings_of_one_name(text: str):
    assert normal_name(text) == "ek1914.0x6001:01"


def test_a_name_that_is_none_stays_as_it_is():
    assert normal_name("ek1914.input_1") == "ek1914.input_1"


@given(
    data=st.binary(min_size=1, max_size=14),
    bit=st.integers(0, 100),
    bits=st.integers(1, 32),
    value=st.integers(0, 2**32 - 1),
)
def test_writing_changes_these_bits_and_no_others(data: bytes, bit: int, bits: int, value: int):
    total = 8 * len(data)
    bit %= total
    bits = min(bits, total - bit)
    signal = Signal(name="x", index=1, subindex=1, bit=bit, bits=bits)
    target = bytearray(data)
    signal.write(target, value)
    assert len(target) == len(data)
    assert signal.read(target) == value & ((1 << bits) - 1)
    write_bits(target, bit, bits, signal.read(data))
    assert target == data
