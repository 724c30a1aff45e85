"""How kernels are compiled: whole where Python calls them, as parts where other kernels do.

Left to itself, numba makes every function that another one calls a program of its own first, with
wrappers for Python, all optimisations and machine code, and the caller optimises the same code once
more: ten times at a depth of ten. Here a callee is a *part*, types and code as they were written
down, kept for all kernels that call it. Only what Python calls is optimised and becomes machine
code, once, with its parts in it: at the same speed, with the same bytes, in half the time.

Built on numba's own places for this: a dispatcher, a compiler with another last pass, a library.
"""

import gc
import hashlib
import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from llvmlite import binding
from numba.core import itanium_mangler, sigutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, compile_result
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.core.types.containers import BaseNamedTuple, BaseTuple

_NO_WRAPPERS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class Store(Protocol):
    """Where parts are kept from one process to the next."""

    def load(self, name: str) -> Any:
        """What was kept under a name; None where there is nothing whole."""

    def save(self, name: str, content: Any) -> None:
        """Keep it, where that is possible."""


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function that other ones call as a part of theirs.

    Parameters
    ----------
    py_func : callable
        What it computes.
    locals : dict, optional
        Types of local variables, as numba's dispatcher has them.
    targetoptions : dict
        Options of ``numba.njit``.
    pipeline_class : type, optional
        Compiler; that of whole kernels.
    store : Store, optional
        For the part; without it every process makes it anew.
    apart : bool
        Records and arrays among its arguments do not overlap; nobody checks that.
    """

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: dict[str, Any] | None = None,  # noqa: A002 - numba's name
        targetoptions: dict[str, Any] | None = None,
        pipeline_class: type | None = None,
        store: Store | None = None,
        apart: bool = False,
    ) -> None:
        options = {"nopython": True, "boundscheck": None, **(targetoptions or {})}
        variables = locals or {}
        super().__init__(
            py_func,
            variables,
            options | {"no_cfunc_wrapper": True},
            pipeline_class or _WholeCompiler,
        )
        self.part = _Part(
            py_func, variables, options | _NO_WRAPPERS, _ApartCompiler if apart else _PartCompiler
        )
        if store is not None:
            self.part._cache = _Kept(py_func, store)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Types of a call by another kernel."""
        return self.part.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """Key of the code that another kernel calls."""
        return self.part.get_overload(sig)

    def compile(self, sig: Any) -> Any:
        """Machine code for the types of its arguments."""
        with _no_garbage_collected():
            return super().compile(sig)


class _Part(CPUDispatcher):  # type: ignore[misc]
    """A function as other kernels call it: nothing that Python could call."""

    def add_overload(self, cres: Any) -> None:
        self.overloads[tuple(cres.signature.args)] = cres


class _Key:
    """Stands for the code of a part where numba looks it up."""


@contextmanager
def _no_garbage_collected() -> Iterator[None]:
    """The compiler makes millions of objects that stay till it ends: an eighth of its time."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _address(function: Any) -> tuple[str, str] | None:
    """Module and name under which a kernel of this function is found, where it is."""
    kernel: Any = None
    try:
        kernel = importlib.import_module(function.__module__)
        for name in function.__qualname__.split("."):
            kernel = getattr(kernel, name)
    except (ImportError, AttributeError):
        return None
    if not isinstance(kernel, Kernel) or kernel.py_func is not function:
        return None
    return function.__module__, function.__qualname__


def lasting(types: Any, function: Any) -> bool:
    """Whether the types of a function's arguments are described alike in every process.

    Those of a named tuple are described by its name alone. Of another copy of this package, under
    another name, they would be taken for the function's own.
    """
    homes = {_package(function), __name__.partition(".")[0]}
    return " at 0x" not in str(types) and homes.issuperset(map(_package, _classes(types)))


def _package(found: Any) -> str:
    name: str = found.__module__.partition(".")[0]
    return name


def _classes(types: Any) -> Iterator[type]:
    """Classes of the named tuples in types."""
    for each in types:
        if isinstance(each, BaseNamedTuple):
            yield each.instance_class
        if isinstance(each, BaseTuple):
            yield from _classes(each.types)


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of one part alone, for the linker.

    `calls` are the libraries of what it calls, or where these are found; `origin` is where the part
    itself is found: module, name and types of arguments, None of what no later process finds.
    """

    _shared_module: Any

    def __init__(self, codegen: Any, name: str, origin: Any = None) -> None:
        super().__init__(codegen, name)
        self.origin = origin
        self.kept: tuple[bytes, list[Any]] | None = None

    def finalize(self) -> None:
        """Nothing: whole kernels link, optimise and translate."""
        self._finalized = True

    def calls(self) -> list[Any]:
        """Libraries of what it calls."""
        if self.kept is None:
            return list(dict.fromkeys(self._linking_libraries))
        return [_called(self._codegen, each) for each in self.kept[1]]

    def content(self) -> tuple[bytes, list[Any]] | None:
        """What a later process needs; None where that cannot be told."""
        calls: list[Any] = []
        for each in self.calls():
            if not isinstance(each, _PartLibrary):
                calls.append(each._get_module_for_linking().as_bitcode())
            elif each.origin is not None:
                calls.append(each.origin)
            else:
                return None
        return self._get_module_for_linking().as_bitcode(), calls

    def _get_module_for_linking(self) -> Any:
        if self.kept is not None and self._shared_module is None:
            self._shared_module = binding.parse_bitcode(self.kept[0])
        return super()._get_module_for_linking()

    def keep(self, content: tuple[bytes, list[Any]]) -> None:
        """Be what another process has made."""
        self.kept, self._finalized = content, True


def _called(codegen: Any, where: Any) -> Any:
    """Library of what a kept part calls: code of numba's own, or another part."""
    if isinstance(where, bytes):
        library = _PartLibrary(codegen, "callee")
        library.keep((where, []))
        return library
    module, name, types = where
    kernel: Any = importlib.import_module(module)
    for each in name.split("."):
        kernel = getattr(kernel, each)
    kernel.part.compile(types)
    return kernel.part.overloads[types].library


class _WholeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """A kernel with all its parts, each linked after those that call it: else it is left out."""

    _linking_libraries: Any

    def finalize(self) -> None:
        found: dict[Any, None] = {}

        def visit(library: Any) -> None:
            if library in found:
                return
            if isinstance(library, _PartLibrary):
                seen.add(library)
                for each in library.calls():
                    if each not in seen:
                        visit(each)
            found[library] = None

        seen: set[Any] = set()
        for library in self._linking_libraries:
            visit(library)
        self._linking_libraries = [*reversed(found)]
        super().finalize()

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.linkonce_odr:
                function.linkage = binding.Linkage.internal  # no other kernel's takes its place
        super()._optimize_final_module()

    def _verify_declare_only_symbols(self) -> None:
        super()._verify_declare_only_symbols()
        missing = [
            function.name
            for function in self._final_module.functions
            if function.is_declaration and function.name.startswith("_ZN")
        ]
        if missing:
            raise AssertionError(f"parts of {self.name} are not linked: {missing}")


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):  # type: ignore[misc]
    """Code of a part, neither optimised nor translated."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        types = tuple(state.args)
        function = state.func_id.func
        address = _address(function) if lasting(types, function) else None
        origin = None if address is None else (*address, types)
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname, origin)
        if origin is not None:  # a name that every process gives it
            state.targetctx = state.targetctx.subtarget(mangler=_lasting_name)
        state.flags.no_compile = True
        super().run_pass(state)
        key = _Key()
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=key)
        return True


def _lasting_name(name: str, types: Any, *, abi_tags: Any = (), **_: Any) -> str:
    """Name of a function for the linker: numba's counts what this process has compiled."""
    told = hashlib.sha256(f"{types} {abi_tags}".encode()).hexdigest()[:32]
    mangled: str = itanium_mangler.mangle(name, (), abi_tags=(told,))
    return mangled


@register_pass(mutates_CFG=True, analysis_only=False)
class _WholeLowering(NativeLowering):  # type: ignore[misc]
    """Machine code of a kernel and its parts."""

    _name = "whole_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _WholeLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        super().run_pass(state)
        return True


class _WholeCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler with another way to machine code."""

    lowering: Any = _WholeLowering

    def define_pipelines(self) -> list[Any]:
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (self.lowering if each is NativeLowering else each, said)
            for each, said in passes.passes
        ]
        passes.finalize()
        return [passes]


class _PartCompiler(_WholeCompiler):
    lowering = _PartLowering


class _ApartCompiler(_PartCompiler):
    """Code of a part that never reads through one argument what it wrote through another."""

    def define_pipelines(self) -> list[Any]:
        self.state.flags.noalias = True
        return super().define_pipelines()


class _Kept:
    """Parts of one function in a store, in place of numba's cache."""

    def __init__(self, function: Any, store: Store) -> None:
        self._function, self._store = function, store

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Part for the types of its arguments, where one is kept."""
        types, _ = sigutils.normalize_signature(sig)
        name = self._name(types, target_context.codegen())
        found = None if name is None else self._store.load(name)
        if found is None:
            return None
        fndesc, signature, content = found
        library = _PartLibrary(
            target_context.codegen(),
            self._function.__qualname__,
            (*(_address(self._function) or ()), tuple(types)),
        )
        library.keep(content)
        return compile_result(
            typing_context=target_context.typing_context,
            target_context=target_context,
            library=library,
            entry_point=_Key(),
            fndesc=fndesc,
            signature=signature,
            objectmode=False,
            lifted=(),
        )

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a part."""
        types, _ = sigutils.normalize_signature(sig)
        name = self._name(types, data.library.codegen)
        content = None if data.reload_init else data.library.content()
        if name is None or content is None:
            return
        data.fndesc.typemap = data.fndesc.calltypes = None  # of the compiler alone
        self._store.save(name, (data.fndesc, data.signature, content))

    def _name(self, types: Any, codegen: Any) -> str | None:
        function = self._function
        if _address(function) is None or not lasting(types, function) or function.__closure__:
            return None
        code = hashlib.sha256(function.__code__.co_code).hexdigest()
        told = f"{function.__qualname__} {types} {codegen.magic_tuple()} {code}"
        return hashlib.sha256(told.encode()).hexdigest()[:32]
