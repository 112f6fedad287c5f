-- The CRC of FSoE: CRC-16, polynomial 0x139B7, start 0. Wireshark 4.0 brings Lua 5.2 and 4.4 Lua 5.4,
-- which have no bit operation in common, so XOR is a table.
local floor, byte, char = math.floor, string.byte, string.char

local XOR = {}
for a = 0, 255 do
  XOR[a] = {}
  for b = 0, 255 do
    XOR[a][b] = a == 0 and b or 2 * XOR[floor(a / 2)][floor(b / 2)] + (a + b) % 2
  end
end

local function xor(a, b)
  return 256 * XOR[floor(a / 256)][floor(b / 256)] + XOR[a % 256][b % 256]
end

local CRC_HIGH, CRC_LOW = {}, {}
for value = 0, 255 do
  local crc = value * 256
  for _ = 1, 8 do
    crc = crc < 0x8000 and 2 * crc or xor(2 * crc - 0x10000, 0x39B7)
  end
  CRC_HIGH[value], CRC_LOW[value] = floor(crc / 256), crc % 256
end

local function crc_over(crc, bytes)
  local high, low = floor(crc / 256), crc % 256
  for i = 1, #bytes do
    local index = XOR[high][byte(bytes, i)]
    high, low = XOR[low][CRC_HIGH[index]], CRC_LOW[index]
  end
  return 256 * high + low
end

local function word(value)
  return char(value % 256, floor(value / 256))
end

-- Frames ---------------------------------------------------------------------------------------
local RESET, SESSION, PROCESS_DATA, FAIL_SAFE_DATA = 0x2A, 0x4E, 0x36, 0x08

-- Takes a frame apart: command, data of each block, CRC of each block, ConnID.
local function decode(raw)
  local size = #raw == 6 and 1 or 2
  local pdu = {command = byte(raw), blocks = {}, crcs = {}}
  for at = 2, #raw - 4, 4 do
    local low, high = byte(raw, at + size, at + size + 1)
    pdu.blocks[#pdu.blocks + 1] = raw:sub(at, at + size - 1)
    pdu.crcs[#pdu.crcs + 1] = low + 256 * high
  end
  local low, high = byte(raw, #raw - 1, #raw)
  pdu.id = low + 256 * high
  return pdu
end

local function frame_crcs(old, pdu, sequence)
  local head = crc_over(0, word(old) .. word(pdu.id) .. word(sequence) .. char(pdu.command))
  local crcs = {}
  for i, data in ipairs(pdu.blocks) do
    crcs[i] = crc_over(head, (i > 1 and word(i - 1) or "") .. data .. "\0\0\0")
  end
  return crcs
end

local function same_crcs(a, b)
  for i = 1, #a do
    if a[i] ~= b[i] then return false end
  end
  return true
end

local function fits_start(pdu)
  return same_crcs(frame_crcs(0, pdu, 1), pdu.crcs)
end

-- Returns the one sequence number that makes the first CRC right, see `solve_sequence` of fsoe-net.
local function solve_sequence(old, pdu)
  local rest = xor(pdu.crcs[1], frame_crcs(old, pdu, 0)[1])
  for _ = 1, 16 + 8 * (4 + #pdu.blocks[1]) do
    rest = rest % 2 == 0 and floor(rest / 2) or floor(xor(rest, 0x39B7) / 2) + 0x8000
  end
  return rest % 256 * 256 + floor(rest / 256)
end

local function advance(sequence)
  return sequence == 0xFFFF and 1 or sequence + 1
end

-- The chain of one connection, as `Monitor` of fsoe-net follows it -------------------------------
local RIGHT, WRONG, UNCHECKED = 1, 2, 3
local VERDICTS = {"right", "wrong", "unchecked"}
local STATES = {
  [0] = "silent", "reset", "session", "connection", "parameter", "data failsafe", "data process",
  "unknown",
}

local function set_numbers(chain, sequence)
  for direction = 0, 1 do
    local side = chain[direction]
    side.own, side.sequence, side.guess = nil, sequence, 0
  end
end

local function new_chain()
  local chain = {last_crc = 0, [0] = {command = 0}, [1] = {command = 0}}
  set_numbers(chain, 0)
  return chain
end

local function restart(chain)
  set_numbers(chain, 1)
  chain.last_crc, chain.last_direction = 0, nil
end

local function accept(chain, direction, crc, sequence)
  local side = chain[direction]
  side.own, side.sequence = crc, advance(sequence)
  chain.last_crc, chain.last_direction = crc, direction
end

local function fits(chain, direction, pdu)
  local side = chain[direction]
  local sequence = side.sequence
  local crcs = frame_crcs(chain.last_crc, pdu, sequence)
  if crcs[1] == side.own then -- collision rule
    sequence = advance(sequence)
    crcs = frame_crcs(chain.last_crc, pdu, sequence)
  end
  if not same_crcs(crcs, pdu.crcs) then return false end
  accept(chain, direction, crcs[1], sequence)
  return true
end

local function lose(chain, direction, pdu)
  set_numbers(chain, 0)
  chain[direction].own = pdu.crcs[1]
  chain.last_crc, chain.last_direction = pdu.crcs[1], direction
end

local function continues(chain, side, pdu, sequence)
  if side.guess == 0 or sequence == side.guess then return side.guess ~= 0 end
  local collides = frame_crcs(chain.last_crc, pdu, side.guess)[1] == side.own
  return collides and sequence == advance(side.guess)
end

-- Two successive numbers of one direction show that the chain was found.
local function search(chain, direction, pdu)
  local side = chain[direction]
  local sequence = chain.last_direction and solve_sequence(chain.last_crc, pdu) or 0
  local whole = sequence == 0
    or same_crcs(frame_crcs(chain.last_crc, pdu, sequence), pdu.crcs)
  local found = whole and sequence ~= 0 and continues(chain, side, pdu, sequence)
  side.own, side.guess = pdu.crcs[1], whole and sequence ~= 0 and advance(sequence) or 0
  chain.last_crc, chain.last_direction = pdu.crcs[1], direction
  if not whole then return WRONG end
  if not found then return UNCHECKED end
  side.sequence, side.guess = side.guess, 0
  return RIGHT
end

local function judge_session(chain, direction, pdu)
  local known = chain[direction].sequence ~= 0
  if known and fits(chain, direction, pdu) then return RIGHT end
  if direction == 0 and fits_start(pdu) then
    restart(chain)
    accept(chain, 0, pdu.crcs[1], 1)
    return RIGHT
  end
  if known then return WRONG end
  chain.last_crc, chain.last_direction = pdu.crcs[1], direction
  return UNCHECKED
end

local function judge(chain, direction, pdu)
  if pdu.command == RESET then
    restart(chain)
    return pdu.id == 0 and fits_start(pdu) and RIGHT or WRONG
  end
  if pdu.command == SESSION then return judge_session(chain, direction, pdu) end
  if chain.last_direction == direction then -- the answer passed unseen
    lose(chain, direction, pdu)
    return UNCHECKED
  end
  if chain[direction].sequence == 0 then return search(chain, direction, pdu) end
  if fits(chain, direction, pdu) then return RIGHT end
  lose(chain, direction, pdu)
  return WRONG
end

local function is_data(command)
  return command == PROCESS_DATA or command == FAIL_SAFE_DATA
end

-- Returns the number in STATES which the last commands show; the end behind decides.
local function outside_state(to_sub, to_main)
  if to_sub == 0 or to_main == 0 then return 0 end
  for state, command in ipairs({RESET, SESSION, 0x64, 0x52}) do
    if command == to_sub or command == to_main then return state end
  end
  if not (is_data(to_sub) and is_data(to_main)) then return 7 end
  return to_sub == PROCESS_DATA and to_main == PROCESS_DATA and 6 or 5
end

-- Whether a frame says by itself that FSoE is here; other process data may lie at its address.
local function plausible(pdu, id)
  if pdu.command == RESET then return pdu.id == 0 and fits_start(pdu) end
  if pdu.command == SESSION then return pdu.id == 0 end
  return COMMANDS[pdu.command] ~= nil and pdu.id ~= 0 and (id == nil or id == pdu.id)
end

-- What the first pass found, for Wireshark dissects a packet again whenever it is looked at --------
local chains, first_packets, findings, places_of

local function forget()
  chains, first_packets, findings, places_of = {}, {}, {}, {}
  for c in ipairs(CONNECTIONS) do
    chains[c], findings[c] = new_chain(), {[0] = {}, [1] = {}}
  end
end
forget()

local function is_empty(raw)
  return not raw:find("[^\0]")
end

local function follow(c, direction, raw, packet)
  local chain = chains[c]
  local side = chain[direction]
  if raw == side.last or not side.last and is_empty(raw) then return end
  local pdu = decode(raw)
  if not first_packets[c] then
    if not plausible(pdu, CONNECTIONS[c].id) then return end
    first_packets[c] = packet
  end
  side.last, side.command = raw, pdu.command
  local verdict = judge(chain, direction, pdu)
  local sequence = 0
  if verdict == RIGHT and pdu.command ~= RESET then
    sequence = side.sequence == 1 and 0xFFFF or side.sequence - 1
  end
  local state = outside_state(chain[0].command, chain[1].command)
  findings[c][direction][packet] = verdict + 4 * state + 32 * sequence -- small: captures are long
end

-- Of two frames in one packet a restart of the main is the later one: the answer on its way belongs
-- to what was before.
local function follow_all(seen, packet)
  local late = {}
  for direction = 0, 1 do
    for _, s in ipairs(seen) do
      if s.watched and s.place.direction == direction then
        local command = byte(s.raw)
        if direction == 0 and (command == RESET or command == SESSION) then
          late[#late + 1] = s
        else
          follow(s.connection, direction, s.raw, packet)
        end
      end
    end
  end
  for _, s in ipairs(late) do follow(s.connection, 0, s.raw, packet) end
end

-- Wireshark ---------------------------------------------------------------------------------------
for code = 0x80, 0xFF do CODES[code] = string.format("device-specific code 0x%02x", code) end

local fsoe = Proto("fsoe", "Safety over EtherCAT (" .. NETWORK .. ")")
local f = {
  connection = ProtoField.string("fsoe.connection", "Connection"),
  direction = ProtoField.string("fsoe.direction", "Direction"),
  place = ProtoField.string("fsoe.place", "Seen in"),
  command = ProtoField.uint8("fsoe.command", "Command", base.HEX, COMMANDS),
  reset_code = ProtoField.uint8("fsoe.reset_code", "Reset code", base.DEC, CODES),
  safe_data = ProtoField.bytes("fsoe.safe_data", "Safe data"),
  crc = ProtoField.uint16("fsoe.crc", "CRC", base.HEX),
  verdict = ProtoField.string("fsoe.crc.verdict", "CRC verdict"),
  sequence = ProtoField.uint16("fsoe.sequence", "Sequence number", base.DEC),
  state = ProtoField.string("fsoe.state", "State of the connection"),
  conn_id = ProtoField.uint16("fsoe.conn_id", "ConnID", base.DEC),
}
local wrong_crc = ProtoExpert.new(
  "fsoe.crc.wrong", "CRC does not fit the chain", expert.group.CHECKSUM, expert.severity.ERROR)

local function register_fields()
  local all = {}
  for _, field in pairs(f) do all[#all + 1] = field end
  for _, connection in ipairs(CONNECTIONS) do
    for direction = 0, 1 do
      for _, signal in ipairs(connection.signals[direction]) do
        signal.field = ProtoField.uint64(signal.filter, signal.text)
        all[#all + 1] = signal.field
      end
    end
  end
  fsoe.fields = all
  fsoe.experts = {wrong_crc}
end
register_fields()

fsoe.prefs.base = Pref.uint("Logical address of the image", 0, "Added to every address")

function fsoe.init()
  forget()
end

-- Returns up to 32 bits of some bytes, low bit first.
local function bits_of(data, first, count)
  local at, shift = floor(first / 8), first % 8
  local value, weight = 0, 1
  for i = at + 1, math.min(#data, floor((first + count - 1) / 8) + 1) do
    value, weight = value + byte(data, i) * weight, weight * 256
  end
  return floor(value / 2 ^ shift) % floor(2 ^ count)
end

-- Where a byte of the safe data lies in a frame: a CRC follows every second one.
local function frame_offset(safe_byte)
  return 1 + safe_byte + 2 * floor(safe_byte / 2)
end

local function add_signals(tree, range, signals, data)
  for _, s in ipairs(signals) do
    local low = bits_of(data, s.bit, math.min(s.bits, 32))
    local high = s.bits > 32 and bits_of(data, s.bit + 32, s.bits - 32) or 0
    local first = frame_offset(floor(s.bit / 8))
    local last = frame_offset(floor((s.bit + s.bits - 1) / 8))
    tree:add(s.field, range(first, last - first + 1), UInt64(low, high))
  end
end

local function add_frame(tree, range, pdu)
  local size = #pdu.blocks[1]
  tree:add(f.command, range(0, 1))
  if pdu.command == RESET then tree:add(f.reset_code, range(1, 1)) end
  for i = 0, #pdu.crcs - 1 do
    tree:add(f.safe_data, range(1 + 4 * i, size))
    tree:add_le(f.crc, range(1 + size + 4 * i, 2))
  end
  tree:add_le(f.conn_id, range(range:len() - 2, 2))
end

local function add_finding(tree, verdict, state, sequence)
  tree:add(f.verdict, verdict):set_generated()
  if state then tree:add(f.state, STATES[state]):set_generated() end
  if sequence then tree:add(f.sequence, sequence):set_generated() end
  if verdict == "wrong" then tree:add_proto_expert_info(wrong_crc) end
end

-- Returns verdict, state and sequence number of a frame, as far as they are known.
local function finding_of(s, packet)
  if not s.watched then return "copy" end
  local finding = findings[s.connection][s.place.direction][packet]
  if not finding then return "same" end
  local sequence = floor(finding / 32)
  return VERDICTS[finding % 4], floor(finding / 4) % 8, sequence > 0 and sequence or nil
end

local function command_text(pdu)
  local text = COMMANDS[pdu.command] or string.format("command 0x%02x", pdu.command)
  return pdu.command == RESET and text .. " " .. byte(pdu.blocks[1]) or text
end

-- Shows one frame; returns its text for the info column when it is a new one.
local function show(s, tvb, packet, tree)
  local connection, place = CONNECTIONS[s.connection], s.place
  local direction = place.direction
  local pdu, arrow = decode(s.raw), connection.arrows[direction]
  local verdict, state, sequence = finding_of(s, packet)
  local text = arrow .. " " .. command_text(pdu)
  local range = s.at and tvb(s.at, place.size)
    or ByteArray.new(s.raw, true):tvb("FSoE frame of two datagrams"):range()
  local number = sequence and " #" .. sequence or ""
  local sub = tree:add(fsoe, range, "FSoE " .. text .. ", " .. verdict .. number)
  sub:add(f.connection, connection.name):set_generated()
  sub:add(f.direction, arrow):set_generated()
  sub:add(f.place, place.text):set_generated()
  add_frame(sub, range, pdu)
  add_finding(sub, verdict, state, sequence)
  if pdu.command == PROCESS_DATA then
    add_signals(sub, range, connection.signals[direction], table.concat(pdu.blocks))
  end
  return state and (verdict == "wrong" and text .. " WRONG CRC" or text) or nil
end

-- Returns what lies in a run of datagrams, in the order of the connections.
local function places_in(address, size)
  local key = address * 2048 + size
  if places_of[key] then return places_of[key] end
  local found = {}
  for c, connection in ipairs(CONNECTIONS) do
    for _, place in ipairs(connection.places) do
      local offset = place.address + fsoe.prefs.base - address
      if offset >= 0 and offset + place.size <= size then
        found[#found + 1] = {connection = c, place = place, offset = offset}
      end
    end
  end
  places_of[key] = found
  return found
end

-- Returns the bytes of a place in a run, whether all of them were answered, and where they are in the
-- packet; nil when they are in two datagrams.
local function bytes_of(tvb, run, offset, size)
  local raw, answered, at = "", true, nil
  for _, part in ipairs(run.parts) do
    local first, last = math.max(offset, part.offset), math.min(offset + size, part.offset + part.size)
    if first < last then
      local begin = part.at + first - part.offset
      raw = raw .. tvb:raw(begin, last - first)
      answered = answered and part.answered
      if last - first == size then at = begin end
    end
  end
  return raw, answered, at
end

local function look_at(tvb, run, seen)
  for _, p in ipairs(places_in(run.address, run.size)) do
    local raw, answered, at = bytes_of(tvb, run, p.offset, p.place.size)
    if answered or not p.place.is_input then -- on the way out the inputs are old
      seen[#seen + 1] = {
        connection = p.connection,
        place = p.place,
        at = at,
        raw = raw,
        watched = answered and p.place.watched,
      }
    end
  end
end

-- Appends a datagram to the run of datagrams that it continues: a MainDevice may cut its image, and an
-- FSoE frame with it, into several.
local function append(runs, command, address, part)
  local run = runs[#runs]
  if not run or run.command ~= command or run.address + run.size ~= address then
    run = {command = command, address = address, size = 0, parts = {}}
    runs[#runs + 1] = run
  end
  part.offset = run.size
  run.parts[#run.parts + 1] = part
  run.size = run.size + part.size
end

-- Returns where the EtherCAT header begins in an Ethernet frame, also in UDP.
local function ethercat_start(tvb)
  local at, length = 12, tvb:len()
  while length >= at + 6 and tvb(at, 2):uint() == 0x8100 do at = at + 4 end
  if length < at + 4 then return nil end
  local kind = tvb(at, 2):uint()
  at = at + 2
  if kind == 0x88A4 then return at end
  if kind ~= 0x0800 or length < at + 20 then return nil end
  if floor(tvb(at, 1):uint() / 16) ~= 4 or tvb(at + 9, 1):uint() ~= 17 then return nil end
  at = at + 4 * (tvb(at, 1):uint() % 16)
  if length < at + 10 or tvb(at + 2, 2):uint() ~= 0x88A4 then return nil end
  return at + 8
end

local function frames_in(tvb)
  local seen, at = {}, ethercat_start(tvb)
  if not at or floor(tvb(at, 2):le_uint() / 4096) ~= 1 then return seen end
  at = at + 2
  local more, runs = true, {}
  while more and tvb:len() >= at + 12 do
    local command, flags = tvb(at, 1):uint(), tvb(at + 6, 2):le_uint()
    local size = flags % 2048
    more = flags >= 0x8000 and tvb:len() >= at + 12 + size
    if command >= 10 and command <= 12 and tvb:len() >= at + 12 + size then
      local answered = tvb(at + 10 + size, 2):le_uint() > 0
      append(runs, command, tvb(at + 2, 4):le_uint(), {at = at + 10, size = size, answered = answered})
    end
    at = at + 12 + size
  end
  for _, run in ipairs(runs) do look_at(tvb, run, seen) end
  return seen
end

function fsoe.dissector(tvb, pinfo, tree)
  local seen = frames_in(tvb)
  if not pinfo.visited then follow_all(seen, pinfo.number) end
  local texts = {}
  for _, s in ipairs(seen) do
    local first = first_packets[s.connection]
    if first and pinfo.number >= first and not is_empty(s.raw) then
      texts[#texts + 1] = show(s, tvb, pinfo.number, tree)
    end
  end
  if #texts > 0 then pinfo.cols.info:append(" | FSoE " .. table.concat(texts, "; ")) end
end

register_postdissector(fsoe)
