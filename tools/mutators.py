"""Single-point faults in a source file: one operator, number or condition is another."""

import ast
from bisect import bisect
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import accumulate

OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}


@dataclass(frozen=True)
class Mutant:
    """A fault: bytes of the file from `start` to `end` replaced by `new`.

    `lines` are those that run it, none where it is run on import; `function` are then those of the
    whole function, if it is in the head of one.
    """

    file: str
    line: int
    text: str  # the line of the source, stripped
    old: str
    new: str
    start: int
    end: int
    lines: tuple[int, int] | None
    function: tuple[int, int] | None = None

    @property
    def change(self) -> str:
        """For people, and for the list of equivalent mutants."""
        return f"{self.old} → {self.new}"

    @property
    def is_number(self) -> bool:
        """Whether it is a number that is another one."""
        return self.old[:1].isdigit() or self.old[:1] == "."

    def applied(self, source: bytes) -> bytes:
        """The file with the fault."""
        return source[: self.start] + self.new.encode() + source[self.end :]


def mutants(file: str, source: bytes) -> Iterator[Mutant]:
    """All faults of a file, in its order."""
    yield from _Finder(file, source).of_body(ast.parse(source).body, function=None)


class _Finder:
    def __init__(self, file: str, source: bytes) -> None:
        self._file, self._source = file, source
        self._lines = source.split(b"\n")
        self._starts = [0, *accumulate(len(line) + 1 for line in self._lines)]

    def of_body(self, body: list[ast.stmt], function: tuple[int, int] | None) -> Iterator[Mutant]:
        for statement in body:
            if not _types_alone(statement):
                yield from self._of_statement(statement, function)

    def _of_statement(
        self, statement: ast.stmt, function: tuple[int, int] | None
    ) -> Iterator[Mutant]:
        inner = [each for each in ast.iter_child_nodes(statement) if _is_block(each)]
        last = min(map(_first_line, inner), default=(statement.end_lineno or 0) + 1) - 1
        lines = (statement.lineno, max(last, statement.lineno))
        defines = isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef)
        span = (statement.lineno, statement.end_lineno or statement.lineno)
        run = lines if function is not None and not defines else None
        around = span if defines else None
        for node in _expressions(statement):
            for old, new, start, end in self._of_node(node, on_import=function is None):
                line = bisect(self._starts, start)
                text = self._lines[line - 1].decode().strip()
                yield Mutant(self._file, line, text, old, new, start, end, run, around)
        for each in inner:
            block = each.body if isinstance(each, ast.ExceptHandler | ast.match_case) else [each]
            yield from self.of_body(block, span if defines else function)

    def _of_node(self, node: ast.AST, *, on_import: bool) -> Iterator[tuple[str, str, int, int]]:
        match node:
            case ast.BinOp(left, op, right) if not (on_import and isinstance(op, ast.BitOr)):
                yield from self._between(left, type(op), right)
            case ast.Compare(left, [op], [right]):
                yield from self._between(left, type(op), right)
            case ast.BoolOp(op, [left, right, *_]):
                yield from self._between(left, type(op), right)
            case ast.AugAssign(target, op, value):
                yield from self._between(target, type(op), value)
            case ast.UnaryOp(ast.USub()):
                start = self._span(node)[0]
                yield "-", "", start, start + len("-")
            case ast.UnaryOp(ast.Not()):
                start = self._span(node)[0]
                yield "not", "", start, start + len("not ")
            case ast.Constant(value) if (new := _other(value)) is not None:
                start, end = self._span(node)
                yield self._source[start:end].decode(), new, start, end
            case ast.If(test) | ast.While(test) | ast.IfExp(test):
                if isinstance(test, ast.Name | ast.Attribute | ast.Call):
                    start, end = self._span(test)
                    name = self._source[start:end].decode()
                    yield name, f"(not {name})", start, end

    def _between(
        self, left: ast.expr, kind: type[ast.AST], right: ast.expr
    ) -> Iterator[tuple[str, str, int, int]]:
        if kind not in OPERATORS:
            return
        old, new = OPERATORS[kind]
        first, last = self._span(left)[1], self._span(right)[0]
        position = self._source[first:last].find(old.encode())
        if position >= 0:
            start = first + position
            yield old, new, start, start + len(old)

    def _span(self, node: ast.expr | ast.AST) -> tuple[int, int]:
        assert isinstance(node, ast.expr)
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        start = self._starts[node.lineno - 1] + node.col_offset
        return start, self._starts[node.end_lineno - 1] + node.end_col_offset


def _other(value: object) -> str | None:
    match value:
        case bool():
            return str(not value)
        case int():
            return str(value + 1)
        case float():
            return repr(value * 1.5) if value else "1.0"
    return None


def _is_block(node: ast.AST) -> bool:
    return isinstance(node, ast.stmt | ast.ExceptHandler | ast.match_case)


def _first_line(block: ast.AST) -> int:
    if isinstance(block, ast.match_case):
        return block.pattern.lineno
    assert isinstance(block, ast.stmt | ast.ExceptHandler)
    return block.lineno


def _types_alone(statement: ast.stmt) -> bool:
    """Whether a statement is there for the type checker or the reader."""
    match statement:
        case ast.If(ast.Name("TYPE_CHECKING")) | ast.Expr(ast.Constant()):
            return True
        case ast.Import() | ast.ImportFrom() | ast.Assert():
            return True
        case ast.Assign([ast.Name("__all__")]):
            return True
    return False


def _expressions(statement: ast.stmt) -> Iterator[ast.AST]:
    """The statement and what it evaluates, but no annotations, decorators or inner statements."""
    pending: list[ast.AST] = [statement]
    while pending:
        node = pending.pop(0)
        yield node
        unused = {id(each) for each in getattr(node, "decorator_list", [])}
        unused |= {id(getattr(node, each, None)) for each in ("annotation", "returns")}
        spec = [node.format_spec] if isinstance(node, ast.FormattedValue) else []
        unused |= {id(each) for each in spec}
        pending += [
            each
            for each in ast.iter_child_nodes(node)
            if id(each) not in unused and not _is_block(each)
        ]
