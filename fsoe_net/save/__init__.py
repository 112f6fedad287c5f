"""Descriptions into files of other tools; whatever is written can be read back."""

from fsoe_net.save.acceptance import write_acceptance
from fsoe_net.save.c_header import write_c_header
from fsoe_net.save.describe import describe
from fsoe_net.save.driver import DriverVersion, write_driver, write_network
from fsoe_net.save.eni import eni_notes, write_eni
from fsoe_net.save.eni_copies import replace_copies
from fsoe_net.save.lcec import write_lcec
from fsoe_net.save.protocol import write_protocol
from fsoe_net.save.remarks import Remarks
from fsoe_net.save.slave_yaml import write_slave_yaml
from fsoe_net.save.written import Written, own_words_lost

__all__ = [
    "DriverVersion",
    "Remarks",
    "Written",
    "describe",
    "eni_notes",
    "own_words_lost",
    "replace_copies",
    "write_acceptance",
    "write_c_header",
    "write_driver",
    "write_eni",
    "write_lcec",
    "write_network",
    "write_protocol",
    "write_slave_yaml",
]
