"""Frames, CRCs and texts: known answers and properties."""

import json

import pytest
from data_files import need
from hypothesis import given, settings
from hypothesis import strategies as st

from fsoe_net.errors import FsoeError, PduSizeError
from fsoe_net.fsoe.chain import fits_start, reset_frame
from fsoe_net.fsoe.crc import block_crc, frame_crcs, sra_crc
from fsoe_net.fsoe.pdu import (
    SAFE_SIZES,
    Command,
    Pdu,
    decode_pdu,
    describe,
    frame_length,
    is_frame_length,
    reset_code_text,
    safe_data_length,
    safe_data_of,
)
from fsoe_net.self_test.model import reference

KNOWN = reference()["crc"]
WORD = st.integers(0, 0xFFFF)
SAFE_DATA = st.sampled_from(sorted(SAFE_SIZES)).flatmap(
    lambda size: st.binary(min_size=size, max_size=size)
)


@st.composite
def pdus(draw):
    data = draw(SAFE_DATA)
    blocks = (len(data) + 1) // 2
    return Pdu(
        command=draw(st.integers(0, 255)),
        safe_data=data,
        crcs=tuple(draw(st.lists(WORD, min_size=blocks, max_size=blocks))),
        connection_id=draw(WORD),
    )


@pytest.mark.shows("R17")
@pytest.mark.parametrize("row", KNOWN["reset_frames"], ids=lambda row: row["frame"])
def test_reset_frames_have_the_known_bytes(row):
    assert reset_frame(row["code"], row["safe_bytes"]).hex() == row["frame"]
    assert fits_start(decode_pdu(bytes.fromhex(row["frame"])))


def test_other_frame_lengths_are_rejected():
    assert sorted(SAFE_SIZES)[:4] == [1, 2, 4, 6]
    assert len(SAFE_SIZES) == 64
    lengths = {frame_length(size): size for size in SAFE_SIZES}
    assert max(lengths) == 255
    for n in range(-3, 300):
        assert is_frame_length(n) is (n in lengths)
        if n in lengths:
            assert safe_data_length(n) == lengths[n]
        else:
            with pytest.raises(PduSizeError, match=f"^{n} bytes"):
                safe_data_length(n)


@pytest.mark.parametrize("size", [-2, 0, 3, 5, 7, 125, 127, 128])
def test_no_frame_carries_these(size):
    with pytest.raises(PduSizeError, match=f"^{size} safe data bytes"):
        frame_length(size)


def test_codec_places_bytes():
    frame = bytes(range(0x36, 0x36 + 11))
    pdu = decode_pdu(frame)
    assert pdu.command == Command.PROCESS_DATA
    assert pdu.safe_data == bytes((0x37, 0x38, 0x3B, 0x3C))
    assert pdu.crcs == (0x3A39, 0x3E3D)
    assert pdu.connection_id == 0x403F


@settings(deadline=None)
@given(pdus())
def test_encoded_pdu_is_decoded_to_itself(pdu):
    frame = pdu.encode()
    assert len(frame) == frame_length(len(pdu.safe_data))
    assert decode_pdu(frame) == pdu
    assert safe_data_of(frame) == pdu.safe_data
    assert "\n" not in describe(pdu)


@settings(deadline=None)
@given(st.binary(max_size=260))
def test_decoded_frame_is_encoded_to_itself(frame):
    if is_frame_length(len(frame)):
        assert decode_pdu(frame).encode() == frame
    else:
        with pytest.raises(PduSizeError):
            decode_pdu(frame)


@pytest.mark.shows("R17")
@settings(deadline=None)
@given(WORD, WORD, WORD, st.integers(0, 255), SAFE_DATA)
def test_fast_crcs_are_those_of_the_blocks(old, connection_id, sequence, command, data):
    assert frame_crcs(old, connection_id, sequence, command, data) == tuple(
        block_crc(old, connection_id, sequence, command, block, data[2 * block : 2 * block + 2])
        for block in range((len(data) + 1) // 2)
    )


def test_two_chains_can_share_a_crc():
    """§2: old CRC and number pass through 16 bits, so more blocks do not guard the chain."""
    data = bytes(range(8))
    assert frame_crcs(0x9999, 5, 77, 0x36, data) == frame_crcs(0x1234, 5, 64258, 0x36, data)


@pytest.mark.parametrize(
    "pdu",
    [
        Pdu(command=256, safe_data=b"\0", crcs=(0,), connection_id=0),
        Pdu(command=1, safe_data=b"\0", crcs=(0,), connection_id=-1),
        Pdu(command=1, safe_data=b"\0\0", crcs=(0x10000,), connection_id=0),
        Pdu(command=1, safe_data=b"\0\0", crcs=(), connection_id=0),
        Pdu(command=1, safe_data=b"\0\0\0", crcs=(0, 0), connection_id=0),
    ],
)
def test_encoding_the_impossible(pdu):
    with pytest.raises(FsoeError):
        pdu.encode()


def test_each_reset_code_has_its_own_text():
    texts = [reset_code_text(code) for code in range(14)]
    assert len(set(texts[:10])) == 10
    assert all(text for text in texts)
    assert describe(decode_pdu(reset_frame(4, 2))) == "Reset(4: wrong CRC) 04 00 ConnID 0 CRC 34a6"
    assert describe(decode_pdu(bytes(6))) == "command 0x00 00 ConnID 0 CRC 0000"
    assert reset_code_text(0x80) == "device-specific code 0x80"
    assert reset_code_text(12) == "unknown code 12"
    assert len({reset_code_text(code) for code in range(256)}) == 256


@pytest.mark.shows("R17")
def test_sra_known_answers():
    for row in KNOWN["sra"]:
        assert f"{sra_crc(bytes.fromhex(row['data'])):08x}" == row["crc"]


@pytest.mark.shows("R17")
def test_sra_crc_has_the_known_values():
    vectors = json.loads(need("traces", "sra_crc.json").read_text("utf-8"))["vectors"]
    assert vectors
    for vector in vectors:
        crc = sra_crc(bytes.fromhex(vector["data"]), int(vector["crc_in"], 16))
        assert f"{crc:08x}" == vector["crc_out"]


@settings(deadline=None)
@given(st.binary(max_size=40), st.binary(max_size=40))
def test_sra_continues(first, second):
    assert sra_crc(second, sra_crc(first)) == sra_crc(first + second)
