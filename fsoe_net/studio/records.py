"""Documents about the network: its report, robot, differences, incidents, the intervention log.

Each one is the page written by the command of that name. It is served without scripts and in a
sandbox, and only its own styles are permitted, by their hashes.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import html
import os
import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from fsoe_net.acceptance.report import make_report, plan_to_show, since
from fsoe_net.compare.diff import compare, diff_document
from fsoe_net.compare.read import read_side
from fsoe_net.compare.sides import side_of_network
from fsoe_net.diag.printable import printable
from fsoe_net.document.model import Bullets, Document, Level, Part, Section, Verdict, cell, words
from fsoe_net.document.write_html import document_html
from fsoe_net.errors import FsnError, InputError
from fsoe_net.formats.shared.files import open_file
from fsoe_net.incident.evidence import gather
from fsoe_net.incident.incident_facts import facts_of
from fsoe_net.incident.incident_read import IncidentReader
from fsoe_net.intervention_log.chain import LogFilter
from fsoe_net.intervention_log.document import log_document
from fsoe_net.intervention_log.files import log_files, select_entries
from fsoe_net.model.resolve import Resolution
from fsoe_net.project.check import Checked, check_files
from fsoe_net.project.companion_files import CompanionFile, CompanionKind
from fsoe_net.project.known import read_record
from fsoe_net.project.snapshot import snapshot
from fsoe_net.report.incident_document import incident_document
from fsoe_net.studio.folder import Folder
from fsoe_net.studio.workspace import Workspace
from fsoe_net.version import __version__

_MOST_ENTRIES = 200  # of an intervention log, as in the command
_STYLES = re.compile(r'<style>(.*?)</style>|\sstyle="([^"]*)"', re.DOTALL)

Query = Mapping[str, str]


class Records:
    """Routes of the documents.

    Args:
        workspace: The network file; a report uses the text in the page.
        folder: Folder of the network file.

    Attributes:
        routes: Routes to add to the server.
    """

    def __init__(self, workspace: Workspace, folder: Folder) -> None:
        self._workspace, self._folder = workspace, folder
        self._making = asyncio.Lock()
        self._makers: dict[str, Callable[[Query], Document]] = {
            "report": self._report,
            "robot": self._robot,
            "difference": self._difference,
            "incident": self._incident,
            "log": self._log,
        }
        self.routes = [
            Route("/api/records", self._list),
            Route("/records/{kind}", self._document),
        ]

    async def _list(self, _: Request) -> Response:
        rows = await run_in_threadpool(self._folder.look)
        files = [
            {
                "number": number,
                "name": printable(row.name),
                "kind": row.kind.value,
                "words": row.words,
            }
            for number, row in rows
        ]
        commands = _commands(self._workspace.path, [row for _, row in rows])
        return JSONResponse({"error": "", "files": files, "commands": commands})

    async def _document(self, request: Request) -> Response:
        make = self._makers.get(request.path_params["kind"])
        if make is None:
            return JSONResponse({"error": "unknown document"}, 404)
        try:
            async with self._making:  # one at a time: a report of a large network takes seconds
                document = await run_in_threadpool(make, request.query_params)
        except FsnError as exc:
            return document_response(_refused(exc), 422)
        return document_response(document)

    def _network(self) -> tuple[Checked, Resolution]:
        checked = self._workspace.checked
        if checked.resolution is None:
            raise InputError("the text is not a valid network at present: correct it first")
        return checked, checked.resolution

    def _of(self, query: Query, key: str, *kinds: CompanionKind) -> CompanionFile | None:
        number = query.get(key, "")
        return self._folder.find(number, *kinds) if number else None

    def _report(self, query: Query) -> Document:
        test_record = self._of(query, "test_record", CompanionKind.TEST_RECORD)
        accepted = self._of(query, "accepted", CompanionKind.RECORD)
        return make_report(
            self._network()[0],
            test_record=None if test_record is None else test_record.path,
            accepted=None if accepted is None else read_record(accepted.path),
            loading=self._workspace.loading,
        ).document

    def _robot(self, query: Query) -> Document:
        row = self._folder.find(query.get("file"), CompanionKind.ROBOT)
        folder = os.path.dirname(row.path)
        controllers = [
            other
            for _, other in self._folder.look()
            if other.kind is CompanionKind.CONTROLLERS and os.path.dirname(other.path) == folder
        ]
        rows = [row, *controllers]
        checked = check_files([r.path for r in rows], self._workspace.loading)
        return snapshot(checked, ", ".join(r.name for r in rows))

    def _difference(self, query: Query) -> Document:
        checked, resolution = self._network()
        path = self._workspace.path
        kinds = (CompanionKind.RECORD, CompanionKind.ROBOT, CompanionKind.OTHER)
        # The saved file is read again, because another program may have changed it.
        other = self._of(query, "file", *kinds)  # without a file: the network file as saved
        before = read_side(path if other is None else other.path, self._workspace.loading)
        now = side_of_network(resolution, f"{path}, as it is in the page")
        difference = compare(before, now)
        sections: list[Section] = []
        # Only an acceptance record lists the tests; other files name no steps to repeat.
        if other is not None and other.kind is CompanionKind.RECORD:
            plan = plan_to_show(resolution, checked.diagnostics)
            again = since(read_record(other.path), resolution, plan).again
            parts: tuple[Part, ...] = (Bullets(tuple(cell(step) for step in again)),)
            if not again:
                parts = (words("No step of the test record."),)
            title = "To be tried again at the machine"
            sections.append(Section(key="again", title=title, parts=parts))
        same = Verdict("No difference", Level.NOTE)
        return replace(
            diff_document(before, now, difference),
            title=f"Difference to {'the saved file' if other is None else other.name}",
            version=__version__,
            verdict=same if difference.same else Verdict("It differs", Level.WARNING),
            sections=tuple(sections),
        )

    def _incident(self, query: Query) -> Document:
        row = self._folder.find(query.get("file"), CompanionKind.INCIDENT)
        with open_file(row.path) as stream:
            facts = facts_of(gather(IncidentReader(row.name, stream)))
        return incident_document(facts, __version__)

    def _log(self, query: Query) -> Document:
        row = self._folder.find(query.get("file"), CompanionKind.LOG)
        wanted = LogFilter(most=_MOST_ENTRIES)
        return log_document(select_entries(log_files([row.path]), wanted), __version__)


def _refused(exc: FsnError) -> Document:
    found = exc.diagnostics if isinstance(exc, InputError) else ()
    text = exc.message if isinstance(exc, InputError) else str(exc)
    return Document(
        title="This cannot be shown",
        version=__version__,
        verdict=Verdict(text, Level.ERROR),
        lead=tuple(words(f"{d.span}: {d.message}. {d.hint}") for d in found),
    )


def document_response(document: Document, status: int = 200) -> Response:
    """Return a document as a page without scripts and external resources."""
    text = document_html(document)
    styles = dict.fromkeys(html.unescape(a or b) for a, b in _STYLES.findall(text))
    hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in styles)
    allowed = " ".join(f"'sha256-{value}'" for value in hashes)
    # Hashes of style attributes count with 'unsafe-hashes' only (CSP level 3).
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-hashes' {allowed}; sandbox; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    )
    headers = {
        "content-security-policy": policy,
        "cross-origin-opener-policy": "unsafe-none",  # some browsers open no sandbox otherwise
    }
    return HTMLResponse(text, status, headers)


def _commands(network: str, rows: list[CompanionFile]) -> list[str]:
    """Return the commands for a person to sign off the network in its folder."""
    name = os.path.basename(network)
    test_record = next((row.name for row in rows if row.kind is CompanionKind.TEST_RECORD), None)
    before = next((row.name for row in rows if row.kind is CompanionKind.RECORD), None)
    # A record is never overwritten: the new one refers to the one that it replaces.
    record = "acceptance.yaml" if before is None else "acceptance-new.yaml"
    replaces = "" if before is None else f"--replaces {shlex.quote(before)} "
    net, test = shlex.quote(name), shlex.quote(test_record or "test-record.yaml")
    first = [f"test-record {net} -o {test}"] if test_record is None else []
    lines = [
        *first,
        f"report {net} --test-record {test} -o report.html",
        f"report {net} --test-record {test} -o report.json",
        f"acceptance record {net} --test-record {test} --report report.html --report report.json "
        "--author NAME --author-competence TEXT --verifier NAME --verifier-competence TEXT "
        f"--equipment TEXT --environment TEXT {replaces}-o {record}",
        f"acceptance sign {record} --key KEY --as author",
        f"acceptance sign {record} --key KEY --as verifier",
    ]
    return [printable(f"fsoe-net {line}") for line in lines]
