"""Threads that share rays inside compiled code, so that none waits for Python's lock.

Each thread runs one compiled loop (:func:`_serve`) for all its life: it takes the next part of the
job that comes first, and sleeps in the kernel of Linux (``futex``) while there is none. A compiled
function hands a job in by :func:`do`, and goes on when all parts are done; :func:`do_step` hands in
a further one.
With 16 threads that wake one after the other to take Python's lock, each pass over a picture would
begin two milliseconds late.
"""

from __future__ import annotations

import platform
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.callconv import excinfo_ptr_t
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from carstage_sim.kernels import Decorator, device, inlined, kernel

_intrinsic: Decorator = intrinsic
_array_struct: Any = make_array
_insert_function: Any = cgutils.get_or_insert_function
_placed: Any = cgutils.alloca_once_value
_WORD = ir.IntType(64)
_STATUS, _ERROR = ir.IntType(32), ir.PointerType(excinfo_ptr_t)
_CODE_TYPE = ir.FunctionType(_STATUS, [_WORD.as_pointer(), _ERROR] + [_WORD] * 4)
"""As numba's own functions are called: places for a result and an error come first."""
_PART = (types.int64, types.int64, types.int64)
_tuple: Any = types.Tuple
_TWO = _tuple((types.int64, types.int64))

_FUTEX = {"x86_64": 202, "aarch64": 98}
_FUTEX_WAIT, _FUTEX_WAKE, _ALL = 128, 129, 1 << 30
_FUTEX_CALL = _FUTEX.get(platform.machine(), -1) if sys.platform == "linux" else -1

CALLS, _CLOSED = 0, 1
"""Of the board, in front of its jobs: how often something was put up; whether threads shall end."""
_HEADER, _ROW, _JOBS = 8, 16, 16
_NUMBER, _NEXT, _PARTS, _FIRST, _COUNT, _SIZE, _CODE, _DATA, _DONE, _RANK = range(10)
"""Of a job, in its row of the board: its number; the next part, above that number; how many parts
there are; the items they begin with, end with, and have each; where its code and its data lie; how
many parts are done; its rank."""
_NUMBER_BITS = 32
_MOST_PARTS = 1 << 31
_MOST_STEPS = 8
"""Jobs that one call of a kernel may hand in, one after the other."""
_CACHE_LINES = 128
"""Bytes between what two threads write."""

_Memory = TypeVar("_Memory", bound=tuple[Any, ...])


@_intrinsic
def add(typing_context, board, place, amount):  # type: ignore[no-untyped-def]
    """Add to one of some int64 as one step for all threads; its value before."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        by = context.cast(builder, args[2], signature.args[2], types.int64)
        return builder.atomic_rmw("add", _at(context, builder, signature, args), by, "seq_cst")

    return types.int64(board, place, amount), codegen


@_intrinsic
def load(typing_context, board, place):  # type: ignore[no-untyped-def]
    """One of some int64, as other threads left it."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load_atomic(_at(context, builder, signature, args), "seq_cst", 8)

    return types.int64(board, place), codegen


@_intrinsic
def _store(typing_context, board, place, value):  # type: ignore[no-untyped-def]
    """Set one of some int64 for all threads, after all that was set before."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        number = context.cast(builder, args[2], signature.args[2], types.int64)
        builder.store_atomic(number, _at(context, builder, signature, args), "seq_cst", 8)
        return context.get_dummy_value()

    return types.void(board, place, value), codegen


@_intrinsic
def _futex(typing_context, board, place, call, value):  # type: ignore[no-untyped-def]
    """Linux's ``futex`` on the low half of one of some int64."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(_WORD, [_WORD], var_arg=True)
        syscall = _insert_function(builder.module, kind, "syscall")
        address = builder.ptrtoint(_at(context, builder, signature, args), _WORD)
        wanted = [
            context.cast(builder, one, of, types.int64)
            for one, of in zip(args[2:], signature.args[2:], strict=True)
        ]
        nothing = [_WORD(0)] * 3
        return builder.call(syscall, [_WORD(_FUTEX_CALL), address, *wanted, *nothing])

    return types.int64(board, place, call, value), codegen


def _at(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Pointer to an element of the array that comes first, at the place that comes second."""
    data = _array_struct(signature.args[0])(context, builder, args[0]).data
    place = context.cast(builder, args[1], signature.args[1], types.int64)
    return builder.gep(data, [place])


@_intrinsic
def handed(typing_context, function, data):  # type: ignore[no-untyped-def]
    """Where the code ``function(*data, worker, first, last)`` and its data lie, as numbers.

    Both hold until the function that asked returns.
    """
    wanted = function.get_call_type(typing_context, (*data.types, *_PART), {})

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        of_data = signature.args[1]
        place = _placed(builder, args[1])
        name = builder.module.get_unique_name(f"{builder.function.name}.part")
        code = ir.Function(builder.module, _CODE_TYPE, name)
        code.linkage = "internal"
        inner = ir.IRBuilder(code.append_basic_block("entry"))
        values = inner.load(inner.inttoptr(code.args[2], place.type))
        unpacked = [inner.extract_value(values, i) for i in range(len(of_data.types))]
        called = context.get_function(function, wanted)
        context.add_linking_libs(getattr(called, "libs", ()))
        called(inner, [*unpacked, *code.args[3:]])
        inner.ret(_STATUS(0))
        numbers = [builder.ptrtoint(code, _WORD), builder.ptrtoint(place, _WORD)]
        return context.make_tuple(builder, signature.return_type, numbers)

    return _TWO(function, data), codegen


@_intrinsic
def _run(typing_context, code, data, worker, first, last):  # type: ignore[no-untyped-def]
    """Call code from :func:`handed` on its data."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        numbers = [
            context.cast(builder, one, of, types.int64)
            for one, of in zip(args, signature.args, strict=True)
        ]
        nowhere = [_WORD.as_pointer()(None), _ERROR(None)]
        builder.call(
            builder.inttoptr(numbers[0], _CODE_TYPE.as_pointer()), [*nowhere, *numbers[1:]]
        )
        return context.get_dummy_value()

    return types.void(code, data, worker, first, last), codegen


@device
def _do_a_part(board, worker):  # type: ignore[no-untyped-def]
    """Do one part of the job that comes first; whether there was any."""
    chosen, rank, number = -1, 0, 0
    for job in range(_JOBS):
        at = _HEADER + job * _ROW
        upcoming = load(board, at + _NEXT)
        parts = load(board, at + _PARTS)
        if (
            upcoming >> _NUMBER_BITS == load(board, at + _NUMBER)
            and upcoming & (_MOST_PARTS - 1) < parts
        ):
            its, which = load(board, at + _RANK), upcoming >> _NUMBER_BITS
            if chosen < 0 or its < rank or (its == rank and which < number):
                chosen, rank, number = at, its, which
    if chosen < 0:
        return False
    taken = add(board, chosen + _NEXT, 1)
    part = taken & (_MOST_PARTS - 1)
    # A row may be used for another job in this moment: its number is the first that changes then.
    parts = load(board, chosen + _PARTS)
    if taken >> _NUMBER_BITS != load(board, chosen + _NUMBER) or part >= parts:
        return True
    size = load(board, chosen + _SIZE)
    first = load(board, chosen + _FIRST) + part * size
    last = min(first + size, load(board, chosen + _COUNT))
    _run(load(board, chosen + _CODE), load(board, chosen + _DATA), worker, first, last)
    if add(board, chosen + _DONE, 1) + 1 == parts:
        _futex(board, chosen + _DONE, _FUTEX_WAKE, _ALL)
    return True


@kernel
def _serve(board, worker):  # type: ignore[no-untyped-def]
    """What a thread of the crew does until the crew is closed."""
    while True:
        calls = load(board, CALLS)
        if load(board, _CLOSED):
            return
        if not _do_a_part(board, worker):
            _futex(board, CALLS, _FUTEX_WAIT, calls & 0xFFFFFFFF)


@kernel
def _call_all(board):  # type: ignore[no-untyped-def]
    add(board, CALLS, 1)
    _futex(board, CALLS, _FUTEX_WAKE, _ALL)


@device
def together(board, job, items, rank, number, code, data):  # type: ignore[no-untyped-def]
    """Have the crew do a job; returns when all of it is done.

    Args:
        board: the crew's; an empty one has the caller do all.
        job: the crew's row for it, from :meth:`Crew.job`.
        items: the first of them, their end, and how many a part has, as there.
        rank, number: from there, too; no two jobs that follow in a row have the same number.
        code, data: from :func:`handed`.
    """
    first, count, size = items
    parts = (count - first + size - 1) // size
    if parts <= 0:
        return
    if not board.shape[0]:
        _run(code, data, 0, first, count)
        return
    at = _HEADER + job * _ROW
    _store(board, at + _NUMBER, number)
    _store(board, at + _PARTS, parts)
    _store(board, at + _FIRST, first)
    _store(board, at + _COUNT, count)
    _store(board, at + _SIZE, size)
    _store(board, at + _CODE, code)
    _store(board, at + _DATA, data)
    _store(board, at + _DONE, 0)
    _store(board, at + _RANK, rank)
    _store(board, at + _NEXT, number << _NUMBER_BITS)
    add(board, CALLS, 1)
    _futex(board, CALLS, _FUTEX_WAKE, min(parts, _ALL))
    done = load(board, at + _DONE)
    while done < parts:
        _futex(board, at + _DONE, _FUTEX_WAIT, done)
        done = load(board, at + _DONE)


def for_workers(crew: Crew, one: _Memory) -> _Memory:
    """Working memory for each thread of a crew: a place of each array, in front of its axes.

    Args:
        crew: the threads.
        one: what one thread needs: a named tuple of arrays and of such tuples.
    """
    threads = max(len(crew.members), 1)
    return type(one)(
        *(
            _apart(threads, part) if isinstance(part, np.ndarray) else for_workers(crew, part)
            for part in one
        )
    )


def _apart(threads: int, one: NDArray[Any]) -> NDArray[Any]:
    """An array for each thread, with room between them: no two write to one line of a cache."""
    most = max(int(np.prod(one.shape[1:])) * one.itemsize, 1)
    room = -(-_CACHE_LINES // most)
    return np.zeros((threads, one.shape[0] + room, *one.shape[1:]), one.dtype)


@inlined
def do(part, data, board, job, work):  # type: ignore[no-untyped-def]
    """Have a crew call ``part(*data, worker, first, last)`` for all parts of a job.

    Args:
        part: compiled; ``worker`` is the number of the thread that does it.
        data: a tuple.
        board, job, work: as for :func:`together`.
    """
    code, place = handed(part, data)
    together(board, job, (work[0], work[1], work[2]), work[3], work[4], code, place)


@inlined
def do_step(part, data, board, job, work, step, count, size):  # type: ignore[no-untyped-def]
    """As :func:`do`, in the same call of a kernel, of ``range(count)`` in parts of a size.

    Several passes of one call need Python's lock once. ``step`` is 1 for the first that follows
    :func:`do`, and one more for each other, 6 at most.
    """
    code, place = handed(part, data)
    together(board, job, (0, count, size), work[3], work[4] + step, code, place)


Shared: TypeAlias = Callable[[tuple[Any, ...], NDArray[np.int64], int, NDArray[np.int64]], None]
"""A kernel that calls :func:`do`, with the data, the board, the job's row and its items."""


def alone(shared: Shared, data: tuple[Any, ...], first: int, last: int) -> None:
    """Do a part of a job in the calling thread."""
    shared(data, np.empty(0, np.int64), 0, np.array([first, last, 1, 0, 0], np.int64))


class Crew:
    """A number of threads that do parts of jobs, whoever hands them in.

    Args:
        threads: how many; one stands for none, who hands a job in does it.
        name: what the threads are called.
    """

    def __init__(self, threads: int, name: str) -> None:
        self.threads = threads
        served = threads > 1 and _FUTEX_CALL >= 0
        self.board = np.zeros(_HEADER + _JOBS * _ROW if served else 0, np.int64)
        """What its threads look at; to be given to :func:`together`."""
        self._rank = threading.local()
        self._lock = threading.Lock()
        self._numbers = 0
        self._free = list(range(_JOBS))
        # Callers that do their jobs themselves share the memory of one thread: one after the other.
        self._room = threading.Semaphore(_JOBS if served else 1)
        self.members = [
            threading.Thread(
                target=_serve, args=(self.board, number), name=f"{name}_{number}", daemon=True
            )
            for number in range(threads if served else 0)
        ]
        if self.members:
            # Compiled here: threads that compile at once would wait for each other.
            _serve(np.ones(_HEADER, np.int64), 0)
        for member in self.members:
            member.start()

    def close(self) -> None:
        """End the threads; nothing may be under way."""
        if self.members:
            self.board[_CLOSED] = 1
            _call_all(self.board)
        for member in self.members:
            member.join()
        self.members.clear()

    @contextmanager
    def ranked(self, rank: int) -> Iterator[None]:
        """In the block, jobs of the calling thread have this rank: the lowest comes first.

        Elsewhere it is 0.
        """
        before = getattr(self._rank, "value", 0)
        self._rank.value = rank
        try:
            yield
        finally:
            self._rank.value = before

    @contextmanager
    def job(self, first: int, count: int, size: int) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """Room for a job in the block: its row, and what :func:`do` is to know of it.

        Args:
            first, count: its items are ``range(first, count)``.
            size: items of a part.
        """
        with self._room:
            with self._lock:
                row = self._free.pop()
                self._numbers = (self._numbers + _MOST_STEPS) % _MOST_PARTS
                number = self._numbers + 1  # the steps that follow have those after it
            try:
                rank = getattr(self._rank, "value", 0)
                yield row, np.array([first, count, size, rank, number], np.int64)
            finally:
                with self._lock:
                    self._free.append(row)
