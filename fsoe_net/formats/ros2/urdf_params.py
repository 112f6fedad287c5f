"""Plugins and ``param`` tags of a URDF, read the way the driver reads them.

The driver uses texts unchanged, including blanks. Of a repeated param it uses the last one. It
throws an exception on an empty param. Numbers are parsed with `stod` in drivers of 2024 and with
`stoul` later; only spellings that both read as the same number are accepted here.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.diag.diagnostic import Diagnostic, Related, Severity, Span
from fsoe_net.diag.guesses import guesses, one_of
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.xml_tree import Element
from fsoe_net.model.drives import CIA402_PLUGIN, ROS_PACKAGE_DRIVER

DRIVER_PLUGIN = "ethercat_driver/EthercatDriver"
IGH_MASTER = "ethercat_master/EtherlabMaster"  # also if there is no master_plugin
MOCK_MASTER = "ethercat_master/MockMaster"
_PROTOTYPE_PLUGIN = "ethercat_driver/EthercatSafetyDriver"
_PACKAGES = ("ethercat_generic_plugins/", "ethercat_plugins/")
_VENDOR_PLUGINS = """
ATI_FTSensor Advantech_AMAX5051 Advantech_AMAX5056 Beckhoff_EK1100 Beckhoff_EL1008 Beckhoff_EL1018
Beckhoff_EL2008 Beckhoff_EL2088 Beckhoff_EL2124 Beckhoff_EL3102 Beckhoff_EL3104 Beckhoff_EL4132
Beckhoff_EL4134 Beckhoff_EL5101 Maxon_EPOS3 Omron_NX_ECC201_NX_ID5442 Omron_NX_ECC201_NX_OD5256
Omron_NX_ECC202_NX_ID5142_1 Omron_NX_ECC202_NX_OD5256 Schneider_ATV320
"""
_KNOWN_PLUGINS = (
    "ethercat_generic_plugins/GenericEcSlave",
    CIA402_PLUGIN,
    *(f"ethercat_plugins/{name}" for name in _VENDOR_PLUGINS.split()),
)
_ALIKE = 0.85  # minimum similarity of two words of which one is misspelt
_MAX_ADDRESS = 0xFFFF
_NUMBER_HINT = "write a whole number from 0 up"
_NUMBER_HINTS = {
    "master_id": f"{_NUMBER_HINT}; a name such as enp2s0 needs a master_plugin that takes one"
}
# Its name in the source code of the driver.
_CONFUSED = {"master_iface": "master_id"}
_SLOWEST_HZ = 0.25  # a cycle of 4 s, as in network YAML
_FASTEST_HZ = 1e9  # a cycle of 1 ns


def known_plugin_findings(plugin: str, span: Span) -> list[Diagnostic]:
    """Return FSN121 for an unknown plugin of a module: a warning if it looks misspelt."""
    if plugin in _KNOWN_PLUGINS:
        return []
    close = guesses(plugin, _KNOWN_PLUGINS, cutoff=_ALIKE)
    package = next((p for p in _PACKAGES if plugin.startswith(p)), None)
    suspicious = bool(close) or package is not None or "/" not in plugin
    hint = "fine if it is your own plugin"
    if "/" not in plugin:
        close = tuple(k for k in _KNOWN_PLUGINS if k.endswith("/" + plugin)) or close
        hint = "write package/class"
    if close:
        hint = f"write {one_of(close)}"
    elif package is not None:
        hint = f"{package.rstrip('/')} has no such class; the generic one is {_KNOWN_PLUGINS[0]}"
    return [
        Diagnostic(
            code="FSN121",
            span=span,
            message=f"plugin {plugin!r} is not known here"
            + ("; a driver that cannot load it shifts every later module" if suspicious else ""),
            severity=Severity.WARNING if suspicious else Severity.INFO,
            hint=hint,
        )
    ]


def driver_plugin_findings(plugin: str, span: Span, out: Collector) -> None:
    """Add FSN122 or FSN121 if the plugin of a ``ros2_control`` block is not the current driver."""
    if plugin in (DRIVER_PLUGIN, ROS_PACKAGE_DRIVER):
        return
    if plugin == _PROTOTYPE_PLUGIN:
        out.add(
            "FSN122",
            span,
            f"{_PROTOTYPE_PLUGIN} exists only in the prototype of 2024",
            hint=f"write {DRIVER_PLUGIN}, which copies transfers itself",
        )
        return
    close = bool(guesses(plugin, (DRIVER_PLUGIN, _PROTOTYPE_PLUGIN), cutoff=_ALIKE))
    close = close or plugin.startswith("ethercat_driver/")
    out.add(
        "FSN121",
        span,
        f"plugin {plugin!r} is not the EtherCAT driver, yet its block has ec_module tags",
        severity=Severity.WARNING if close else Severity.INFO,
        hint=f"write {DRIVER_PLUGIN}" if close else "fine if it is a driver of your own",
    )


def master_plugin_findings(plugin: str, span: Span, out: Collector) -> None:
    """Add FSN452 for the master without a bus, FSN121 for a name that looks misspelt."""
    if plugin == MOCK_MASTER:
        out.add(
            "FSN452",
            span,
            f"{plugin} is the master for tests: the driver exchanges no frame with a bus",
            hint=f"fine for a test; else write {IGH_MASTER}, or delete master_plugin",
        )
    # Names of classes are compared alone: the package makes each pair of plugins look alike.
    classes = {name.rpartition("/")[2]: name for name in (IGH_MASTER, MOCK_MASTER)}
    own = plugin.rpartition("/")[2]
    close = [classes[c] for c in guesses(own, classes, cutoff=_ALIKE) if c != own]
    if close:
        out.add(
            "FSN121",
            span,
            f"plugin {plugin!r} is not known here; a driver that cannot load it does not start",
            hint=f"write {one_of(close)}",
        )


@dataclass(slots=True)
class Params:
    """The ``param`` children of an element by name, without the empty ones."""

    owner: Element
    rows: dict[str, Element] = field(default_factory=dict)
    empty: set[str] = field(default_factory=set)

    def text(self, name: str) -> str | None:
        """Return the text as written, or ``None`` if the param is missing."""
        row = self.rows.get(name)
        return row.text if row is not None else None

    def span(self, name: str) -> Span:
        """Return the place of a param's text."""
        row = self.rows.get(name)
        return row.value_span if row is not None else self.owner.span

    def places(self) -> dict[str, Span]:
        """Return the place of each param's text."""
        return {name: row.value_span for name, row in self.rows.items()}


def read_params(owner: Element, known: Collection[str], out: Collector) -> Params:
    """Read the params of an element; errors are FSN106, FSN109 and FSN110."""
    params = Params(owner)
    given: dict[str, Element] = {}
    rows = owner.all("param")
    names = {row.attributes.get("name", "") for row in rows}
    for row in rows:
        name = row.attributes.get("name", "")
        if not name:
            message = "param without a name; the driver stops on it"
            out.add("FSN110", row.span, message, hint='write <param name="…">')
            continue
        first = given.setdefault(name, row)
        if first is not row:
            related = (Related(span=first.span, message="first given here"),)
            message = f"param {name!r} is given twice; the driver takes the last one"
            out.add("FSN106", row.span, message, hint="delete one of them", related=related)
        elif name not in known:
            _misspelt(name, row, [k for k in known if k not in names], out)
        if row.text.strip():
            params.rows[name] = row
            continue
        params.empty.add(name)
        message = f"param {name!r} is empty; the driver stops on it"
        out.add("FSN110", row.span, message, hint="write its value, or delete the param")
    return params


def _misspelt(name: str, row: Element, free: list[str], out: Collector) -> None:
    meant = _CONFUSED.get(name, "")
    close = (meant,) if meant in free else guesses(name, free, cutoff=_ALIKE)
    if close:
        out.add(
            "FSN109",
            row.span,
            f"unknown param {name!r}; the driver ignores it silently",
            severity=Severity.WARNING,
            hint=f"write {one_of([repr(c) for c in close])}",
        )


def read_address(params: Params, name: str, out: Collector) -> int | None:
    """Return a ring position, alias or master number; ``None`` if absent or unreadable.

    Args:
        params: Params that contain the number.
        name: Name of the param.
        out: Takes FSN131 for an ambiguous spelling, FSN113 beyond 0 … 65535.
    """
    text = params.text(name)
    if text is None:
        return None
    span = params.span(name)
    if re.fullmatch(r"0|[1-9][0-9]*", text):
        # The length is checked first: Python refuses to convert thousands of digits.
        if len(text) <= 5 and int(text) <= _MAX_ADDRESS:
            return int(text)
        message = f"{name} {_short(text)} is outside 0 … {_MAX_ADDRESS}"
        hint = f"`ethercat slaves` lists {name} …" if name != "master_id" else ""
        out.add("FSN113", span, message, hint=hint or "`ethercat master` lists the masters")
        return None
    meant, old, new = _meant(text), _stod(text), _stoul(text)
    agree = old == new == f"read {meant}"
    reads = f"drivers of 2024 {old}, later ones {new}"
    if agree:
        reads = f"every driver happens to {old}"
    out.add(
        "FSN131",
        span,
        f"{name} {_short(text)!r} is not a plain decimal number: {reads}",
        severity=Severity.WARNING if agree else Severity.ERROR,
        hint=f"write {meant}" if meant is not None else _NUMBER_HINTS.get(name, _NUMBER_HINT),
    )
    return meant


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:40] + "…"


def _meant(text: str) -> int | None:
    """Guess the number meant by an ambiguous spelling."""
    bare = text.strip().removeprefix("+")
    if re.fullmatch(r"0[xX][0-9a-fA-F]{1,8}", bare):
        value = int(bare, 16)
    elif re.fullmatch(r"[0-9]{1,10}(\.0*)?", bare):
        value = int(bare.partition(".")[0])
    else:
        return None
    return value if value <= _MAX_ADDRESS else None


def _stod(text: str) -> str:
    match = re.match(r"\s*([+-]?)(?:0[xX]([0-9a-fA-F]{1,12})|([0-9]{1,12}))", text, re.ASCII)
    if match is None:
        return "throw an exception"
    sign, hexadecimal, decimal = match.groups()
    value = int(hexadecimal, 16) if hexadecimal else int(decimal)
    return f"read {'-' if sign == '-' and value else ''}{value}"


def _stoul(text: str) -> str:
    match = re.match(r"\s*([+-]?)([0-9]{1,12})", text, re.ASCII)
    if match is None:
        return "throw an exception"
    value = int(match.group(2))
    # stoul wraps a negative number around; the driver keeps 16 bits of it.
    return f"read {-value & _MAX_ADDRESS if match.group(1) == '-' else value}"


def read_frequency(params: Params, out: Collector) -> float:
    """Return ``control_frequency`` in Hz: 100 if absent, 0 with FSN130 if impossible."""
    text = params.text("control_frequency")
    if text is None:
        return 100.0
    bare = text.strip()
    number = re.match(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?", bare)
    value = float(number.group()) if number and len(bare) < 50 else 0.0
    possible = _SLOWEST_HZ <= value <= _FASTEST_HZ
    if possible and number is not None and number.end() == len(bare):
        return value
    out.add(
        "FSN130",
        params.span("control_frequency"),
        f"control_frequency {_short(text)!r} is not a possible frequency above zero",
        hint=f"write {number.group()}" if possible and number else "write it in Hz, such as 1000",
    )
    return 0.0


def read_mode(params: Params, out: Collector) -> int | None:
    """Return ``mode_of_operation`` as the CiA 402 plugin writes it; FSN116 if unsupported."""
    text = params.text("mode_of_operation")
    if text is None:
        return None
    if re.fullmatch(r"0?[0-9]|10", text.strip()):
        return int(text)
    out.add(
        "FSN116",
        params.span("mode_of_operation"),
        f"mode_of_operation is {_short(text)!r}; the plugin writes modes 0 … 10 only",
        hint="write 8 for cyclic synchronous position, 9 velocity, 10 torque",
    )
    return None


def read_flag(params: Params, name: str, out: Collector) -> bool:
    """Return a flag that is true if absent; FSN116 for words other than true and false."""
    text = params.text(name)
    if text is None or text in ("true", "false"):
        return text != "false"
    word = text.strip().lower()
    meant = "true or false"
    if word in ("false", "no", "off", "0"):
        meant = "false"
    elif word in ("true", "yes", "on", "1"):
        meant = "true"
    message = f"{name} is {_short(text)!r}; allowed are true and false"
    out.add("FSN116", params.span(name), message, hint=f"write {meant}")
    return meant != "false"
