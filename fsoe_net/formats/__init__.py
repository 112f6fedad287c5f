"""Files into the model, every value with its place; what is wrong becomes diagnostics."""

from fsoe_net.formats.acceptance import is_acceptance, load_acceptance, parse_acceptance
from fsoe_net.formats.answers import load_answers, parse_answers
from fsoe_net.formats.eni import load_eni_images
from fsoe_net.formats.files import STDIN, Collector, open_file, read_bytes
from fsoe_net.formats.foreign_file import InputKind, find_kind, load_devices, load_foreign
from fsoe_net.formats.library import builtin_library, load_library, parse_library_device
from fsoe_net.formats.network import FileKind, LoadResult, load_network
from fsoe_net.formats.options import LoadOptions
from fsoe_net.formats.patch import patch_yaml
from fsoe_net.formats.protocol import load_protocol
from fsoe_net.formats.ring import DeviceType, list_types, ring_of
from fsoe_net.formats.scan import load_scan, parse_scan
from fsoe_net.formats.scan_bus import describe_scan
from fsoe_net.formats.scenario import load_scenario
from fsoe_net.formats.schema import check_structure, read_schema
from fsoe_net.formats.yaml_tree import MapNode, ScalarNode, SeqNode, load_yaml, parse_yaml

__all__ = [
    "STDIN",
    "Collector",
    "DeviceType",
    "FileKind",
    "InputKind",
    "LoadOptions",
    "LoadResult",
    "MapNode",
    "ScalarNode",
    "SeqNode",
    "builtin_library",
    "check_structure",
    "describe_scan",
    "find_kind",
    "is_acceptance",
    "list_types",
    "load_acceptance",
    "load_answers",
    "load_devices",
    "load_eni_images",
    "load_foreign",
    "load_library",
    "load_network",
    "load_protocol",
    "load_scan",
    "load_scenario",
    "load_yaml",
    "open_file",
    "parse_acceptance",
    "parse_answers",
    "parse_library_device",
    "parse_scan",
    "parse_yaml",
    "patch_yaml",
    "read_bytes",
    "read_schema",
    "ring_of",
]
