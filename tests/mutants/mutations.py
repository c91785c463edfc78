"""The mutants of a module, made by the operators of mutmut and a few of our own.

Ours stay: mutmut 3 neither negates a condition nor leaves a call out, and these are the likely bugs of a
fail-safe. For the others, ours drop the variants that no test can distinguish.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import libcst as cst
import libcst.matchers as m
from libcst.metadata import MetadataWrapper
from mutmut.mutation import mutators
from mutmut.mutation.file_mutation import MutationVisitor
from mutmut.mutation.pragma_handling import IgnoredCode


@dataclass(frozen=True)
class Mutant:
    module: str
    """The path of the module in the checkout."""
    line: int
    """The first line that differs."""
    change: str
    """The function and the changed lines: the same wherever the function moves."""
    code: str
    """The source of the changed module."""


def _one_string(node: cst.BaseString) -> Iterable[cst.BaseString]:
    return islice(mutators.operator_string(node), 1)  # the others change only the case


def _arguments(node: cst.Call) -> Iterator[cst.Call]:
    """Leave a keyword argument out; replace a positional one by None."""
    for index, argument in enumerate(node.args):
        others = (node.args[:index], node.args[index + 1 :])
        if argument.keyword is not None:
            yield node.with_changes(args=[*others[0], *others[1]])
        elif not argument.star and not m.matches(argument.value, m.Name("None")):
            changed = argument.with_changes(value=cst.Name("None"))
            yield node.with_changes(args=[*others[0], changed, *others[1]])


def _assignment(node: cst.Assign | cst.AnnAssign) -> Iterator[cst.CSTNode]:
    """Assign None, but do not replace another false value: hardly any code distinguishes them."""
    if node.value is not None and not m.matches(node.value, m.Name("None") | m.Name("False")):
        yield from mutators.operator_assignment(node)


def _call_for_its_effect(node: cst.Expr) -> Iterator[cst.Pass]:
    if isinstance(node.value, cst.Call):
        yield cst.Pass()


def _condition(node: cst.If | cst.While | cst.CompIf) -> Iterator[cst.CSTNode]:
    inner = node.test.with_changes(lpar=[cst.LeftParen()], rpar=[cst.RightParen()])
    yield node.with_changes(test=cst.UnaryOperation(cst.Not(), inner))


# mutmut has no operator that negates a condition or leaves a call out. Our operators for arguments,
# assignments and texts make fewer mutants than its own: each costs a run of the tests, and many say the same.
_OPERATORS: list[tuple[type, Callable[[Any], Iterable[cst.CSTNode]]]] = [
    (cst.BaseNumber, mutators.operator_number),
    (cst.BaseString, _one_string),
    (cst.Name, mutators.operator_name),
    (cst.Assign, _assignment),
    (cst.AnnAssign, _assignment),
    (cst.AugAssign, mutators.operator_augmented_assignment),
    (cst.UnaryOperation, mutators.operator_remove_unary_ops),
    (cst.Lambda, mutators.operator_lambda),
    (cst.CSTNode, mutators.operator_keywords),
    (cst.CSTNode, mutators.operator_swap_op),
    (cst.Match, mutators.operator_match),
    (cst.IfExp, mutators.operator_if_exp),
    (cst.Call, _arguments),
    (cst.Expr, _call_for_its_effect),
    (cst.If, _condition),
    (cst.While, _condition),
    (cst.CompIf, _condition),
]


class _Visitor(MutationVisitor):
    """Visits the code that runs in a service: not its types, nor the line that starts it."""

    def _skip_node_and_children(self, node: cst.CSTNode) -> bool:
        return bool(m.matches(node, _NOT_RUN)) or super()._skip_node_and_children(node)


_NOT_RUN = (
    m.If(test=m.Name("TYPE_CHECKING") | m.Comparison(left=m.Name("__name__")))
    | m.Assign(value=m.Call(func=m.Name("TypeVar")))
    | m.Assign(targets=[m.AssignTarget(m.Name("__all__") | m.Name("__slots__"))])
)


def mutants(root: Path, module: str) -> Iterator[Mutant]:
    """Yield the mutants of a module of a checkout, in the order of its lines."""
    source = (root / module).read_text(encoding="utf-8")
    functions = _functions(source)
    wrapper = MetadataWrapper(cst.parse_module(source))
    visitor = _Visitor(_OPERATORS, IgnoredCode(set(), set(), set()))
    tree = wrapper.visit(visitor)
    seen = {source}
    for mutation in visitor.mutations:
        code = tree.deep_replace(mutation.original_node, mutation.mutated_node).code  # type: ignore[attr-defined]
        if code not in seen and _compiles(code):
            seen.add(code)
            yield _mutant(module, source, code, functions)


def _mutant(module: str, source: str, code: str, functions: list[tuple[range, str]]) -> Mutant:
    before, after = source.splitlines(), code.splitlines()
    matcher = difflib.SequenceMatcher(None, before, after, autojunk=False)
    changes = [change for change in matcher.get_opcodes() if change[0] != "equal"]
    line = changes[0][1] + 1
    old = " ".join(text.strip() for _, begin, end, _, _ in changes for text in before[begin:end])
    new = " ".join(text.strip() for _, _, _, begin, end in changes for text in after[begin:end])
    function = next((name for lines, name in functions if line in lines), "module")
    return Mutant(module, line, f"{function}: {old} → {new}", code)


def _functions(source: str) -> list[tuple[range, str]]:
    """Return the lines and the qualified name of each function and class, inner ones first."""
    found: list[tuple[range, str]] = []

    def visit(node: ast.AST, prefix: str) -> None:
        for child in ast.iter_child_nodes(node):
            name = prefix
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                name = f"{prefix}.{child.name}".lstrip(".")
                assert child.end_lineno is not None
                found.append((range(child.lineno, child.end_lineno + 1), name))
            visit(child, name)

    visit(ast.parse(source), "")
    return sorted(found, key=lambda each: len(each[0]))


def _compiles(code: str) -> bool:
    try:
        compile(code, "mutant", "exec")
    except SyntaxError:
        return False
    return True
