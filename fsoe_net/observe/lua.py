"""Writes a Wireshark dissector for the FSoE frames of one network."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fsoe_net.fsoe import Command, ResetCode, command_text, reset_code_text
from fsoe_net.model import Resolution, Signal
from fsoe_net.observe.names import Naming
from fsoe_net.observe.wire import LogicalImage
from fsoe_net.plan import Plan

__all__ = ["lua_dissector"]


@dataclass(frozen=True, slots=True)
class _Block:
    address: int
    size_bytes: int
    is_input: bool
    direction: int
    place: str


def lua_dissector(resolution: Resolution, plan: Plan) -> str:
    """Return the Lua source of a postdissector.

    It finds the frames at the logical addresses that the IgH MainDevice gives them; a preference
    shifts all of them. CRCs are checked as far as one frame allows: blocks against each other, and
    a Reset as a whole; the chain is what ``fsoe-net decode`` follows.

    Args:
        resolution: A network without errors.
        plan: Its plan.
    """
    image = LogicalImage(plan)
    naming = Naming(resolution, image)
    fields: list[str] = []
    connections = []
    for number, (connection, names) in enumerate(
        zip(resolution.connections, naming.connections, strict=True), start=1
    ):
        blocks = []
        for direction, transfer in enumerate((connection.to_sub, connection.to_main)):
            for end, is_input in ((transfer.source, True), (transfer.destination, False)):
                address = image.address(end)
                if address is not None:
                    place = f"{end.endpoint.module} {'inputs' if is_input else 'outputs'}"
                    size = transfer.transfer.size_bytes
                    blocks.append(_Block(address, size, is_input, direction, place))
        rows = [_signals(number, d, names.signals[d], fields) for d in (0, 1)]
        connections.append(_connection(names.name, names.ends, blocks, rows))
    return _TEMPLATE.format(
        name=_quoted(resolution.network.name),
        commands=_table({int(c): command_text(int(c)) for c in Command}),
        codes=_table({int(c): reset_code_text(int(c)) for c in ResetCode}),
        fields="".join(fields),
        connections="".join(connections),
    )


def _signals(number: int, direction: int, signals: tuple[Signal, ...], fields: list[str]) -> str:
    rows = []
    for s in signals:
        text = s.label or s.name.partition(".")[2]
        word = re.sub(r"[^a-z0-9]+", "_", s.name.lower()).strip("_")
        abbreviation = f"fsoe.c{number}.{('to_sub', 'to_main')[direction]}.{word}"
        fields.append(f"add_field({_quoted(abbreviation)}, {_quoted(text)})\n")
        rows.append(f"{{{_quoted(abbreviation)}, {s.bit}, {s.bits}}}")
    return "{" + ", ".join(rows) + "}"


def _connection(name: str, ends: tuple[str, str], blocks: list[_Block], signals: list[str]) -> str:
    rows = "".join(
        f"    {{{b.address}, {b.size_bytes}, {str(b.is_input).lower()}, {b.direction}, "
        f"{_quoted(b.place)}}},\n"
        for b in blocks
    )
    arrows = (f"{ends[0]} -> {ends[1]}", f"{ends[1]} -> {ends[0]}")
    return (
        f"  {{name = {_quoted(name)},\n"
        f"   arrows = {{[0] = {_quoted(arrows[0])}, [1] = {_quoted(arrows[1])}}},\n"
        f"   signals = {{[0] = {signals[0]},\n              [1] = {signals[1]}}},\n"
        f"   blocks = {{\n{rows}   }}}},\n"
    )


def _table(texts: dict[int, str]) -> str:
    return "{" + ", ".join(f"[{n}] = {_quoted(t)}" for n, t in texts.items()) + "}"


def _quoted(text: str) -> str:
    """Return a Lua string literal; what is not printable ASCII goes as its UTF-8 bytes."""
    parts = []
    for byte in text.encode("utf-8", "replace"):
        char = chr(byte)
        if char in '"\\':
            parts.append("\\" + char)
        elif 0x20 <= byte < 0x7F:
            parts.append(char)
        else:
            parts.append(f"\\{byte:03d}")
    return '"' + "".join(parts) + '"'


_TEMPLATE = """\
-- FSoE frames of one network, for Wireshark and tshark: wireshark -X lua_script:THIS_FILE
-- Written by fsoe-net from the network file; write it anew when that changes.
-- Looks at frames only. Compared with independent implementations, not checked against ETG.5100.
local bit = bit or bit32
local NETWORK = {name}
local COMMANDS = {commands}
local CODES = {codes}

local fsoe = Proto("fsoe", "Safety over EtherCAT (" .. NETWORK .. ")")
local f = fsoe.fields
f.connection = ProtoField.string("fsoe.connection", "Connection")
f.direction = ProtoField.string("fsoe.direction", "Direction")
f.place = ProtoField.string("fsoe.place", "Seen in")
f.command = ProtoField.uint8("fsoe.command", "Command", base.HEX, COMMANDS)
f.reset_code = ProtoField.uint8("fsoe.reset_code", "Reset code", base.DEC, CODES)
f.safe_data = ProtoField.bytes("fsoe.safe_data", "Safe data")
f.crc = ProtoField.uint16("fsoe.crc", "CRC", base.HEX)
f.crc_text = ProtoField.string("fsoe.crc.verdict", "CRC verdict")
f.conn_id = ProtoField.uint16("fsoe.conn_id", "ConnID", base.DEC)
f.new = ProtoField.bool("fsoe.new", "New frame")
local signal_fields = {{}}
local function add_field(abbreviation, text)
  signal_fields[abbreviation] = ProtoField.uint64(abbreviation, text)
  f[abbreviation] = signal_fields[abbreviation]
end
{fields}
-- address, bytes, input of the MainDevice, direction, place
local CONNECTIONS = {{
{connections}}}

fsoe.prefs.base = Pref.uint("Logical address of the image", 0, "added to every address")

local function crc_byte(crc, byte)
  crc = bit.bxor(crc, byte * 256)
  for _ = 1, 8 do
    crc = crc * 2
    if crc >= 65536 then crc = bit.bxor(crc, 0x139B7) end
  end
  return crc
end

local function crc_of(bytes)
  local crc = 0
  for _, byte in ipairs(bytes) do crc = crc_byte(crc, byte) end
  return crc
end

local function shift_back(crc, bits)
  for _ = 1, bits do
    if crc % 2 == 1 then crc = bit.bxor(crc, 0x139B7) end
    crc = math.floor(crc / 2)
  end
  return crc
end

-- Whether the CRCs fit old CRC 0 and sequence number 1: a Reset, or a main's first Session.
local function fits_start(t, n, blocks)
  local id_low, id_high, command = t(n - 2, 1):uint(), t(n - 1, 1):uint(), t(0, 1):uint()
  for i = 0, blocks - 1 do
    local bytes = {{0, 0, id_low, id_high, 1, 0, command}}
    if i > 0 then bytes[#bytes + 1] = i; bytes[#bytes + 1] = 0 end
    bytes[#bytes + 1] = t(1 + 4 * i, 1):uint()
    if n > 6 then bytes[#bytes + 1] = t(2 + 4 * i, 1):uint() end
    for _ = 1, 3 do bytes[#bytes + 1] = 0 end
    if crc_of(bytes) ~= t(n == 6 and 2 or 3 + 4 * i, 2):le_uint() then return false end
  end
  return true
end

-- Whether the blocks fit each other; the first one gives the register after the command.
local function blocks_fit(t, blocks)
  local head = bit.bxor(t(3, 2):le_uint(), crc_of({{t(1, 1):uint(), t(2, 1):uint(), 0, 0, 0}}))
  head = shift_back(head, 40)
  for i = 1, blocks - 1 do
    local crc = crc_byte(crc_byte(head, i), 0)
    for _, byte in ipairs({{t(1 + 4 * i, 1):uint(), t(2 + 4 * i, 1):uint(), 0, 0, 0}}) do
      crc = crc_byte(crc, byte)
    end
    if crc ~= t(3 + 4 * i, 2):le_uint() then return false end
  end
  return true
end

local function crc_verdict(t, n, blocks)
  if t(0, 1):uint() == 0x2A then return fits_start(t, n, blocks) and "right" or "wrong" end
  if blocks > 1 and not blocks_fit(t, blocks) then return "wrong" end
  return blocks > 1 and "blocks fit each other" or "needs the frame before"
end

local function bits_of(data, first, count)
  local value = UInt64(0)
  for i = count - 1, 0, -1 do
    local at = first + i
    local byte = data:get_index(math.floor(at / 8))
    value = value:lshift(1):bor(UInt64(math.floor(byte / 2 ^ (at % 8)) % 2))
  end
  return value
end

local last, is_new = {{}}, {{}}

local function dissect_frame(t, pinfo, tree, connection, block, key)
  local n, direction = block[2], block[4]
  local command = t(0, 1):uint()
  local blocks = n == 6 and 1 or (n - 3) / 4
  if not pinfo.visited then
    local hex = t:bytes():tohex()
    is_new[pinfo.number .. "/" .. key] = hex ~= last[key]
    last[key] = hex
  end
  local new = is_new[pinfo.number .. "/" .. key] or false
  local text = (COMMANDS[command] or string.format("command 0x%02x", command))
  if command == 0x2A then text = text .. " " .. t(1, 1):uint() end
  local sub = tree:add(fsoe, t(), "FSoE " .. connection.arrows[direction] .. ": " .. text)
  sub:add(f.connection, connection.name):set_generated()
  sub:add(f.direction, connection.arrows[direction]):set_generated()
  sub:add(f.place, block[5]):set_generated()
  sub:add(f.new, new):set_generated()
  sub:add(f.command, t(0, 1))
  if command == 0x2A then sub:add(f.reset_code, t(1, 1)) end
  local data = ByteArray.new()
  for i = 0, blocks - 1 do
    local size = n == 6 and 1 or 2
    data:append(t(1 + 4 * i, size):bytes())
    sub:add_le(f.crc, t(1 + size + 4 * i, 2))
  end
  sub:add(f.safe_data, t(1, n - 3), data:raw()):set_generated()
  sub:add(f.crc_text, crc_verdict(t, n, blocks)):set_generated()
  sub:add_le(f.conn_id, t(n - 2, 2))
  if command == 0x36 then
    for _, s in ipairs(connection.signals[direction]) do
      sub:add(signal_fields[s[1]], bits_of(data, s[2], s[3])):set_generated()
    end
  end
  return new and text or nil
end

local function dissect_datagram(tvb, at, size, address, counter, pinfo, tree, texts)
  for c, connection in ipairs(CONNECTIONS) do
    for b, block in ipairs(connection.blocks) do
      local start = block[1] + fsoe.prefs.base - address
      local fits = start >= 0 and start + block[2] <= size
      -- On the way out the inputs are old.
      if fits and not (block[3] and counter == 0) and tvb(at + start, 1):uint() ~= 0 then
        local t = tvb(at + start, block[2]):tvb()
        local way = counter == 0 and "out" or "back"
        local text = dissect_frame(t, pinfo, tree, connection, block, c .. "." .. b .. way)
        if text then texts[#texts + 1] = connection.arrows[block[4]] .. ": " .. text end
      end
    end
  end
end

function fsoe.dissector(tvb, pinfo, tree)
  local at = 12
  while tvb:len() >= at + 6 and tvb(at, 2):uint() == 0x8100 do at = at + 4 end
  if tvb:len() < at + 4 or tvb(at, 2):uint() ~= 0x88A4 then return end
  at = at + 4
  local texts, more = {{}}, true
  while more and tvb:len() >= at + 12 do
    local command, flags = tvb(at, 1):uint(), tvb(at + 6, 2):le_uint()
    local size = flags % 2048
    more = flags >= 32768
    if tvb:len() < at + 12 + size then return end
    if command >= 10 and command <= 12 then
      local counter = tvb(at + 10 + size, 2):le_uint()
      local address = tvb(at + 2, 4):le_uint()
      dissect_datagram(tvb, at + 10, size, address, counter, pinfo, tree, texts)
    end
    at = at + 12 + size
  end
  if #texts > 0 then pinfo.cols.info:append(" | FSoE " .. table.concat(texts, "; ")) end
end

register_postdissector(fsoe)
"""
