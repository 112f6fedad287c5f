"""Every diagnostic code, its default severity and its title. Codes are never renumbered.

FSN1xx loading, FSN2xx plan and copies, FSN3xx FSoE, FSN4xx devices and layout, FSN5xx live bus,
FSN6xx timing. Each code has a page ``docs/diagnostics/FSNxyz.md`` and a seeded mistake in
``tests/diagnostics/cases.yaml`` that triggers it, while the clean files do not; a test requires
both.
"""

from __future__ import annotations

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.guesses import guesses


@dataclass(frozen=True, slots=True)
class CodeInfo:
    """One line of the catalogue: code, default severity (``error | warning | info``), title."""

    code: str
    severity: str
    title: str


_TABLE = """
FSN101 error   file cannot be read
FSN102 error   not valid YAML
FSN103 error   document is too deep, too large or expands without bound
FSN104 error   document is empty or is not a map
FSN105 error   more than one document in a file
FSN106 error   key given twice
FSN107 error   merge key that the driver does not support
FSN108 error   invisible or non-ASCII character in a key
FSN109 error   unknown key
FSN110 error   key is missing
FSN111 error   value has the wrong type
FSN112 error   number format that is read as a different number
FSN113 error   number is out of range
FSN114 error   leading zero: octal in one file, decimal in the other
FSN115 warning index without 0x
FSN116 error   value is not one of the allowed words
FSN117 error   unsupported file type
FSN118 error   not well-formed XML, or the file declares a document type
FSN119 error   xacro cannot be expanded
FSN120 error   ec_module without a plugin
FSN121 warning unknown plugin
FSN122 warning driver plugin of the 2024 prototype
FSN123 error   both fsoe_config and transfer_config
FSN124 error   transfers in an XML <safety> block are ignored
FSN125 error   no transfers: the file would silently do nothing
FSN126 info    relative path depends on where the driver is started
FSN127 warning interface nested inside ec_module is never exported
FSN128 error   component name used in several ros2_control blocks
FSN129 error   transfer crosses two EtherCAT masters
FSN130 error   invalid cycle time or control frequency
FSN131 error   address format that is read as a different number
FSN132 info    fsoe_config is the old name of transfer_config
FSN133 error   referenced file cannot be read
FSN134 error   module name used twice
FSN135 error   device is not in this description file
FSN136 warning revision is not in this description file
FSN137 error   module of a modular device cannot be used
FSN138 error   SII image is empty, cut off or damaged
FSN139 warning PDO assignment of a device description contradicts itself
FSN140 error   file type does not match its name or its use
FSN141 error   value in a bus description is missing or cannot be read
FSN142 error   ENI process data have no constant offset to their commands
FSN143 error   PDOs of a SubDevice do not fill its process data
FSN144 error   process image has no variable where the PDOs place an entry
FSN145 error   copy outside the process data
FSN146 error   text ends too early
FSN147 warning line cannot be parsed
FSN148 error   connection names an unsuitable SubDevice
FSN149 error   copy moves a part of an FSoE frame
FSN150 error   capture contains no EtherCAT frames
FSN151 warning capture is damaged or ends inside a packet
FSN152 warning packets of a capture were cut short
FSN153 warning capture does not show everything
FSN154 error   PDOs seen in a capture do not fill their sync manager
FSN155 error   answer refers to an unknown item
FSN156 error   answer contradicts the files
FSN157 error   question needs an answer
FSN158 warning file in a folder is skipped
FSN159 warning transfers or connections of a file cannot be used
FSN160 warning incomplete result in a test record: the step stays open
FSN161 error   invalid entry in a test record
FSN162 error   acceptance record is inconsistent
FSN163 error   author and verifier of an acceptance record are one person
FSN164 error   invalid buses
FSN165 error   invalid groups
FSN166 error   permanent part depends on a part that may be absent
FSN167 warning output keeps the last value of an absent group
FSN168 error   ec_module outside of a joint, gpio or sensor
FSN169 warning logo of the report cannot be used
FSN201 error   transfer names an unknown module
FSN202 error   transfer names an entry that the module does not map
FSN203 error   transfer reads an output
FSN204 error   two transfers write the same bytes
FSN205 error   transfer writes an input
FSN206 error   transfer uses an entry marked skip
FSN207 error   transfer uses a padding entry
FSN208 error   size is not the size of the frame
FSN209 error   copy runs past the end of its FSoE frame or sync manager
FSN210 error   the two ends of a transfer have frames of different size
FSN211 error   transfer does not start at the command byte of a frame
FSN212 warning entry that does not look like part of the frame lies inside it
FSN213 error   transfer starts inside a byte
FSN214 error   the driver overwrites bytes of a copied frame
FSN215 error   one direction of a connection is missing
FSN216 error   source and destination overlap
FSN217 error   transfer reads what another transfer writes
FSN218 error   safety_master is missing or names an unknown module
FSN219 error   transfer does not touch the safety master of its net
FSN222 error   transfer of size zero
FSN223 error   net without transfers
FSN224 warning net name used twice
FSN225 error   the two directions of a connection use different slots
FSN226 error   the FSoE MainInstance cannot be the MainDevice itself
FSN227 error   connection has no transfers
FSN228 error   transfer_master and safety_master disagree
FSN230 error   transfer uses a module that may be left out
FSN232 info    FSoE frame that no transfer serves
FSN233 error   standard transfer touches an FSoE frame
FSN234 error   connection is unconfirmed
FSN235 error   slot does not exist
FSN236 error   frames of a connection do not fit
FSN237 error   slot is required to select the frame
FSN238 error   FSoE frame used by two connections
FSN239 error   connection does not start at the MainInstance of its net
FSN301 error   FSoE address used twice
FSN302 error   connection ID used twice
FSN303 warning unusual FSoE address
FSN304 error   connection ID 0 is not allowed
FSN305 error   FSoE watchdog time is not allowed
FSN306 error   application parameters cannot be sent
FSN307 info    no FSoE frame structure recognised at this entry
FSN401 error   receive and transmit PDOs look exchanged
FSN402 error   unknown data type
FSN403 error   bit length of a type is out of range
FSN404 error   PDO channel is incomplete
FSN405 warning mask does not select the bit of this entry
FSN406 warning PDO without channels: its layout is not known offline
FSN407 error   PDO listed twice
FSN408 warning entry mapped twice
FSN409 error   PDOs are not assigned to a sync manager
FSN410 error   PDO assigned to a sync manager of the other direction
FSN411 info    sync manager watchdog is off on FSoE outputs
FSN412 error   invalid sync manager index
FSN413 error   PDOs assigned to two sync managers
FSN414 error   two modules at the same bus position
FSN415 error   module declared in the URDF and in the YAML
FSN417 info    start-up SDOs of a module addressed by alias go to another SubDevice
FSN418 error   start-up SDO cannot be written
FSN419 warning process data with an FSoE frame do not end on a byte
FSN420 error   sync manager does not fit into one datagram
FSN421 info    process image needs several datagrams
FSN422 error   data_mapping item is not a run of bits inside its channel
FSN423 error   interface given both for the channel and for its data_mapping
FSN424 warning receive and transmit objects of the FSoE frames look exchanged
FSN425 warning bus cycle is as long as the sync manager watchdog
FSN427 warning type cannot be accessed as a value
FSN429 warning   interface on a PDO of the wrong direction
FSN431 error   another file has a different device at this position
FSN432 warning another file is of another revision
FSN433 warning another file assigns other PDOs
FSN434 warning another file maps other entries
FSN435 error   padding of a PDO is shorter or longer than in another file
FSN436 error   fixed PDO is described with other entries
FSN437 error   mandatory PDO is not assigned
FSN438 error   PDOs that exclude each other are both assigned
FSN439 error   PDO belongs to another sync manager
FSN440 warning sync manager differs from another file
FSN441 info    default size of a sync manager is not the length of its PDOs
FSN442 error   SubDevice is missing, or at another position, in another file
FSN443 warning file describes no part of this network
FSN444 error   another file copies other bytes
FSN445 warning another file has another bus cycle
FSN446 error   safety project has another value for a connection
FSN447 error   connection is missing in the safety project, or here
FSN448 warning FSoE frames differ from the device library
FSN449 info    entry of the device library for a device
FSN450 info    default of an output that not every version of the driver writes
FSN451 error   empty text, or no list where the driver reads one
FSN452 info    master plugin that drives no bus
FSN460 info    drive that waits for STO release blocks the start of the driver
FSN461 info    stopping and starting the driver doubles the transfers
FSN462 info    driver that writes every default would destroy the copied frame
FSN463 warning key that this version of the driver does not support
FSN464 warning linuxcnc-ethercat copies another length for this device type
FSN465 info    linuxcnc-ethercat has no FSoE support for this device
FSN466 warning linuxcnc-ethercat would connect other slots
FSN467 warning FSoE partners are in different sync units
FSN468 info    branch that registers transmit PDOs first shows other offsets
FSN469 info    driver does not compare the identity of devices addressed by alias
FSN470 error   cyclic mode of operation without its target
FSN471 warning target position without the actual position
FSN472 warning controlword without the statusword
FSN473 warning fixed target position
FSN474 warning mode of operation that is not read back
FSN475 error   drive plugin that does not read where the axis is
FSN476 warning interface of a robot that no channel provides
FSN477 warning interface that a controller needs and the robot lacks
FSN478 warning update rate that differs from the control frequency
FSN479 info    command interface that two controllers claim
FSN480 info    controllers whose interfaces are not checked
FSN481 info    command of a channel that the robot does not have
FSN482 warning interface that several channels have
FSN483 error   several hardware or plugin tags in a ros2_control block
FSN484 error   drive plugin without controlword or statusword
FSN485 warning mode of operation that nothing sends
FSN486 error   command and state of a drive count in opposite directions
FSN487 warning factor is 0, or command and state are not scaled inversely
FSN488 warning cycle time of a drive that differs from the bus cycle
FSN489 warning start-up SDO contradicts the PDOs of the same file
FSN490 warning limits of a joint that its command cannot express
FSN491 error   several drives of one joint for fsoe_net_ros
FSN501 error   SubDevice is missing on the bus
FSN502 warning SubDevice on the bus that is not in the network
FSN503 error   SubDevices on the bus are in another order
FSN504 error   different device at this position
FSN505 warning device has another revision
FSN506 warning device assigns or maps other PDOs
FSN507 warning sync manager of the device has another length
FSN508 error   device has another FSoE address
FSN509 error   safety project has another connection ID
FSN510 error   safety project has another FSoE watchdog
FSN511 error   SubDevice is in an error state
FSN512 warning port lost its link or received errors
FSN513 info    FSoE values cannot be read over the bus
FSN514 info    SubDevice was not read completely
FSN515 error   station alias is held by two SubDevices
FSN601 warning FSoE watchdog is too short for the bus cycle
FSN602 error   FSoE watchdog does not survive a healthy round trip
FSN603 error   no FSoE watchdog fits: too short and too long at once
FSN604 error   safety function may take longer than required
FSN605 error   element of a safety function is not in the network
FSN606 warning safety function cannot be judged: values are missing
FSN607 warning unverified value in a safety function
FSN608 error   sum of PFH is above the limit
FSN609 error   two safety functions with the same name
FSN610 warning connection belongs to no safety function
FSN611 error   reaction time holds only while the handshake of FSoE is not counted
FSN612 warning time or PFH of 0 without a reason
FSN613 error   required level is above the lowest claim of an element
FSN614 warning claim is above what its category reaches
FSN615 error   safe bit of a safety function is in no FSoE frame
FSN616 error   safe bits of one frame contradict each other
"""

CATALOGUE: dict[str, CodeInfo] = {
    code: CodeInfo(code, severity, title)
    for code, severity, title in (line.split(maxsplit=2) for line in _TABLE.strip().splitlines())
}


def code_info(code: str) -> CodeInfo:
    """Return the catalogue line of a code.

    Raises:
        KeyError: Unknown code.
    """
    return CATALOGUE[code]


def nearest_codes(text: str) -> tuple[str, ...]:
    """Return the codes that a user may have meant. ``203`` and ``fsn203`` are accepted."""
    wanted = text.strip().upper()
    if wanted.isdigit():
        wanted = "FSN" + wanted
    if wanted in CATALOGUE:
        return (wanted,)
    return guesses(wanted, CATALOGUE, cutoff=0.7)
