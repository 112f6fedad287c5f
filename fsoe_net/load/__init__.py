"""Files into the model, every value with its place; what is wrong becomes diagnostics."""

from fsoe_net.load.by_content import (
    MAX_DESCRIPTION_BYTES,
    description_reader,
    load_description,
)
from fsoe_net.load.esi import EsiChoice, list_esi, load_esi
from fsoe_net.load.files import Collector, read_bytes
from fsoe_net.load.library import builtin_library, load_library, parse_library_device
from fsoe_net.load.network import FileKind, LoadOptions, LoadResult, load_network
from fsoe_net.load.scan import load_scan, parse_scan
from fsoe_net.load.scenario import load_scenario
from fsoe_net.load.schema import check_structure, read_schema
from fsoe_net.load.sii import load_sii
from fsoe_net.load.yaml_tree import MapNode, ScalarNode, SeqNode, load_yaml, parse_yaml

__all__ = [
    "MAX_DESCRIPTION_BYTES",
    "Collector",
    "EsiChoice",
    "FileKind",
    "LoadOptions",
    "LoadResult",
    "MapNode",
    "ScalarNode",
    "SeqNode",
    "builtin_library",
    "check_structure",
    "description_reader",
    "list_esi",
    "load_description",
    "load_esi",
    "load_library",
    "load_network",
    "load_scan",
    "load_scenario",
    "load_sii",
    "load_yaml",
    "parse_library_device",
    "parse_scan",
    "parse_yaml",
    "read_bytes",
    "read_schema",
]
