"""Kernels of the CPU, translated to WGSL, so that every colour is defined once.

The shading kernels are written in a small part of Python: numbers, tuples of numbers, arrays that
are read one element at a time, ``if``, ``for`` over ranges, calls of each other. That part is
translated here, with the types that numba would find, except that there are only 32 bits: sums that
the CPU makes in double precision are made in single precision.

What a function is given at compile time (records of arrays, alternatives between two of them) is
not a value on the card: each combination gives a function of its own, as with numba.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from carstage_sim.render.gpu.values import (
    Array,
    Bound,
    Either,
    External,
    Record,
    Scalar,
    Static,
    TranslationError,
    Type,
    Value,
    constant,
    convert,
    join,
    tuple_name,
)

_CONVERSIONS: dict[Any, Scalar] = {
    np.float32: "f32", np.float64: "f32", float: "f32", int: "i32", np.int32: "i32",
    np.int64: "i32", np.uint32: "u32", bool: "bool",
}  # fmt: skip
_MATH = {
    getattr(math, name): name.removeprefix("f") if name == "fabs" else name
    for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "pow")
}
_EXTREMES: dict[Any, str] = {
    min: "min", max: "max", abs: "abs", np.minimum: "min", np.maximum: "max", np.abs: "abs",
}  # fmt: skip
_OPERATORS: dict[type[ast.operator], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^",
}  # fmt: skip
_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip

_SUPPORT = """
fn whole_mod(a: i32, b: i32) -> i32 { return ((a % b) + b) % b; }
fn whole_div(a: i32, b: i32) -> i32 { return (a - whole_mod(a, b)) / b; }
fn real_mod(a: f32, b: f32) -> f32 { return a - floor(a / b) * b; }
""" + "\n".join(
    f"fn power_{n}(x: f32) -> f32 {{ return {' * '.join(['x'] * n)}; }}" for n in range(2, 6)
)


@dataclass(slots=True)
class Translator:
    """Collects the WGSL functions of one program.

    Attributes:
        externals: functions that are written in WGSL.
        structures: names of the tuples that are used, with their members' types.
    """

    externals: Mapping[Callable[..., Any], External]
    structures: dict[str, tuple[Scalar, ...]] = field(default_factory=dict)
    _made: dict[tuple[Any, ...], tuple[str, Type | None]] = field(default_factory=dict)
    _texts: list[str] = field(default_factory=list)
    _choices: dict[str, str] = field(default_factory=dict)

    def source(self) -> str:
        """All functions so far, with what they need."""
        structures = (
            f"struct {name} {{ {', '.join(f'm{k}: {t}' for k, t in enumerate(types))} }}"
            for name, types in self.structures.items()
        )
        return "\n".join([_SUPPORT, *structures, *self._choices.values(), *self._texts])

    def structure(self, types: Sequence[Scalar]) -> str:
        """Name of the structure of a tuple, which is noted as used."""
        name = tuple_name(types)
        self.structures[name] = tuple(types)
        return name

    def function(
        self, python: Callable[..., Any], arguments: Sequence[Bound]
    ) -> tuple[str, Type | None]:
        """Translate a function for arguments of these kinds; its WGSL name and what it returns."""
        plain = getattr(python, "py_func", python)
        key = (plain, *(_kind_of(argument) for argument in arguments))
        if key not in self._made:
            name = f"{plain.__name__.strip('_')}_{len(self._made)}"
            self._made[key] = (name, None)
            body = _Body(self, plain, name, arguments)
            self._made[key] = (name, body.returned)
            self._texts.append(body.text)
        return self._made[key]

    def choice(self, first: Array, second: Array) -> str:
        """Name of a function that reads one of two arrays."""
        name = f"{first.read}_or_{second.read}"
        if name not in self._choices:
            indices = [f"i{k}" for k in range(first.axes)]
            parameters = "".join(f", {i}: i32" for i in indices)
            given = ", ".join(indices)
            self._choices[name] = (
                f"fn {name}(first: bool{parameters}) -> {first.scalar} {{\n"
                f"  if (first) {{ return {first.read}({given}); }}\n"
                f"  return {second.read}({given});\n}}"
            )
        return name


def _kind_of(argument: Bound) -> Any:
    if isinstance(argument, Value):
        return argument.code if argument.code in ("true", "false") else argument.type
    if isinstance(argument, Either):
        return "either", _kind_of(argument.first), _kind_of(argument.second)
    return argument.name if isinstance(argument, Record) else argument.read


class _Body:
    """One function, translated.

    The statements are gone through again until no variable's type changes any more.
    """

    def __init__(
        self,
        program: Translator,
        python: Callable[..., Any],
        name: str,
        arguments: Sequence[Bound],
    ) -> None:
        self._program = program
        known: dict[str, Any] = getattr(python, "__globals__", {})
        used = python.__code__.co_names
        self._globals = {name: known[name] for name in used if name in known}
        self._where = f"{python.__module__}.{python.__name__}"
        tree = ast.parse(textwrap.dedent(inspect.getsource(python))).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise TranslationError(f"{self._where} is no function")
        names = [argument.arg for argument in tree.args.args]
        self._types: dict[str, Type] = {}
        self._given: dict[str, Bound] = {}
        parameters, copies = [], []
        for parameter, argument in zip(names, arguments, strict=True):
            if isinstance(argument, Value) and argument.code in ("true", "false"):
                self._given[parameter] = argument
            elif isinstance(argument, Value):
                self._types[parameter] = argument.type
                parameters.append(f"{parameter}_in: {self._type_name(argument.type)}")
                copies.append(f"  v_{parameter} = {parameter}_in;")
            elif isinstance(argument, Either):
                parameters.append(f"{parameter}_first: bool")
                self._given[parameter] = Either(
                    f"{parameter}_first", argument.first, argument.second
                )
            else:
                self._given[parameter] = argument
        self.returned: Type | None = None
        while True:
            before = dict(self._types), self.returned
            self._static = dict(self._given)
            self._conditions: list[str] = []
            self._temporaries = 0
            lines = self._block(tree.body, 1)
            if (self._types, self.returned) == before:
                break
        declared = [f"  var v_{v}: {self._type_name(t)};" for v, t in self._types.items()]
        declared += [f"  var {condition}: bool;" for condition in dict.fromkeys(self._conditions)]
        result = "" if self.returned is None else f" -> {self._type_name(self.returned)}"
        head = f"fn {name}({', '.join(parameters)}){result} {{"
        self.text = "\n".join([head, *declared, *copies, *lines, "}"])

    def _type_name(self, kind: Type) -> str:
        return self._program.structure(kind) if isinstance(kind, tuple) else kind

    def _fail(self, node: ast.AST, what: str) -> TranslationError:
        return TranslationError(f"{self._where}: {what} is not translated: {ast.unparse(node)}")

    # Statements

    def _block(self, statements: Sequence[ast.stmt], depth: int) -> list[str]:
        return [
            "  " * depth + line for statement in statements for line in self._statement(statement)
        ]

    def _statement(self, node: ast.stmt) -> list[str]:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return []
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            return self._assign(node.targets[0], node.value)
        if isinstance(node, ast.AugAssign):
            value = self._operation(
                node, node.op, self._value(node.target), self._value(node.value)
            )
            return self._store(node.target, value)
        if isinstance(node, ast.If):
            test = self._truth(node.test)
            if test in ("true", "false"):
                # Known before: what is not asked for need not be compiled.
                return self._block(node.body if test == "true" else node.orelse, 0)
            lines = [f"if ({test}) {{", *self._block(node.body, 1)]
            if node.orelse:
                lines += ["} else {", *self._block(node.orelse, 1)]
            return [*lines, "}"]
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name) and not node.orelse:
            return self._for(node, node.target.id)
        if isinstance(node, ast.While) and not node.orelse:
            return [f"while ({self._truth(node.test)}) {{", *self._block(node.body, 1), "}"]
        if isinstance(node, ast.Return):
            return self._return(node)
        if isinstance(node, (ast.Continue, ast.Break, ast.Pass)):
            return {ast.Continue: ["continue;"], ast.Break: ["break;"], ast.Pass: []}[type(node)]
        raise self._fail(node, "a statement")

    def _return(self, node: ast.Return) -> list[str]:
        if node.value is None:
            return ["return;"]
        value = self._value(node.value)
        self.returned = value.type if self.returned is None else join(self.returned, value.type)
        self._type_name(self.returned)
        return [f"return {convert(value, self.returned)};"]

    def _for(self, node: ast.For, variable: str) -> list[str]:
        call = node.iter
        if not (isinstance(call, ast.Call) and ast.unparse(call.func) == "range"):
            raise self._fail(node, "a loop")
        ends = [convert(self._value(a), "i32") for a in call.args]
        start, stop, step = ("0i", *ends, "1i") if len(ends) == 1 else (*ends, "1i")[:3]
        relation = ">" if step.startswith("(-") else "<"
        counter = self._temporary("count")
        self._note(variable, "i32")
        return [
            f"for (var {counter} = {start}; {counter} {relation} {stop}; {counter} += {step}) {{",
            f"  v_{variable} = {convert(Value(counter, 'i32'), self._types[variable])};",
            *self._block(node.body, 1),
            "}",
        ]

    def _temporary(self, kind: str) -> str:
        self._temporaries += 1
        return f"{kind}_{self._temporaries}"

    def _note(self, variable: str, kind: Type) -> None:
        known = self._types.get(variable)
        self._types[variable] = kind if known is None else join(known, kind)

    def _assign(self, target: ast.expr, source: ast.expr) -> list[str]:
        if isinstance(target, ast.Tuple) and isinstance(source, ast.Tuple):
            # Python has all values before it changes any variable.
            bounds = [self._bound(part) for part in source.elts]
            if not any(isinstance(bound, Value) for bound in bounds):
                pairs = zip(target.elts, source.elts, strict=True)
                return [line for pair in pairs for line in self._assign(*pair)]
            lines, held = [], []
            for part in source.elts:
                value = self._value(part)
                name = self._temporary("held")
                lines.append(f"let {name} = {value.code};")
                held.append(Value(name, value.type))
            for part, value in zip(target.elts, held, strict=True):
                lines += self._store(part, value)
            return lines
        bound = self._bound(source)
        if not isinstance(bound, Value):
            if not isinstance(target, ast.Name):
                raise self._fail(target, "a record's new name")
            return self._rename(target.id, bound)
        if isinstance(target, ast.Tuple):
            if not isinstance(bound.type, tuple):
                raise self._fail(source, "what is taken apart")
            name = self._temporary("held")
            lines = [f"let {name} = {bound.code};"]
            for k, (part, kind) in enumerate(zip(target.elts, bound.type, strict=True)):
                lines += self._store(part, Value(f"{name}.m{k}", kind))
            return lines
        return self._store(target, bound)

    def _rename(self, variable: str, bound: Static) -> list[str]:
        if not isinstance(bound, Either):
            self._static[variable] = bound
            return []
        condition = f"{variable}_first"
        self._static[variable] = Either(condition, bound.first, bound.second)
        if bound.condition == condition:
            return []
        self._conditions.append(condition)
        return [f"{condition} = {bound.condition};"]

    def _store(self, target: ast.expr, value: Value) -> list[str]:
        if isinstance(target, ast.Name):
            self._note(target.id, value.type)
            return [f"v_{target.id} = {convert(value, self._types[target.id])};"]
        if isinstance(target, ast.Subscript):
            array = self._bound(target.value)
            if isinstance(array, Array) and array.write:
                given = [*self._indices(target), convert(value, array.scalar)]
                return [f"{array.write}({', '.join(given)});"]
        raise self._fail(target, "an assignment")

    # Expressions

    def _value(self, node: ast.expr) -> Value:
        bound = self._bound(node)
        if not isinstance(bound, Value):
            raise self._fail(node, "a record as a value")
        return bound

    def _truth(self, node: ast.expr) -> str:
        value = self._value(node)
        if value.type in ("i32", "u32", "f32"):
            return f"({value.code} != {value.type}(0))"
        return value.code

    def _bound(self, node: ast.expr) -> Bound:
        if isinstance(node, ast.Constant):
            return constant(node.value)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.Attribute):
            return self._attribute(node)
        if isinstance(node, ast.Subscript):
            return self._subscript(node)
        if isinstance(node, ast.Call):
            return self._call(node)
        if isinstance(node, ast.BinOp):
            return self._operation(node, node.op, self._value(node.left), self._value(node.right))
        if isinstance(node, ast.UnaryOp):
            return self._unary(node)
        if isinstance(node, ast.BoolOp):
            return Value(self._connected(node), "bool")
        if isinstance(node, ast.Compare):
            return self._comparison(node)
        if isinstance(node, ast.IfExp):
            return self._alternative(node)
        if isinstance(node, ast.Tuple):
            parts = [self._value(part) for part in node.elts]
            kinds = tuple(str(part.type) for part in parts)
            name = self._program.structure(kinds)
            return Value(f"{name}({', '.join(part.code for part in parts)})", kinds)
        raise self._fail(node, "an expression")

    def _connected(self, node: ast.BoolOp) -> str:
        decisive, idle = ("false", "true") if isinstance(node.op, ast.And) else ("true", "false")
        terms = [self._truth(value) for value in node.values]
        if decisive in terms:
            return decisive
        terms = [term for term in terms if term != idle]
        sign = " && " if isinstance(node.op, ast.And) else " || "
        return f"({sign.join(terms)})" if terms else idle

    def _name(self, node: ast.Name) -> Bound:
        if node.id in self._static:
            return self._static[node.id]
        if node.id in self._types:
            return Value(f"v_{node.id}", self._types[node.id])
        if node.id in self._globals:
            return constant(self._globals[node.id])
        raise self._fail(node, "a name")

    def _attribute(self, node: ast.Attribute) -> Bound:
        if isinstance(node.value, ast.Name):
            module = self._globals.get(node.value.id)
            if inspect.ismodule(module):
                return constant(getattr(module, node.attr))
        record = self._bound(node.value)
        if isinstance(record, Record):
            return record.member(node.attr)
        if isinstance(record, Either):
            first, second = (
                side.member(node.attr) if isinstance(side, Record) else side
                for side in (record.first, record.second)
            )
            if isinstance(first, Array) and isinstance(second, Array):
                return Either(record.condition, first, second)
        raise self._fail(node, "an attribute")

    def _indices(self, node: ast.Subscript) -> list[str]:
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        return [convert(self._value(part), "i32") for part in parts]

    def _subscript(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            array = self._bound(node.value.value)
            if isinstance(array, Array) and isinstance(node.slice, ast.Constant):
                return Value(array.sizes[int(str(node.slice.value))], "i32")
        source = self._bound(node.value)
        if isinstance(source, Value):
            if isinstance(source.type, tuple) and isinstance(node.slice, ast.Constant):
                k = int(str(node.slice.value))
                return Value(f"{source.code}.m{k}", source.type[k])
            raise self._fail(node, "a subscript")
        indices = self._indices(node)
        if isinstance(source, Array) and len(indices) == source.axes:
            return Value(f"{source.read}({', '.join(indices)})", source.scalar)
        if isinstance(source, Either):
            first, second = source.first, source.second
            if isinstance(first, Array) and isinstance(second, Array):
                name = self._program.choice(first, second)
                return Value(f"{name}({', '.join([source.condition, *indices])})", first.scalar)
        raise self._fail(node, "a subscript")

    def _call(self, node: ast.Call) -> Value:
        called = self._callee(node.func)
        if called in _CONVERSIONS and len(node.args) == 1:
            wanted = _CONVERSIONS[called]
            argument = node.args[0]
            if wanted == "u32" and isinstance(argument, ast.Constant):
                return constant(np.uint32(int(str(argument.value))))
            return Value(convert(self._value(argument), wanted), wanted)
        if called in _EXTREMES:
            values = [self._value(argument) for argument in node.args]
            kind = values[0].type
            for value in values:
                kind = join(kind, value.type)
            codes = [convert(value, kind) for value in values]
            name = _EXTREMES[called]
            text = codes[0] if name != "abs" else f"abs({codes[0]})"
            for code in codes[1:]:
                text = f"{name}({text}, {code})"
            return Value(text, kind)
        if called in (math.floor, np.floor):
            return Value(f"floor({convert(self._value(node.args[0]), 'f32')})", "f32")
        if called in _MATH:
            given = ", ".join(convert(self._value(argument), "f32") for argument in node.args)
            return Value(f"{_MATH[called]}({given})", "f32")
        arguments = [self._bound(argument) for argument in node.args]
        if called in self._program.externals:
            return self._program.externals[called](arguments)
        if not hasattr(called, "py_func"):
            raise self._fail(node, "a call")
        name, kind_of_result = self._program.function(called, arguments)
        if kind_of_result is None:
            raise self._fail(node, "a call of what returns nothing, or of itself,")
        given = ", ".join(
            argument.code if isinstance(argument, Value) else argument.condition
            for argument in arguments
            if isinstance(argument, (Value, Either))
            and not (isinstance(argument, Value) and argument.code in ("true", "false"))
        )
        return Value(f"{name}({given})", kind_of_result)

    def _callee(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return getattr(self._globals[node.value.id], node.attr)
        if isinstance(node, ast.Name):
            builtin = {"min": min, "max": max, "abs": abs, "int": int, "float": float, "bool": bool}
            return self._globals.get(node.id, builtin.get(node.id))
        raise self._fail(node, "a call")

    def _operation(self, node: ast.AST, operator: ast.operator, a: Value, b: Value) -> Value:
        kind = join(a.type, b.type)
        if isinstance(operator, ast.Pow):
            return self._power(a, b)
        if isinstance(operator, ast.Div):
            return Value(f"({convert(a, 'f32')} / {convert(b, 'f32')})", "f32")
        if isinstance(operator, (ast.LShift, ast.RShift)):
            sign = "<<" if isinstance(operator, ast.LShift) else ">>"
            return Value(f"({a.code} {sign} {convert(b, 'u32')})", a.type)
        if kind == "bool":
            kind = "i32"
        left, right = convert(a, kind), convert(b, kind)
        if isinstance(operator, (ast.Mod, ast.FloorDiv)):
            if kind == "f32" and isinstance(operator, ast.Mod):
                return Value(f"real_mod({left}, {right})", kind)
            name = "whole_mod" if isinstance(operator, ast.Mod) else "whole_div"
            if kind == "i32":
                return Value(f"{name}({left}, {right})", kind)
        elif type(operator) in _OPERATORS and not isinstance(kind, tuple):
            return Value(f"({left} {_OPERATORS[type(operator)]} {right})", kind)
        raise self._fail(node, "an operator")

    def _power(self, a: Value, b: Value) -> Value:
        base = convert(a, "f32")
        if b.type == "i32" and b.code.removesuffix("i").isdigit():
            exponent = int(b.code.removesuffix("i"))
            if 2 <= exponent <= 5:
                return Value(f"power_{exponent}({base})", "f32")
        return Value(f"pow({base}, {convert(b, 'f32')})", "f32")

    def _unary(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"(!{self._truth(node.operand)})", "bool")
        value = self._value(node.operand)
        if isinstance(node.op, ast.USub):
            return Value(f"(-{value.code})", value.type)
        raise self._fail(node, "an operator")

    def _comparison(self, node: ast.Compare) -> Value:
        terms = [self._value(term) for term in (node.left, *node.comparators)]
        parts = []
        for operator, a, b in zip(node.ops, terms, terms[1:], strict=False):
            if type(operator) not in _COMPARISONS:
                raise self._fail(node, "a comparison")
            kind = join(a.type, b.type)
            parts.append(f"({convert(a, kind)} {_COMPARISONS[type(operator)]} {convert(b, kind)})")
        return Value(parts[0] if len(parts) == 1 else f"({' && '.join(parts)})", "bool")

    def _alternative(self, node: ast.IfExp) -> Bound:
        first, second = self._bound(node.body), self._bound(node.orelse)
        condition = self._truth(node.test)
        if isinstance(first, Value) and isinstance(second, Value):
            kind = join(first.type, second.type)
            if isinstance(kind, tuple):
                raise self._fail(node, "a choice between tuples")
            a, b = convert(first, kind), convert(second, kind)
            return Value(f"select({b}, {a}, ({condition}))", kind)
        if isinstance(first, (Record, Array)) and isinstance(second, (Record, Array)):
            return Either(condition, first, second)
        raise self._fail(node, "a choice")
