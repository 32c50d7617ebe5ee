"""Mutants of a module: small wrong changes of its syntax tree, each of which a test should notice.

Left alone is what no test can or should notice: annotations, docstrings, texts of messages, and ``__all__``.
"""

from __future__ import annotations

import ast
import copy
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass

COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Div, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitAnd,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift,
}  # fmt: skip
SWAPPED = [("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"), ("any", "all"), ("floor", "ceil"),
           ("amin", "amax"), ("nanmin", "nanmax"), ("startswith", "endswith")]  # fmt: skip
OTHER = {a: b for pair in SWAPPED for a, b in (pair, pair[::-1])}
Path = tuple[tuple[str, int | None], ...]  # from the root of a tree to a node: fields and places in them


@dataclass(frozen=True)
class Mutant:
    """One change.

    Attributes
    ----------
    function : str
    at : int
        Line of the change.
    line, last_line : int
        Of the statement that holds it.
    change : str
        Source text before and after.
    in_body : bool
        Whether it takes effect when a function is called, and not on import.
    make : callable
        Returns the module's tree with the change.
    """

    function: str
    at: int
    line: int
    last_line: int
    change: str
    in_body: bool
    make: Callable[[], ast.Module]


def mutants(source: str) -> list[Mutant]:
    """List all mutants of a module, in the order of its text."""
    tree = ast.parse(source)
    found: list[Mutant] = []
    for node, path, function, lines, in_body in _sites(tree, (), "module", (0, 0), in_body=False):
        for new, words in _changes(node):
            before = "" if words else f"{ast.unparse(node)} -> "
            change = before + (words or ("nothing" if isinstance(new, ast.Pass) else ast.unparse(new)))
            found.append(
                Mutant(function, getattr(node, "lineno", lines[0]), *lines, change, in_body, _maker(source, path, new))
            )
    return found


def sampled(every: list[Mutant], name: str, count: int) -> list[int]:
    """Choose so many mutants of a file by a seed that is its name."""
    return sorted(random.Random(name).sample(range(len(every)), min(count, len(every))))


def _maker(source: str, path: Path, new: ast.AST) -> Callable[[], ast.Module]:
    def make() -> ast.Module:
        tree = ast.parse(source)
        at: ast.AST = tree
        for name, index in path[:-1]:
            at = getattr(at, name) if index is None else getattr(at, name)[index]
        name, index = path[-1]
        old = getattr(at, name) if index is None else getattr(at, name)[index]
        fresh = ast.copy_location(copy.deepcopy(new), old)
        if index is None:
            setattr(at, name, fresh)
        else:
            getattr(at, name)[index] = fresh
        return ast.fix_missing_locations(tree)

    return make


def _sites(
    node: ast.AST, path: Path, function: str, lines: tuple[int, int], *, in_body: bool
) -> Iterator[tuple[ast.AST, Path, str, tuple[int, int], bool]]:
    """Walk over what may be changed; a site's lines are those of its innermost statement, without its body."""
    if isinstance(node, ast.JoinedStr | ast.Import | ast.ImportFrom):
        return
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        function = node.name if function == "module" else f"{function}.{node.name}"
    if isinstance(node, ast.stmt):
        body = getattr(node, "body", None)
        lines = (node.lineno, max(node.lineno, body[0].lineno - 1) if body else node.end_lineno or node.lineno)
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return
    if path:
        yield node, path, function, lines, in_body
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params", "bases"):
            continue
        inner = in_body or (name == "body" and isinstance(node, ast.FunctionDef))
        for index, child in enumerate(value if isinstance(value, list) else [value]):
            if isinstance(child, ast.AST):
                step = (name, index if isinstance(value, list) else None)
                yield from _sites(child, (*path, step), function, lines, in_body=inner)


def _changes(node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
    """Give what a node may be changed to, with words where source text would not show it."""
    match node:
        case ast.Compare(ops=ops):
            for k, op in enumerate(ops):
                for other in COMPARISONS[type(op)]:
                    new = copy.deepcopy(node)
                    new.ops[k] = other()
                    yield new, ""
        case ast.BinOp(op=op) if type(op) in ARITHMETIC and not _is_text(node):
            new = copy.deepcopy(node)
            new.op = ARITHMETIC[type(op)]()
            yield new, ""
        case ast.AugAssign(op=op):
            if type(op) in ARITHMETIC:
                new = copy.deepcopy(node)
                new.op = ARITHMETIC[type(op)]()
                yield new, ""
            yield ast.Pass(), ""
        case ast.Constant(value=bool() as value):
            yield ast.Constant(not value), ""
        case ast.Constant(value=int() | float() as value):
            yield from ((ast.Constant(other), "") for other in {2 * value, value + 1, value * 0} - {value})
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield node.operand, ""
        case ast.BoolOp(op=op):
            new = copy.deepcopy(node)
            new.op = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield new, ""
        case ast.If() | ast.While() | ast.IfExp():
            new = copy.deepcopy(node)
            new.test = ast.UnaryOp(ast.Not(), node.test)
            yield new, f"if {ast.unparse(node.test)} -> if not"
        case ast.Return(value=value) if value is not None and not (
            isinstance(value, ast.Constant) and value.value is None
        ):
            yield ast.Return(ast.Constant(None)), ""
        case ast.Expr(value=ast.Call() | ast.Yield() | ast.Await()) | ast.Raise() | ast.Continue() | ast.Break():
            yield ast.Pass(), ""
        case ast.Name(id=name) if name in OTHER:
            yield ast.Name(OTHER[name], node.ctx), ""
        case ast.Attribute(attr=name) if name in OTHER:
            yield ast.Attribute(node.value, OTHER[name], node.ctx), ""


def _is_text(node: ast.BinOp) -> bool:
    return any(isinstance(n, ast.JoinedStr) or (isinstance(n, ast.Constant) and isinstance(n.value, str))
               for n in (node.left, node.right))  # fmt: skip
