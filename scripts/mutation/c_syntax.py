"""What may be changed in a C file: exact byte ranges from its syntax tree."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import tree_sitter_c
from tree_sitter import Language, Node, Parser

_PARSER = Parser(Language(tree_sitter_c.language()))

_COMPARISONS = {
    "<": ("<=", ">="),
    "<=": ("<", ">"),
    ">": (">=", "<="),
    ">=": (">", "<"),
    "==": ("!=",),
    "!=": ("==",),
}
_LOGICAL = {"&&": ("||",), "||": ("&&",)}
_ARITHMETIC = {"+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "%": ("*",)}
_BITS = {"&": ("|",), "|": ("&",), "^": ("|",), "<<": (">>",), ">>": ("<<",)}
_KINDS = (
    ("comparison", _COMPARISONS),
    ("logical", _LOGICAL),
    ("arithmetic", _ARITHMETIC),
    ("bits", _BITS),
)
_LOOPS = ("for_statement", "while_statement", "do_statement")
# More room than is needed shows nowhere.
_ALLOCATORS = ("malloc", "calloc", "fsn_calloc_prefaulted")


@dataclass(frozen=True, slots=True)
class Change:
    """Bytes ``start`` to ``end`` become ``text``."""

    start: int
    end: int
    operator: str
    text: str


def changes(source: bytes) -> list[Change]:
    """Return every change of a file, in order of their places."""
    root = _PARSER.parse(source).root_node
    silent = _argued_lines(source, root)
    found = [c for c in _walk(root) if source.count(b"\n", 0, c.start) + 1 not in silent]
    found += [c for c in _macros(root, source) if source.count(b"\n", 0, c.start) + 1 not in silent]
    return sorted(set(found), key=lambda c: (c.start, c.end, c.operator, c.text))


def function_lines(source: bytes) -> list[range]:
    """Return the lines of each function body, counted from 1."""
    root = _PARSER.parse(source).root_node
    return [
        range(node.start_point.row + 1, node.end_point.row + 2)
        for node in _descend(root)
        if node.type == "function_definition"
    ]


def _descend(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        yield from _descend(child)


def _argued_lines(source: bytes, root: Node) -> set[int]:
    """Lines with a comment ``mutants: WHY``; one that stands alone speaks for the next line.

    What says why no test reaches it is not changed either.
    """
    lines = source.split(b"\n")
    found: set[int] = set()
    unreached = 0
    for node in _descend(root):
        if node.type != "comment":
            continue
        text, row = _text(node), node.start_point.row
        if "mutants:" in text:
            alone = not lines[row][: node.start_point.column].strip()
            found.add(node.end_point.row + 2 if alone else row + 1)
        elif "GCOVR_EXCL_LINE" in text:
            found.add(row + 1)
        elif "GCOVR_EXCL_START" in text:
            unreached = node.end_point.row + 2
        elif "GCOVR_EXCL_STOP" in text:
            found |= set(range(unreached, row + 1))
    return found


def _text(node: Node) -> str:
    assert node.text is not None
    return node.text.decode()


def _walk(node: Node) -> Iterator[Change]:
    if node.type in ("preproc_include", "preproc_def", "preproc_function_def", "ERROR"):
        return
    if node.type == "preproc_ifdef" and _text(node).startswith("#ifdef FSN_TEST_RIG"):
        return  # what the tests of the ordinary build do not see
    maker = _MAKERS.get(node.type)
    if maker is not None:
        yield from maker(node)
    for child in node.children:
        if not (node.type == "array_declarator" and child == node.child_by_field_name("size")):
            yield from _walk(child)


def _whole(node: Node, operator: str, text: str) -> Change:
    return Change(node.start_byte, node.end_byte, operator, text)


def _binary(node: Node) -> Iterator[Change]:
    sign = node.child_by_field_name("operator")
    assert sign is not None
    for kind, table in _KINDS:
        for other in table.get(_text(sign), ()):
            yield _whole(sign, kind, other)


def _assignment(node: Node) -> Iterator[Change]:
    sign = node.child_by_field_name("operator")
    assert sign is not None
    for kind, table in _KINDS[2:]:
        for other in table.get(_text(sign)[:-1], ()):
            yield _whole(sign, kind, other + "=")


def _update(node: Node) -> Iterator[Change]:
    parent = node.parent
    if parent is not None and parent.type == "for_statement":
        return  # the loop ends nowhere: that says nothing about the tests
    sign = node.child_by_field_name("operator")
    assert sign is not None
    yield _whole(sign, "arithmetic", "--" if _text(sign) == "++" else "++")


def _unary(node: Node) -> Iterator[Change]:
    sign = node.child_by_field_name("operator")
    assert sign is not None
    if _text(sign) in ("!", "~", "-"):
        yield _whole(sign, "bits" if _text(sign) == "~" else "negation", "")


def _called(arguments: Node) -> str:
    """Return the name of the function that takes the arguments."""
    function = arguments.parent and arguments.parent.child_by_field_name("function")
    return _text(function) if function else ""


def _is_room(node: Node) -> bool:
    """Whether a number is part of what an allocation gets."""
    while node.parent is not None and node.type != "argument_list":
        if node.type.endswith(("_statement", "declaration")):
            return False
        node = node.parent
    return _called(node) in _ALLOCATORS


def _number(node: Node) -> Iterator[Change]:
    text = _text(node)
    larger = not _is_room(node)
    digits = text.rstrip("uUlL")
    if digits.lower().startswith("0x") or digits.isdecimal():
        base = 8 if digits.isdecimal() and digits[0] == "0" else 0
        value, suffix = int(digits, base), text[len(digits) :]
        if larger:
            yield _whole(node, "constant", f"{value + 1}{suffix}")
        if value > 0:
            yield _whole(node, "constant", f"{value - 1}{suffix}")
    else:
        yield _whole(node, "constant", f"({text} + 1)")


def _boolean(node: Node) -> Iterator[Change]:
    yield _whole(node, "constant", "false" if _text(node) == "true" else "true")


def _character(node: Node) -> Iterator[Change]:
    yield _whole(node, "text", f"({_text(node)} + 1)")


def _string(node: Node) -> Iterator[Change]:
    yield _whole(node, "text", '"XX' + _text(node)[1:])


def _condition(node: Node) -> Iterator[Change]:
    condition = node.child_by_field_name("condition")
    if condition is not None:
        text = _text(condition)
        inner = text if condition.type == "parenthesized_expression" else f"({text})"
        yield _whole(condition, "negation", f"(!{inner})")


def _statement(node: Node) -> Iterator[Change]:
    if not _text(node).endswith(";"):
        return  # the use of a macro
    inner = node.named_children[0] if node.named_children else None
    if inner is not None and inner.type == "cast_expression":
        inner = inner.child_by_field_name("value")
    if inner is not None and inner.type in (
        "call_expression",
        "assignment_expression",
        "update_expression",
    ):
        yield _whole(node, "removed", ";")


def _enclosing(node: Node, *kinds: str) -> Node | None:
    found = node.parent
    while found is not None and found.type not in kinds:
        found = found.parent
    return found


def _leave(node: Node) -> Iterator[Change]:
    yield _whole(node, "removed", ";")
    near = _enclosing(node, "switch_statement", *_LOOPS)
    if near is not None and near.type in _LOOPS and node.type != "goto_statement":
        yield _whole(node, "jump", "continue;" if node.type == "break_statement" else "break;")


def _return(node: Node) -> Iterator[Change]:
    body = node.parent
    function = _enclosing(node, "function_definition")
    assert body is not None
    assert function is not None
    last = body.parent == function and body.named_children[-1] == node
    if not last:
        yield _whole(node, "removed", ";")
    kind = function.child_by_field_name("type")
    if kind is not None and _text(kind) == "bool" and node.named_children:
        value = node.named_children[0]
        if value.type not in ("true", "false"):
            yield _whole(value, "negation", f"!({_text(value)})")


def _arguments(node: Node) -> Iterator[Change]:
    parts = [c for c in node.named_children if c.type != "comment"]
    if _called(node) in ("memcmp", "strcmp", "strncmp", *_ALLOCATORS):
        parts = parts[1:]  # whether two are equal does not depend on their order, nor a product
    for one, two in itertools.pairwise(parts):
        if _text(one) != _text(two):
            between = node.text[one.end_byte - node.start_byte : two.start_byte - node.start_byte]
            text = _text(two) + between.decode() + _text(one)
            yield Change(one.start_byte, two.end_byte, "swapped arguments", text)


def _initialisers(node: Node) -> Iterator[Change]:
    children = node.children
    for at, child in enumerate(children):
        if child.type == "initializer_pair":
            after = children[at + 1]
            end = after.end_byte if after.type == "," else child.end_byte
            yield Change(child.start_byte, end, "removed", "")


_MAKERS = {
    "binary_expression": _binary,
    "assignment_expression": _assignment,
    "update_expression": _update,
    "unary_expression": _unary,
    "number_literal": _number,
    "true": _boolean,
    "false": _boolean,
    "char_literal": _character,
    "string_literal": _string,
    "if_statement": _condition,
    "while_statement": _condition,
    "for_statement": _condition,
    "conditional_expression": _condition,
    "expression_statement": _statement,
    "break_statement": _leave,
    "continue_statement": _leave,
    "goto_statement": _leave,
    "return_statement": _return,
    "argument_list": _arguments,
    "initializer_list": _initialisers,
}


def _macros(root: Node, source: bytes) -> Iterator[Change]:
    """Changes inside the bodies of macros, which the tree holds as plain text."""
    for node in _descend(root):
        if node.type != "preproc_function_def":
            continue
        body = node.child_by_field_name("value")
        if body is None:
            continue
        text = source[body.start_byte : body.end_byte].replace(b"\\\n", b" \n")
        for head, tail in ((b"void f(void) { switch (0) {", b"}}"), (b"int f = ", b";")):
            tree = _PARSER.parse(head + text + tail).root_node
            shift = body.start_byte - len(head)
            if not tree.has_error:
                for c in _walk(tree):
                    if len(head) <= c.start < c.end <= len(head) + len(text) and "\n" not in c.text:
                        yield Change(c.start + shift, c.end + shift, c.operator, c.text)
                break
