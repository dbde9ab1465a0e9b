"""Small wrongs of a module: one sign, operator, index, number, name or interval changed."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass

OPERATORS: dict[type, tuple[str, tuple[str, ...]]] = {
    ast.Add: ("+", ("-",)),
    ast.Sub: ("-", ("+",)),
    ast.Mult: ("*", ("/",)),
    ast.Div: ("/", ("*",)),
    ast.Pow: ("**", ("*",)),
    ast.FloorDiv: ("//", ("/",)),
    ast.Mod: ("%", ("*",)),
    ast.BitOr: ("|", ("&",)),
    ast.BitAnd: ("&", ("|",)),
    ast.Lt: ("<", ("<=", ">")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.And: ("and", ("or",)),
    ast.Or: ("or", ("and",)),
}

_PAIRS = (
    *("sin cos", "minimum maximum", "min max", "floor ceil", "any all", "start end", "gyro accel"),
    *("velocity position", "gyro_bias accel_bias", "gyro_k accel_k", "lever_arm accel_quadratic"),
    *("angle velocity", "radius_n radius_e", "meridian prime_vertical", "per_n per_e"),
    *("sin_lat cos_lat", "upper lower", "first later", "passes max_passes", "zeros ones"),
    *("DEGREE ARCSEC", "DEG_PER_HOUR DEG_PER_SQRT_HOUR", "PPM MICRO_G", "dwell_step turn_step"),
    *("columns rows", "row column", "truth estimate", "old new", "low high", "a b", "ie en"),
)
OTHERS = {a: b for pair in _PAIRS for a, b in (pair.split(), pair.split()[::-1])}
"""Names that stand for something else of the same sort; taken where the function knows both."""

INTERVALS = ("update_interval", "interval", "dt")
"""Times between events; a mutant has 1 s."""

_GUARDS = ("strict", "exist_ok")
_COMPILED = ("compiled", "inlined", "spliced")


@dataclass(frozen=True)
class Mutation:
    """One change of a module.

    Attributes
    ----------
    module : str
    line : int
    kind, old, new : str
        ``sign``, ``operator``, ``number``, ``name`` or ``interval``; what is replaced, and by what.
    text : str
        The line as it was.
    source : bytes
        Of the whole module with the change.
    compiled : bool
        Whether machine code may hold what is changed.
    """

    module: str
    line: int
    kind: str
    old: str
    new: str
    text: str
    source: bytes
    compiled: bool


def mutations(module: str, source: bytes) -> list[Mutation]:
    """All mutants of a module, in order of place."""
    tree = ast.parse(source)
    lines = source.split(b"\n")
    begin = [0]
    for line in lines:
        begin.append(begin[-1] + len(line) + 1)
    out = []
    for node, compiled, words in _nodes(tree, source.decode()):
        for kind, first, last, new in _changes(node, source, begin):
            if kind == "name" and new not in words:
                continue  # would not run at all
            changed = source[:first] + new.encode() + source[last:]
            try:
                ast.parse(changed)
            except SyntaxError:
                continue
            line = source[:first].count(b"\n")
            text = lines[line].decode().strip()
            old = source[first:last].decode()
            out.append(Mutation(module, line + 1, kind, old, new, text, changed, compiled))
    return sorted(out, key=lambda mutation: (mutation.line, mutation.old, mutation.new))


def _nodes(tree: ast.Module, source: str) -> Iterator[tuple[ast.AST, bool, set[str]]]:
    """What may be changed, whether machine code may hold it, and the words of its function.

    Not what says nothing of numbers: imports, annotations, decorators, texts, what is raised, and
    guards such as ``strict=True``.
    """

    def walk(
        node: ast.AST, compiled: bool, words: set[str]
    ) -> Iterator[tuple[ast.AST, bool, set[str]]]:
        if isinstance(node, ast.Import | ast.ImportFrom | ast.Raise | ast.JoinedStr):
            return
        if isinstance(node, ast.keyword) and node.arg in _GUARDS:
            return
        if isinstance(node, ast.FunctionDef):
            names = {name.id for name in node.decorator_list if isinstance(name, ast.Name)}
            compiled = bool(names & {*_COMPILED})
            words = {*re.findall(r"\w+", ast.unparse(node))}
            children: list[ast.AST] = [*node.args.defaults, *node.args.kw_defaults, *node.body]
        elif isinstance(node, ast.AnnAssign):
            children = [node.value] if node.value else []
        elif isinstance(node, ast.ClassDef):
            children = [*node.body]
        else:
            yield node, compiled, words
            children = [*ast.iter_child_nodes(node)]
        for child in children:
            if child is not None:
                yield from walk(child, compiled, words)

    every = {*re.findall(r"\w+", source)}
    for statement in tree.body:
        yield from walk(statement, True, every)


Change = tuple[str, int, int, str]


def _changes(node: ast.AST, source: bytes, begin: list[int]) -> Iterator[Change]:
    """Kind, first and last byte, and new text of every change of one node."""
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            yield from _operator(op, left, right, source, begin)
        case ast.BoolOp(op=op, values=[left, right, *_]):
            yield from _operator(op, left, right, source, begin)
        case ast.Compare(left=left, ops=[op, *_], comparators=[right, *_]):
            yield from _operator(op, left, right, source, begin)
        case ast.AugAssign(target=target, op=op, value=value):
            yield from _operator(op, target, value, source, begin)
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
            yield "sign", _place(node, begin)[0], _place(operand, begin)[0], ""
        case ast.Constant(value=bool(value)):
            yield "number", *_place(node, begin), str(not value)
        case ast.Constant(value=int(value)):
            yield "number", *_place(node, begin), str(value + 1)
        case ast.Constant(value=float(value)):
            yield "number", *_place(node, begin), repr(1.5 * value if value else 1.0)
        case ast.Name(id=name, ctx=ast.Load()):
            first, last = _place(node, begin)
            yield from _name(name, first, last)
        case ast.Attribute(attr=name, ctx=ast.Load()):
            last = _place(node, begin)[1]
            yield from _name(name, last - len(name), last)


def _name(name: str, first: int, last: int) -> Iterator[Change]:
    if name in OTHERS:
        yield "name", first, last, OTHERS[name]
    if name in INTERVALS:
        yield "interval", first, last, "1.0"


def _operator(
    op: ast.AST, left: ast.expr, right: ast.expr, source: bytes, begin: list[int]
) -> Iterator[Change]:
    if type(op) not in OPERATORS:
        return
    old, news = OPERATORS[type(op)]
    between = _place(left, begin)[1], _place(right, begin)[0]
    found = re.search(re.escape(old.encode()), source[slice(*between)])
    if found:
        first = between[0] + found.start()
        for new in news:
            yield "operator", first, first + len(old), new


def _place(node: ast.expr, begin: list[int]) -> tuple[int, int]:
    """First and last byte of an expression."""
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    first = begin[node.lineno - 1] + node.col_offset
    return first, begin[node.end_lineno - 1] + node.end_col_offset
