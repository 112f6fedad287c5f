"""An acceptance record: the accepted configuration, the persons, and accepted warnings."""

from __future__ import annotations

from collections.abc import Mapping

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located
from fsoe_net.model.network import SourceFile
from fsoe_net.model.safety import SafetyFunction


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedBy(Located):
    """A person, and the day (ISO 8601) on which that person signed.

    The name may end with a principal: the name of the person in a file of allowed signers, as in
    ``A. Meier <a.meier@example.org>``. ``competence``: the qualification of the person, in words;
    missing in records of older versions.
    """

    name: str
    date: str
    competence: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedSignature:
    """A valid signature of a record.

    Attributes:
        role: ``author`` or ``verifier``.
        name: Name of the person, as in the record.
        principal: Principal of that person in the file of allowed signers.
        date: Day of the signature according to the record (ISO 8601).
        key: Type and SHA-256 of the key.
    """

    role: str
    name: str
    principal: str
    date: str
    key: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JustifiedFinding(Located):
    """A warning accepted by a person.

    Attributes:
        code: ``FSNxyz``.
        place: Its location, as ``file:line:column``; lines move, so it is not a key.
        message: Its message.
        reason: Why it is accepted.
        by: The person who accepts it.
    """

    code: str
    place: str
    message: str
    reason: str
    by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class JustifiedStep(Located):
    """A test step that was not done at the machine, the reason, and the responsible person."""

    step: str
    reason: str
    by: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervention(Located):
    """An intervention after an acceptance: what and why, by whom, and when (ISO 8601)."""

    what: str
    by: str
    date: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Replaced(Located):
    """The record replaced by this one; ``whole`` is the fingerprint that it accepted."""

    source: SourceFile
    whole: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptance(Located):
    """The accepted configuration.

    Attributes:
        network: Name of the network.
        project: Machine or project; may be empty.
        made_with: Version of fsoe-net.
        whole: The fingerprint, SHA-256 in hex.
        sections: Hashes of its sections by name.
        plan: The accepted plan, bytes of a ``.fsnplan``.
        safety_functions: The accepted safety functions.
        inputs: Files of the network.
        reports: Files of the signed report.
        open_points: Number of open points in the report, and
        assumptions: number of assumptions.
        test_record: File of the test record.
        steps: Number of its steps done at the machine.
        author: Author of the configuration.
        verifier: Verifier of the configuration; not the author.
        findings: Accepted warnings.
        steps_left_out: Steps not done at the machine, or with an implausible time or day; device
            data not read, and missing bus evidence.
        equipment: Test equipment in words, one item each.
        environment: Place and conditions of the tests, in words.
        attachments: Photos and other files of the record, by their path from its folder.
        interventions: All changes since the first record, oldest first.
        replaces: The previous record; ``None`` for the first one.
    """

    network: str
    project: str = ""
    made_with: str
    whole: str
    sections: Mapping[str, str]
    plan: bytes
    safety_functions: tuple[SafetyFunction, ...] = ()
    inputs: tuple[SourceFile, ...]
    reports: tuple[SourceFile, ...]
    open_points: int
    assumptions: int
    test_record: SourceFile
    steps: int
    author: SignedBy
    verifier: SignedBy
    findings: tuple[JustifiedFinding, ...] = ()
    steps_left_out: tuple[JustifiedStep, ...] = ()
    equipment: tuple[str, ...] = ()
    environment: str = ""
    attachments: tuple[SourceFile, ...] = ()
    interventions: tuple[Intervention, ...] = ()
    replaces: Replaced | None = None

    def justification(self, code: str, message: str) -> JustifiedFinding | None:
        """Return the person who accepted a warning; another message is another warning."""
        return next((f for f in self.findings if (f.code, f.message) == (code, message)), None)
