"""Compilation of kernels: complete if called from Python, as parts if called by other kernels.

By default numba compiles every function that another one calls into a complete program, with
wrappers for Python, all optimisations and machine code, and the caller optimises the same code once
more: ten times at a depth of ten. Here a callee is a *part*: types and unoptimised code, kept for
all kernels that call it. Only what Python calls is optimised and translated to machine
code, once, including its parts: at the same speed, with the same bytes, in half the time.

It uses numba's own extension points: a dispatcher, a compiler with another last pass, a library.
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
    """Storage of parts between processes."""

    def load(self, name: str) -> Any:
        """Content stored under a name; None if there is none that is whole."""

    def save(self, name: str, content: Any) -> None:
        """Store content, if possible."""


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function that other kernels call as a part of theirs.

    Parameters
    ----------
    py_func : callable
        Python function that it compiles.
    locals : dict, optional
        Types of local variables, as in numba's dispatcher.
    targetoptions : dict
        Options of ``numba.njit``.
    pipeline_class : type, optional
        Compiler; by default that of whole kernels.
    store : Store, optional
        Storage for the part; without it every process compiles it again.
    noalias : bool
        Records and arrays among its arguments do not overlap; this is not checked.
    """

    def __init__(
        self,
        py_func: Callable[..., Any],
        locals: dict[str, Any] | None = None,  # noqa: A002 - numba's name
        targetoptions: dict[str, Any] | None = None,
        pipeline_class: type | None = None,
        store: Store | None = None,
        noalias: bool = False,
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
            py_func,
            variables,
            options | _NO_WRAPPERS,
            _NoAliasCompiler if noalias else _PartCompiler,
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
    """A function as other kernels call it, not callable from Python."""

    def add_overload(self, cres: Any) -> None:
        self.overloads[tuple(cres.signature.args)] = cres


class _Key:
    """Placeholder for the code of a part in numba's look-ups."""


@contextmanager
def _no_garbage_collected() -> Iterator[None]:
    """Pause garbage collection, an eighth of the compiler's time, as its objects all live on."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _address(function: Any) -> tuple[str, str] | None:
    """Module and name under which a function's kernel can be imported, if it can."""
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
    """Whether the types of a function's arguments have the same description in every process.

    A named tuple is described by its name alone. One of another copy of this package, under
    another name, would be mistaken for the function's own.
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
    """Code of a single part, for the linker.

    `calls` are the libraries of its callees, or their origins; `origin` is that of the part
    itself: module, name and types of arguments; None if no later process can find it.
    """

    _shared_module: Any

    def __init__(self, codegen: Any, name: str, origin: Any = None) -> None:
        super().__init__(codegen, name)
        self.origin = origin
        self.kept: tuple[bytes, list[Any]] | None = None

    def finalize(self) -> None:
        """Do nothing: whole kernels link, optimise and translate."""
        self._finalized = True

    def calls(self) -> list[Any]:
        """Libraries of its callees."""
        if self.kept is None:
            return list(dict.fromkeys(self._linking_libraries))
        return [_called(self._codegen, each) for each in self.kept[1]]

    def content(self) -> tuple[bytes, list[Any]] | None:
        """Data for a later process; None if it cannot be identified."""
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
        """Take over the content made by another process."""
        self.kept, self._finalized = content, True


def _called(codegen: Any, where: Any) -> Any:
    """Library of a stored part's callee: numba's own code, or another part."""
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
    """A kernel with all its parts, each linked after its callers, else the linker drops it."""

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
                function.linkage = binding.Linkage.internal  # not replaceable by another kernel's
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
    """Code of a part, neither optimised nor translated to machine code."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        types = tuple(state.args)
        function = state.func_id.func
        address = _address(function) if lasting(types, function) else None
        origin = None if address is None else (*address, types)
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname, origin)
        if origin is not None:  # the same name in every process
            state.targetctx = state.targetctx.subtarget(mangler=_lasting_name)
        state.flags.no_compile = True
        super().run_pass(state)
        key = _Key()
        state.targetctx.insert_user_function(key, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=key)
        return True


def _lasting_name(name: str, types: Any, *, abi_tags: Any = (), **_: Any) -> str:
    """Linker name of a function, the same in every process; numba's counts compilations."""
    digest = hashlib.sha256(f"{types} {abi_tags}".encode()).hexdigest()[:32]
    mangled: str = itanium_mangler.mangle(name, (), abi_tags=(digest,))
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
    """numba's compiler with a different final pass."""

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


class _NoAliasCompiler(_PartCompiler):
    """Code of a part whose arguments do not overlap in memory."""

    def define_pipelines(self) -> list[Any]:
        self.state.flags.noalias = True
        return super().define_pipelines()


class _Kept:
    """Stored parts of one function, in place of numba's cache."""

    def __init__(self, function: Any, store: Store) -> None:
        self._function, self._store = function, store

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Stored part for the types of its arguments, if there is one."""
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
        """Store a part."""
        types, _ = sigutils.normalize_signature(sig)
        name = self._name(types, data.library.codegen)
        content = None if data.reload_init else data.library.content()
        if name is None or content is None:
            return
        data.fndesc.typemap = data.fndesc.calltypes = None  # needed by the compiler only
        self._store.save(name, (data.fndesc, data.signature, content))

    def _name(self, types: Any, codegen: Any) -> str | None:
        function = self._function
        if _address(function) is None or not lasting(types, function) or function.__closure__:
            return None
        code = hashlib.sha256(function.__code__.co_code).hexdigest()
        key = f"{function.__qualname__} {types} {codegen.magic_tuple()} {code}"
        return hashlib.sha256(key.encode()).hexdigest()[:32]
