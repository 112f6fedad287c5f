"""Operators of mutants for Python: those of cosmic-ray, and what it lacks in the same form.

Left out is what no test of behaviour can notice: annotations, docstrings, imports, `__all__`,
what only a type checker reads, caches, `frozen` and `slots` of a dataclass, `strict` of `zip`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from itertools import pairwise

import parso
from cosmic_ray.ast import ast_nodes
from cosmic_ray.operators.operator import Operator
from cosmic_ray.operators.provider import OperatorProvider
from parso.python.tree import Name, PythonLeaf, PythonNode
from parso.tree import BaseNode, Leaf, NodeOrLeaf

FROM_COSMIC_RAY = re.split(
    r"\s+",
    """
    ReplaceBinaryOperator_Add_Sub ReplaceBinaryOperator_Sub_Add ReplaceBinaryOperator_Mul_FloorDiv
    ReplaceBinaryOperator_Div_Mul ReplaceBinaryOperator_FloorDiv_Mul
    ReplaceBinaryOperator_Mod_FloorDiv ReplaceBinaryOperator_Pow_Mul
    ReplaceBinaryOperator_RShift_LShift ReplaceBinaryOperator_LShift_RShift
    ReplaceBinaryOperator_BitOr_BitAnd ReplaceBinaryOperator_BitAnd_BitOr
    ReplaceBinaryOperator_BitXor_BitOr
    ReplaceComparisonOperator_Eq_NotEq ReplaceComparisonOperator_NotEq_Eq
    ReplaceComparisonOperator_Lt_LtE ReplaceComparisonOperator_Lt_GtE
    ReplaceComparisonOperator_LtE_Lt ReplaceComparisonOperator_LtE_Gt
    ReplaceComparisonOperator_Gt_GtE ReplaceComparisonOperator_Gt_LtE
    ReplaceComparisonOperator_GtE_Gt ReplaceComparisonOperator_GtE_Lt
    ReplaceComparisonOperator_Is_IsNot ReplaceComparisonOperator_IsNot_Is
    ReplaceUnaryOperator_Delete_Not ReplaceUnaryOperator_Delete_USub
    ReplaceUnaryOperator_Delete_Invert
    AddNot ReplaceTrueWithFalse ReplaceFalseWithTrue ReplaceAndWithOr ReplaceOrWithAnd
    ReplaceBreakWithContinue ReplaceContinueWithBreak NumberReplacer
    RemoveDecorator ZeroIterationForLoop
""".strip(),
)

Span = tuple[tuple[int, int], tuple[int, int]]


class Own(Operator):
    """One of ours: `texts` gives the codes that may stand in the node's place."""

    @classmethod
    def examples(cls):
        """Those are in the tests of this folder."""
        return ()

    def texts(self, node: NodeOrLeaf) -> Iterator[str]:
        """Yield each other code of the node, without its prefix."""
        raise NotImplementedError

    def mutation_positions(self, node: NodeOrLeaf) -> Iterator[Span]:
        """Yield the node's place once for each text."""
        for _ in self.texts(node):
            yield (node.start_pos, node.end_pos)

    def mutate(self, node: NodeOrLeaf, index: int) -> NodeOrLeaf:
        """Return the node that stands in its place."""
        return PythonLeaf(list(self.texts(node))[index], node.start_pos)


def _code(nodes: list[NodeOrLeaf]) -> str:
    return "".join(n.get_code() for n in nodes).strip()


def _swapped(nodes: list[NodeOrLeaf], i: int, j: int) -> str:
    """Return the code with the nodes at two places exchanged, each place keeping its prefix."""
    out = []
    for k, node in enumerate(nodes):
        other = nodes[{i: j, j: i}.get(k, k)]
        out.append(node.get_first_leaf().prefix + other.get_code(include_prefix=False))
    return "".join(out).strip()


class SwapArguments(Own):
    """`f(a, b)` to `f(b, a)`, `f(x=a, y=b)` to `f(x=b, y=a)`."""

    def texts(self, node):
        if node.type != "arglist" or node.parent.type != "trailer":
            return
        if node.get_previous_leaf().get_previous_leaf().value in ("min", "max"):
            return
        children = node.children
        values = [n for n in children if not (isinstance(n, Leaf) and n.value == ",")]
        plain = [n for n in values if n.type != "argument"]
        named = [n for n in values if n.type == "argument" and _is_named(n)]
        for a, b in pairwise(plain):
            if _code([a]) != _code([b]):
                yield _swapped(children, children.index(a), children.index(b))
        for a, b in pairwise(named):
            one, two = _code(a.children[2:]), _code(b.children[2:])
            if one != two:
                codes = {
                    id(a): f"{a.children[0].value}={two}",
                    id(b): f"{b.children[0].value}={one}",
                }
                yield "".join(
                    n.get_first_leaf().prefix + codes.get(id(n), n.get_code(include_prefix=False))
                    for n in children
                ).strip()


def _is_named(node: NodeOrLeaf) -> bool:
    return isinstance(node.children[0], Name) and _code([node.children[1]]) == "="


class RemoveKeywordArgument(Own):
    """`f(a, x=b)` to `f(a)`."""

    def texts(self, node):
        if node.type == "trailer" and len(node.children) == 3:
            only = node.children[1]
            if only.type == "argument" and _is_named(only):
                yield "()"
        if node.type != "arglist" or node.parent.type != "trailer":
            return
        for i, child in enumerate(node.children):
            named = child.type == "argument" and _is_named(child)
            if named and child.children[0].value != "strict":
                kept = node.children[:i] + node.children[i + 2 :]
                yield _code(kept).rstrip(",")


class RemoveStatement(Own):
    """A call, a change of something, a `return` or `raise` goes."""

    def texts(self, node):
        if node.type in ("return_stmt", "raise_stmt", "del_stmt", "assert_stmt"):
            # A function's end is `return None`; who asks for True or False sees False.
            if _code([node]) not in ("return False", "return None") or not _is_last(node):
                yield "pass"
        elif node.type == "keyword" and node.value in ("return", "raise", "continue", "break"):
            if node.parent.type == "simple_stmt":
                yield "pass"
        elif node.parent is not None and node.parent.type == "simple_stmt":
            call = node.type in ("atom_expr", "power") and node.children[-1].type == "trailer"
            # Without a plain `name = …` the name is missing below; everything notices that.
            if call or (node.type == "expr_stmt" and not _is_plain(node)):
                yield "pass"


def _is_last(node: NodeOrLeaf) -> bool:
    """Return whether nothing but the end of the function follows the statement."""
    while node.type != "funcdef":
        if node.type in ("for_stmt", "while_stmt", "try_stmt"):
            return False
        after = node.get_next_sibling()
        if after is not None and node.parent.type == "suite":
            return False
        node = node.parent
    return True


def _is_plain(node: NodeOrLeaf) -> bool:
    return (node.children[0].type == "name" and _code([node.children[1]]) in ("=", "")) or (
        node.children[1].type == "annassign"
    )


class ReturnNone(Own):
    """`return x` to `return None`."""

    def texts(self, node):
        if node.type == "return_stmt" and _code(node.children[1:]) not in ("None", "False"):
            yield "return None"


class OtherText(Own):
    """A text begins with what was never there, or ends before its last letter."""

    def texts(self, node):
        if node.type == "fstring_string" and node.value.strip():
            yield "XX" + node.value
        if node.type == "string":
            match = re.fullmatch(r"""([A-Za-z]*)('{3}|"{3}|'|")(.*)\2""", node.value, re.S)
            if match:
                yield f"{match[1]}{match[2]}XX{match[3]}{match[2]}"


class SwapNames(Own):
    """`f"{a} {b}"` to `f"{b} {a}"`."""

    def texts(self, node):
        if node.type != "fstring":
            return
        places = [i for i, n in enumerate(node.children) if n.type == "fstring_expr"]
        for i, j in pairwise(places):
            if _code([node.children[i]]) != _code([node.children[j]]):
                nodes = list(node.children)
                nodes[i], nodes[j] = nodes[j], nodes[i]
                yield _code(nodes)


class SwapMembership(Own):
    """`in` to `not in` and back."""

    def texts(self, node):
        if node.type == "keyword" and node.value == "in" and node.parent.type == "comparison":
            yield "not in"
        if node.type == "comp_op" and _code([node]) == "not in":
            yield "in"


class OtherSlice(Own):
    """A bound of a slice goes, or moves by one."""

    def texts(self, node):
        if node.type != "subscript":
            return
        codes = [n.get_code(include_prefix=False) for n in node.children]
        for i, code in enumerate(codes):
            if code != ":" and node.children[i].type not in ("sliceop", "number"):
                for other in ("", f"({code}) + 1", f"({code}) - 1"):
                    yield "".join([*codes[:i], other, *codes[i + 1 :]])


OPPOSITES = {
    a: b
    for pair in (
        ("min", "max"),
        ("any", "all"),
        ("lower", "upper"),
        ("startswith", "endswith"),
        ("removeprefix", "removesuffix"),
        ("lstrip", "rstrip"),
        ("partition", "rpartition"),
        ("floor", "ceil"),
    )
    for a, b in (pair, pair[::-1])
} | {"sorted": "list"}


class OtherWord(Own):
    """A function's name to that of its opposite."""

    def texts(self, node):
        if node.type == "name" and node.value in OPPOSITES:
            after = node.get_next_leaf()
            if after is not None and after.value == "(":
                yield OPPOSITES[node.value]


class OtherException(Own):
    """`except A` to an exception that nothing raises, each of several by itself."""

    def texts(self, node):
        clause = node.parent
        if clause is not None and clause.type == "testlist_comp" and node.type != "operator":
            node, clause = clause.parent, clause.parent.parent
        elif _code([node]).startswith("("):
            return
        if clause is not None and clause.type == "except_clause" and clause.children[1] is node:
            yield "StopAsyncIteration"


OWN = (
    OtherException,
    SwapArguments,
    RemoveKeywordArgument,
    RemoveStatement,
    ReturnNone,
    OtherText,
    SwapNames,
    SwapMembership,
    OtherSlice,
    OtherWord,
)


def all_operators() -> list[tuple[str, Operator]]:
    """Return the name and an instance of each operator."""
    theirs = OperatorProvider()
    return [(name, theirs[name]()) for name in FROM_COSMIC_RAY] + [
        (cls.__name__, cls()) for cls in OWN
    ]


def _span(node: ast.AST) -> Span:
    return (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)


def _is_call_of(node: ast.AST, *names: str) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names


def _of_types_only(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what below the node nobody but a type checker or a reader reads."""
    if isinstance(node, ast.Import | ast.ImportFrom):
        yield node
    elif isinstance(node, ast.AnnAssign | ast.arg) and node.annotation:
        yield node.annotation
    elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.returns:
        yield node.returns
    elif _is_call_of(node, "cast", "TypeVar"):
        yield node.args[0]
    elif _is_call_of(node, "zip"):
        yield from (k for k in node.keywords if k.arg == "strict")
    elif isinstance(node, ast.If | ast.Assign):
        told = node.test if isinstance(node, ast.If) else node.targets[0]
        if ast.unparse(told) in ("TYPE_CHECKING", "__all__"):
            yield node


def not_behaviour(tree: ast.AST) -> list[Span]:
    """Return the places whose mutants no test can notice."""
    out = []
    for node in ast.walk(tree):
        out += [_span(n) for n in _of_types_only(node)]
        body = getattr(node, "body", None)
        if isinstance(body, list):
            out += [
                _span(s)
                for s in body
                if isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant)
            ]
        for decorator in getattr(node, "decorator_list", ()):
            name = ast.unparse(decorator).split("(")[0].rpartition(".")[2]
            whole = name in (
                "cache",
                "lru_cache",
                "overload",
                "runtime_checkable",
                "contextmanager",
            )
            if whole or (name == "dataclass" and isinstance(decorator, ast.Call)):
                first, last = _span(decorator)
                out.append(((first[0], first[1] - whole), last))
    return out


class _Kept:
    """The leaves and children of a small tree, to put them back after an operator changed it."""

    def __init__(self, node: NodeOrLeaf) -> None:
        self.leaves = []
        self.nodes = []
        for n in ast_nodes(node):
            if isinstance(n, BaseNode):
                self.nodes.append((n, list(n.children)))
            else:
                self.leaves.append((n, n.value, n.prefix))

    def put_back(self) -> None:
        for node, children in self.nodes:
            node.children = children
            for child in children:
                child.parent = node
        for leaf, value, prefix in self.leaves:
            leaf.value, leaf.prefix = value, prefix


def changes(source: str) -> Iterator[tuple[str, str]]:
    """Yield the operator's name and the changed source of each mutant; it may not compile."""
    lines = source.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    tree = parso.parse(source)
    # ast counts columns in bytes, parso in letters; a place in a line is all that is compared.
    skipped = not_behaviour(ast.parse(source))
    operators = all_operators()
    for node in ast_nodes(tree):
        if not isinstance(node, PythonNode | Leaf | BaseNode) or node.type == "file_input":
            continue
        for name, operator in operators:
            spans = list(operator.mutation_positions(node))
            for index, (first, last) in enumerate(spans):
                if any(a <= first and last <= b for a, b in skipped):
                    continue
                leaf = node.get_first_leaf()
                prefix = leaf.prefix
                begin = starts[node.start_pos[0] - 1] + node.start_pos[1]
                end = starts[node.end_pos[0] - 1] + node.end_pos[1]
                kept = _Kept(node)
                other = operator.mutate(node, index)
                code = "" if other is None else other.get_code().removeprefix(prefix)
                kept.put_back()
                if isinstance(other, parso.python.tree.Number):
                    code = code.strip()
                if code != source[begin:end]:
                    yield name, source[:begin] + code + source[end:]
