"""The causes that an incident page can name, worded for a person at the machine.

None of them is a safety statement. They match the evidence; the manuals of the devices and the
person who may change the machine decide.
"""

from __future__ import annotations

from dataclasses import dataclass

SECURE = (
    "Secure the machine before anybody reaches into it: outputs can come on again as soon as a "
    "connection is back in Data."
)
"""Begins each step in which a person touches cables, connectors or devices."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """One cause. Texts may contain ``{sub}`` ``{main}`` ``{name}`` ``{device}`` and ``{other}``.

    Attributes:
        key: Name for programs; never changes.
        title: The cause in one sentence.
        looks: Symptoms seen at the machine.
        measure: Next check or measurement.
        change: Required change if that confirms it.
    """

    key: str
    title: str
    looks: str
    measure: str
    change: str


_ROWS = (
    # -- the bus does not open ---------------------------------------------------------------------
    (
        "no_link",
        "The interface of the MainDevice has no link.",
        "Nothing comes up; the LED of the network port is dark.",
        "Check the LEDs at both ends of the first cable; `ip link show`.",
        "Plug in or replace the first cable, switch the SubDevices on, `ip link set IF up`.",
    ),
    (
        "bus_silent",
        "There is a link, but no SubDevice answers.",
        "The port LED is on, no SubDevice leaves INIT.",
        "Check that the first cable is in the IN port of the first SubDevice and that this is the "
        "right interface.",
        "Correct cable or --interface; switch the SubDevices on.",
    ),
    (
        "other_main_device",
        "Another MainDevice is active on this segment.",
        "The bus is refused, or states change by themselves and connections drop now and then.",
        "Find the other MainDevice: a PLC, a second fsn-master, a commissioning laptop.",
        "Stop or unplug it; only one MainDevice may drive a segment.",
    ),
    (
        "device_missing",
        "{device} of the configuration is not on the bus.",
        "The bus does not come up; the devices before it answer.",
        "Count the SubDevices: `fsoe-net scan`; look at power and link LEDs of {device}.",
        "Connect or power it, or take it out of the configuration.",
    ),
    (
        "wrong_device",
        "A different device is at the position of {device}.",
        "After a change or an exchange of modules the bus does not come up, or {device} stays "
        "away from it.",
        "Compare the type labels with the configuration: `fsoe-net check NETWORK --interface IF`.",
        "Put in the right device, or correct position and identity in the configuration.",
    ),
    (
        "wrong_revision",
        "{device} has another revision than the configuration allows.",
        "The bus does not come up after a device was exchanged or updated.",
        "Read revision and firmware on the label or with `fsoe-net scan`.",
        "Use a device of the stated revision, or allow the new one in the network file after its "
        "maker's release notes were read.",
    ),
    (
        "wrong_mapping",
        "{device} maps other process data than the configuration states.",
        "The bus does not come up; the device is named with a sync manager or PDO.",
        "Compare its PDO assignment with the slave configuration: `fsoe-net scan`.",
        "Correct the slave configuration, or set the device back to the mapping it had.",
    ),
    (
        "sdo_refused",
        "{device} refuses a start-up SDO.",
        "The bus does not come up; an abort code is reported.",
        "Look up the object in the manual of {device}; the abort code gives the reason.",
        "Correct object, size or value in the slave configuration, or its firmware.",
    ),
    (
        "sdo_unanswered",
        "{device} is on the bus but does not answer an SDO.",
        "The bus does not come up; the object without an answer is named.",
        "Look at the AL state of {device}, at the error counters of its ports, and whether replies "
        "are late (`late_replies`, `fsoe-net doctor`).",
        "Retry with `--wait 30s`; if it persists, update the firmware of {device} or ask its "
        "maker.",
    ),
    (
        "state_refused",
        "{device} does not go to the requested state.",
        "Its ERR or RUN LED blinks; the AL status code gives the reason.",
        "Read the AL status code below; check sync manager lengths, DC set-up and the device's own "
        "error memory.",
        "Correct what the code names, acknowledge the error in the device, start again.",
    ),
    # -- the bus while it runs ---------------------------------------------------------------------
    (
        "cable_cut",
        "The line is interrupted before {device}: it and all following devices are gone.",
        "All devices from {device} on drop out at the same moment.",
        "Check the cable between {other} and {device}, its plugs and its bending radius, and the "
        "power of {device}; look at the link LEDs on both sides.",
        "Replace the cable or plug; if it moves, use a cable made for that.",
    ),
    (
        "ring_open",
        "The ring has opened {device}; frames were lost while it did.",
        "All SubDevices continue, from both ends of the ring; connections with little time left "
        "dropped.",
        "Check the cable that is named, its plugs and its bending radius; look at the link LEDs on "
        "both sides.",
        "Replace the cable or plug; until then the next break interrupts the bus.",
    ),
    (
        "device_lost",
        "{device} no longer answers on the bus: unplugged, without power, or broken.",
        "{device} drops out alone; the others continue.",
        "Check power, fuse and plug of {device}; look at its RUN and link LEDs.",
        "Restore power or plug; exchange the device when it stays dark.",
    ),
    (
        "device_restarted",
        "{device} has restarted: it no longer knew the running connection.",
        "{device} was back after a moment; the connection restarts.",
        "Have a meter, fitted while the machine was secured, record its supply under the heaviest "
        "load; read its error memory for a "
        "restart, a watchdog or an undervoltage.",
        "Repair the supply (own fuse, thicker wire, separate supply), or its firmware.",
    ),
    (
        "device_interrupted",
        "{device} was gone from the bus for a while and came back: loose plug or supply dip.",
        "{device} drops out alone and returns by itself, often when something moves or switches.",
        "With the machine secured, move its plugs and cables while `fsoe-net monitor` runs; have "
        "a meter, fitted while it was secured, record the supply under the heaviest load; read the "
        "device's error memory for a restart.",
        "Replace plug or cable, or repair the supply (own fuse, thicker wire, separate supply).",
    ),
    (
        "cable_interrupted",
        "The line was interrupted before {device} for a while: it and the devices after it were "
        "gone and came back.",
        "Several devices drop together, always from {device} on, and return by themselves.",
        "With the machine secured, check the cable and plugs between {other} and {device} and the "
        "supply of {device}; a device that restarts interrupts the line for those after it.",
        "Replace the cable or plug, or repair the supply; where it moves, use a cable made for "
        "that.",
    ),
    (
        "main_link_lost",
        "The link of the MainDevice was down: no frame reached any SubDevice.",
        "All SubDevices and connections drop at the same moment.",
        "Compare the time with the system log: a network manager or power saving can take an "
        "interface down. Read carrier and errors with `ip -s link`. With the machine secured, "
        "check the cable and plugs between the MainDevice and {device}, and the power of {device}.",
        "Keep other programs away from the interface, or replace the cable or plug.",
    ),
    (
        "device_state",
        "{device} has left OP by itself.",
        "Its ERR LED blinks; its inputs no longer change.",
        "Read its AL status code below and its own error memory.",
        "Correct what the code names (sync manager watchdog, synchronisation, process data).",
    ),
    (
        "lost_frames",
        "EtherCAT frames were lost in bursts: for a while no data came back.",
        "All connections stall or drop together, then recover by themselves.",
        "Compare the error counters of all ports: the fault lies before the first port that counts "
        "(bad plug, moved cable, shield and earth, interference).",
        "Replace that cable or plug, lay it apart from motor cables, connect the shield on both "
        "sides; for moved cables use a type made for it.",
    ),
    (
        "late_replies",
        "Replies came back after their cycle was over: the cycle is too short, or the machine is "
        "too busy.",
        "Connections drop now and then, more often under load; the devices are well.",
        "Compare the round trip with the bus cycle below; `fsoe-net doctor` for the machine "
        "(coalescing of the network card, priority of its interrupt, own CPU).",
        "Fix what doctor finds. Another bus cycle changes the reaction times: calculate them "
        "again, and have the configuration accepted again.",
    ),
    (
        "stalled_main_device",
        "The MainDevice stalled: no cycle ran for longer than a connection tolerates.",
        "All connections drop at the same moment; devices report a missing sync manager watchdog.",
        "`fsoe-net doctor`: kernel, throttling, isolated CPU, power saving; what else ran then?",
        "Give fsn-master a CPU of its own and a real-time priority; remove what blocked it.",
    ),
    (
        "cycle_overruns",
        "Many cycles came late: the MainDevice does not keep its cycle.",
        "Connections drop now and then, more often under load.",
        "`fsoe-net doctor`; compare the histogram of the cycle with the cycle time.",
        "Real-time kernel, own CPU, no power saving. Another bus cycle changes the reaction times: "
        "calculate them again, and have the configuration accepted again.",
    ),
    (
        "foreign_frames",
        "Frames that are not from this cycle came back: a second MainDevice or an old frame.",
        "Working counters do not match, old replies are counted, states change by themselves.",
        "Record the wire (`tcpdump -i IF`) and look for a second sender; look for a switch or "
        "converter in the line.",
        "Take the second MainDevice, switch or converter out of the segment.",
    ),
    # -- the ends of a connection ------------------------------------------------------------------
    (
        "watchdog_tight",
        "The watchdog of {name} is too short for this bus: nothing else is wrong.",
        "The connection drops now and then, or never comes up, though all devices are well.",
        "Compare the watchdog with the answer times below: it must hold the slowest round trip and "
        "a lost frame or two.",
        "Take away what makes the answers slow. Another watchdog or bus cycle changes the reaction "
        "times: calculate them again first, and have the configuration accepted again.",
    ),
    (
        "slow_device",
        "{device} answers slowly: its answers take most of the watchdog of {name}.",
        "Only connections of {device} drop, more often when it is busy.",
        "Compare its answer time below with its manual; look at its load (task time, cyclic "
        "communication besides).",
        "Lower its load or its safety task time. Another watchdog changes the reaction times: "
        "calculate them again first, and have the configuration accepted again.",
    ),
    (
        "end_silent",
        "The FSoE end in {device} has stopped answering while its EtherCAT side continues.",
        "{device} stays in OP; only its connection drops.",
        "Read the safety status of {device} (LEDs, error memory, 0x10F3): its safety part may be "
        "in an error or stopped.",
        "Clear the error in the device as described in its manual; replace it if the error "
        "returns.",
    ),
    (
        "wrong_address",
        "{sub} does not have the FSoE address the safety program expects.",
        "{name} never reaches Data; the device resets with `wrong FSoE address`.",
        "Read the address at {sub} (DIP switches, rotary switch, software) and in the safety "
        "program.",
        "Set the address at the device as planned, switch it off and on, accept it again.",
    ),
    (
        "devices_swapped",
        "{device} and {other} have exchanged FSoE addresses: the devices were exchanged, or their "
        "address switches.",
        "After work on the machine their connections stay out of Data.",
        "Compare type labels, serial numbers and address switches of {device} and {other} with the "
        "drawing: is each device at its position?",
        "Devices in each other's place: put them or their cables back; do not exchange the "
        "addresses, since the wiring of sensors and actuators belongs to the device. Devices in "
        "their place: set the address switches back as planned, switch them off and on.",
    ),
    (
        "addresses_swapped",
        "{device} and {other} have exchanged FSoE addresses, while each device is at its place.",
        "Their connections stay out of Data; the devices reset with `wrong FSoE address`.",
        "Compare the addresses at {device} and {other} (DIP switches, rotary switch, software) "
        "with the drawing.",
        "Set each address as planned, switch the devices off and on; the devices stay where they "
        "are.",
    ),
    (
        "devices_swapped_places",
        "{device} and {other} are exchanged on the bus.",
        "After work on the machine the bus does not come up, or both devices stay away from it.",
        "Compare labels and places of {device} and {other} with the drawing.",
        "Put the devices or their cables back.",
    ),
    (
        "copies_crossed",
        "The copies of {name} and {other} are crossed: each end talks to the wrong peer.",
        "Both connections stay out of Data; the frames of one answer the other.",
        "Compare the transfers of both in the network file with the slots of the safety program.",
        "Correct index and subindex of the transfers; `fsoe-net check`, `plan`, accept it again.",
    ),
    (
        "duplicate_connection_id",
        "Two connections use the same connection ID: {device} and {other}.",
        "One of them does not come up, or they disturb each other.",
        "List the connection IDs of all safety programs on this bus.",
        "Give each connection an ID of its own in the safety program and in the network file.",
    ),
    (
        "connection_id",
        "The connection IDs of {name} do not match: safety program and configuration differ.",
        "The connection drops or never comes up with `wrong connection ID`.",
        "Compare the connection ID in the safety program with the network file.",
        "Correct the one that is wrong; download the safety program again if it is that.",
    ),
    (
        "parameters_refused",
        "{sub} refuses the parameters of the safety program.",
        "{name} reaches Parameter and restarts repeatedly.",
        "Compare parameter set, its length, its checksum (SRA CRC) and the watchdog in {sub} with "
        "those in the safety program; reset codes 8 to 11 say which of them.",
        "Download the same parameter set to both, or enter the new checksum after the change was "
        "checked as the manual of the device asks for.",
    ),
    (
        "frames_damaged",
        "{device} sends frames with a wrong CRC.",
        "The connection drops with `wrong CRC`; only connections of {device} do.",
        "Exchange {device} for another one; look for firmware that writes its frame in pieces.",
        "Repair, update or exchange the device.",
    ),
    (
        "second_writer",
        "Something else writes into the frames of {name}: good frames do not arrive as sent.",
        "The connection drops with `wrong CRC` or `unknown command` though both ends send good "
        "frames.",
        "Look for a second program, copy or MainDevice that writes the same output bytes; record "
        "the wire and compare it with the frames below.",
        "Remove the second writer: these bytes belong to the copy of the FSoE frame alone.",
    ),
    (
        "main_not_running",
        "The safety logic in {main} does not run: it has sent nothing at all.",
        "No connection of {main} ever starts; its process data stay 0.",
        "Look at the RUN and diagnosis LEDs of {main}: is a safety program loaded and started, is "
        "the connection active in it?",
        "Download and start the safety program; link its RUN input where it has one.",
    ),
    (
        "sub_silent",
        "{sub} does not answer although its frames are sent.",
        "{name} stays in Reset; {main} tries again and again.",
        "Is the safety part of {sub} configured and without error? Is the slot of {main} the one "
        "for {sub}, and the mapped FSoE object the right one?",
        "Commission the safety part of {sub}; correct transfers or mapping.",
    ),
    (
        "mapping_shifted",
        "The frames of {device} are not at the planned bytes: its mapping is shifted.",
        "{name} never comes up; the bytes at the planned place are not an FSoE frame.",
        "Compare PDO order, padding and gaps of {device} with its slave configuration.",
        "Correct the slave configuration (a missing or extra padding entry) and compile again.",
    ),
    (
        "frame_size",
        "{device} sends frames of another length than planned.",
        "{name} never gets past Session.",
        "Compare the safe data length of {device} (its safety project, its modules) with the "
        "configuration.",
        "Correct the size in transfers and slave configuration, or the safety project.",
    ),
    (
        "roles_exchanged",
        "The roles are exchanged: {sub} behaves as MainInstance.",
        "Both ends start sessions, or both wait for the other.",
        "Which device holds the safety program of this connection? Which objects are its main "
        "side?",
        "Correct safety_master and the two transfers of the net: in and out are exchanged.",
    ),
    (
        "failsafe",
        "The connection is up, but {device} sends FailSafeData.",
        "Everything is in OP and in Data, yet the outputs stay off.",
        "Is an error acknowledge (ERR_ACK) or a restart missing? Are group and RUN of the safety "
        "program linked, are all its inputs good?",
        "Give the error acknowledge edge or the restart as the safety program asks for; clear what "
        "holds its inputs.",
    ),
    (
        "local_reset",
        "{device} has reset {name} itself (code 0): it reported no fault in a frame.",
        "The connection drops without an error and comes back.",
        "Was the safety program stopped, changed, or the connection switched off in it?",
        "Nothing if it was intended; otherwise read the log of {device}.",
    ),
    (
        "main_restarted",
        "{main} has restarted or its safety program was stopped: it reset all its connections.",
        "All connections of {main} drop at the same moment with code 0.",
        "Measure its supply; was the safety program downloaded, stopped or started?",
        "Nothing if it was intended; otherwise repair the supply.",
    ),
)

CAUSES: dict[str, Cause] = {
    key: Cause(key=key, title=title, looks=looks, measure=measure, change=change)
    for key, title, looks, measure, change in _ROWS
}
