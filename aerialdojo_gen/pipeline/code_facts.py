"""Facts of a module's source: a digest independent of comments, docstrings and layout, and its imports."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

# Fields of the syntax tree that do not change what the code does.
_UNCOUNTED = frozenset({"ctx", "kind", "type_comment", "type_ignores"})
_IMPORTERS = frozenset({"import_module", "__import__"})


@dataclass(frozen=True, order=True)
class Edge:
    """An import."""

    module: str  # Absolute name of the module
    name: str = ""
    uses: tuple[str, ...] = ("*",)


@dataclass(frozen=True)
class Definition:
    """A name that a module binds at its top level."""

    digest: str  # Of the statements that bind it, hexadecimal
    names: tuple[str, ...]  # Names of the module that it refers to
    edges: tuple[Edge, ...]  # What it imports, and what it uses of the module's imports


@dataclass(frozen=True)
class Facts:
    """Facts of a module's source."""

    digest: str  # Of the whole module, hexadecimal
    edges: tuple[Edge, ...]  # All imports, also inside functions; without those for type checkers
    definitions: dict[str, Definition] = field(default_factory=dict)  # By name; empty unless requested
    unknown: tuple[str, ...] = ()  # Dynamic imports whose module is unknown
    reexports: dict[str, tuple[Edge, ...]] = field(default_factory=dict)


def module_facts(source: bytes, module: str, is_package: bool, by_definition: bool = False) -> Facts:
    """Read a module's source."""
    tree = ast.parse(source)
    package = module if is_package else module.rpartition(".")[0]
    imports = _Imports(tree, module, package)
    edges = imports.edges([tree])
    if not by_definition:
        return Facts(_digest([tree]), edges, {}, tuple(sorted(imports.unknown)))
    statements: dict[str, list[ast.stmt]] = {}
    for statement in tree.body:
        for name in _bound(statement):
            statements.setdefault(name, []).append(statement)
    definitions = {
        name: Definition(
            _digest(nodes),
            tuple(sorted(_read_names(nodes) & set(statements))),
            imports.edges(nodes),
        )
        for name, nodes in statements.items()
        if name not in imports.bound
    }
    own = module.split(".")[0]
    reexports = {
        name: tuple(sorted(edge for edge in imports.bound[name] if edge.module.split(".")[0] == own))
        for name in statements
        if name in imports.bound
    }
    return Facts(
        _digest([tree]),
        edges,
        definitions,
        tuple(sorted(imports.unknown)),
        {name: edges for name, edges in reexports.items() if edges},
    )


def _bound(statement: ast.stmt) -> Iterator[str]:
    """Names that a top-level statement binds."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield statement.name
    elif isinstance(statement, ast.Import | ast.ImportFrom):
        for alias in statement.names:
            yield alias.asname or alias.name.split(".")[0]
    elif isinstance(statement, ast.Assign | ast.AnnAssign | ast.AugAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        for node in (inner for target in targets for inner in ast.walk(target)):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                yield node.id


def _read_names(nodes: Sequence[ast.AST]) -> set[str]:
    return {n.id for node in nodes for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}


class _Imports:
    """All import statements of a module."""

    def __init__(self, tree: ast.Module, module: str, package: str) -> None:
        self._module, self._package = module, package
        typing_only = {
            id(inner)
            for node in ast.walk(tree)
            if isinstance(node, ast.If) and _type_checking(node.test)
            for statement in node.body
            for inner in ast.walk(statement)
        }
        self._typing_only = typing_only
        # Imports by the name that they bind.
        self.bound: dict[str, list[Edge]] = {}
        self.unknown: set[str] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in typing_only:
                for name, edge in self._pairs(node):
                    self.bound.setdefault(name, []).append(edge)

    def _pairs(self, node: ast.Import | ast.ImportFrom) -> Iterator[tuple[str, Edge]]:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.asname or alias.name.split(".")[0], Edge(alias.name)
            return
        origin = node.module or ""
        if node.level:
            above = self._package.split(".")[: len(self._package.split(".")) - node.level + 1]
            origin = ".".join([*above, *([node.module] if node.module else [])])
        if origin == "__future__":
            return
        for alias in node.names:
            yield alias.asname or alias.name, Edge(origin, alias.name)

    def edges(self, nodes: Sequence[ast.AST]) -> tuple[Edge, ...]:
        """What nodes import, statically or by `importlib`, and what they use of the module's imports."""
        found: set[Edge] = set()
        attributes: dict[str, set[str]] = {}
        mentions: dict[str, int] = {}
        for node in (inner for outer in nodes for inner in ast.walk(outer)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                attributes.setdefault(node.value.id, set()).add(node.attr)
                mentions[node.value.id] = mentions.get(node.value.id, 0) - 1
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                mentions[node.id] = mentions.get(node.id, 0) + 1
            elif isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in self._typing_only:
                for name, _ in self._pairs(node):
                    mentions.setdefault(name, 0)
            elif isinstance(node, ast.Call) and _called(node) in _IMPORTERS and node.args:
                target = self._dynamic(node.args[0])
                found |= {target} if target else set()
                self.unknown |= set() if target else {ast.unparse(node.args[0])}
        for name in mentions.keys() & self.bound.keys():
            # A name that also occurs without an attribute may be used in any way.
            uses = ("*",) if mentions[name] > 0 else tuple(sorted(attributes.get(name, ())))
            found |= {Edge(edge.module, edge.name, uses) for edge in self.bound[name]}
        own = self._module.split(".")[0]
        inside = {edge for edge in found if edge.module.split(".")[0] == own}
        # Other packages count by their name.
        return tuple(sorted(inside | {Edge(edge.module.split(".")[0], "", ()) for edge in found - inside}))

    def _dynamic(self, argument: ast.expr) -> Edge | None:
        if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
            return Edge(argument.value)
        if not isinstance(argument, ast.JoinedStr):
            return None
        head = ""
        for part in argument.values:
            if isinstance(part, ast.Constant):
                head += str(part.value)
            elif isinstance(part, ast.FormattedValue) and (known := self._own_name(part.value)) is not None:
                head += known
            else:
                break
        # The rest of the name is unknown: any module below the package.
        return Edge(head[:-1], "**") if head.endswith(".") else None

    def _own_name(self, node: ast.expr) -> str | None:
        if isinstance(node, ast.Name) and node.id == "__name__":
            return self._module
        if isinstance(node, ast.Attribute) and node.attr == "__name__" and isinstance(node.value, ast.Name):
            for edge in self.bound.get(node.value.id, []):
                return f"{edge.module}.{edge.name}" if edge.name else edge.module
        return None


def _type_checking(test: ast.expr) -> bool:
    return (isinstance(test, ast.Name) and test.id == "TYPE_CHECKING") or (
        isinstance(test, ast.Attribute) and test.attr == "TYPE_CHECKING"
    )


def _called(call: ast.Call) -> str:
    function = call.func
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def _digest(nodes: list[Any]) -> str:
    tokens: list[str] = []
    for node in nodes:
        _serialize(node, tokens)
    return hashlib.sha256("\x00".join(tokens).encode("utf-8", "surrogatepass")).hexdigest()


def _serialize(node: Any, tokens: list[str]) -> None:
    """Write a tree as tokens, without empty fields, which differ between Python versions."""
    if isinstance(node, ast.AST):
        tokens.append(f"({type(node).__name__}")
        for name, value in ast.iter_fields(node):
            if name in _UNCOUNTED or value is None or value == []:
                continue
            if name == "body" and _has_docstring(node):
                value = value[1:]
            if isinstance(node, ast.Constant) and name == "value":
                tokens.append(f"{type(value).__name__} {value!r}")
                continue
            tokens.append(name)
            _serialize(value, tokens)
        tokens.append(")")
    elif isinstance(node, list):
        tokens.append("[")
        for item in node:
            _serialize(item, tokens)
        tokens.append("]")
    else:
        tokens.append(f"{type(node).__name__} {node!r}")


def _has_docstring(node: ast.AST) -> bool:
    if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) or not node.body:
        return False
    first = node.body[0]
    return (
        isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
    )
