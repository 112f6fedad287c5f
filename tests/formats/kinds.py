"""Which reader a kind of file has."""

from __future__ import annotations

from collections.abc import Callable

from described import bus
from formats.esi_text import esi_text, module_text
from formats.texts import CONFIG, LCEC, PDOS, ROS_SLAVES, SLAVES, SOEM, TWINSAFE, XML, cstruct
from formats.twincat_text import alias, box, machine

from fsoe_net.formats.eni.read import load_eni
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.esi.read import load_esi
from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.lcec.read import load_lcec
from fsoe_net.formats.ros_slaves.read import load_ros_slaves
from fsoe_net.formats.soem.read import load_soem_text
from fsoe_net.formats.twincat.read import load_twincat
from fsoe_net.formats.twinsafe.read import load_twinsafe
from fsoe_net.model.description import Description

_SMS = (
    '<Sm StartAddress="#x1000" ControlByte="#x26">MBoxOut</Sm>'
    '<Sm StartAddress="#x1080" ControlByte="#x22">MBoxIn</Sm>'
    '<Sm StartAddress="#x1100" ControlByte="#x24">Outputs</Sm>'
    '<Sm StartAddress="#x1180" ControlByte="#x20">Inputs</Sm>\n'
)
_PDO = (
    '<{tag} Sm="{sm}"><Index>#x{index}</Index><Entry><Index>#x{base}</Index><SubIndex>1</SubIndex>'
    "<BitLen>8</BitLen><Name>n</Name></Entry></{tag}>\n"
)
_DEVICE = (
    '<Device><Type ProductCode="#x10" RevisionNo="#x1">D</Type>' + _SMS
    + _PDO.format(tag="RxPdo", sm=2, index="1600", base="7000")
    + _PDO.format(tag="TxPdo", sm=3, index="1a00", base="6000")
    + "<Mailbox><CoE><InitCmd><Transition>PS</Transition><Index>#x8000</Index>"
    "<SubIndex>1</SubIndex><Data>0700</Data></InitCmd></CoE></Mailbox>\n"
    "<Dc><OpMode><Name>DC</Name><AssignActivate>#x300</AssignActivate></OpMode></Dc></Device>\n"
)  # fmt: skip
# A good text of each kind, and what reads it.
KINDS: dict[str, tuple[str, Callable[..., Description | None]]] = {
    "eni": (write_eni(bus(1)), load_eni),
    "esi": (esi_text(_DEVICE, modules=module_text(7, "")), load_esi),
    "lcec": (LCEC, load_lcec),
    "ros_slaves": (ROS_SLAVES, load_ros_slaves),
    "soem": (SOEM, load_soem_text),
    "igh_pdos": (PDOS, load_igh_text),
    "igh_cstruct": (cstruct(3), load_igh_text),
    "igh_xml": (XML, load_igh_text),
    "igh_slaves": (SLAVES, load_igh_text),
    "igh_config": (CONFIG, load_igh_text),
    "twincat": (machine(safety=""), load_twincat),
    "twincat_box": (box(1, "Term 1 (EK1100)", "EK1100", 0x044C2C52), load_twincat),
    "twinsafe": (TWINSAFE, load_twinsafe),
    "alias": (alias(3, 5, 11, 120), load_twinsafe),
}
