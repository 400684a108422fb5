"""How a call finds its handler, and how a handler's value becomes a reply.

A handler is a function ``(call, *arguments) -> value`` registered under the call's name. It returns
the bare value; the wrapping that the client expects is decided at registration.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, NamedTuple, TypeVar

from carstage_sim.simulation import Simulation
from carstage_sim.wire.argument_types import argument_check, client_parameters
from carstage_sim.wire.dialect import Dialect
from carstage_sim.wire.errors import CallError
from carstage_sim.wire.rpc import Connection, Packed, Request, shortened
from carstage_sim.wire.throttled_warnings import ThrottledWarnings
from carstage_sim.wire.traffic_managers import TrafficManagers
from carstage_sim.world.actors import Actor
from carstage_sim.world.errors import ActorError, WorldError
from carstage_sim.world.world import World

logger = logging.getLogger(__name__)
_warnings = ThrottledWarnings(logger)

_WIRE = __name__.removesuffix(".handlers.registry")
_UNFIT = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError)

Handler = Callable[..., Any]
_H = TypeVar("_H", bound=Handler)
_T = TypeVar("_T")


class _Later(Enum):
    LATER = "the handler answers by itself"


LATER: Final = _Later.LATER
"""Returned by a handler that keeps its call and answers it with :meth:`Call.answer`."""


class Wrapping(Enum):
    """How a result is wrapped on the wire."""

    VALUE = "Response<T>"
    VOID = "Response<void>"
    BARE = "as it is"


@dataclass(frozen=True, slots=True)
class Session:
    """What handlers may use of the server that runs them.

    Attributes:
        request_tick: asks for a frame, in synchronous mode as soon as the client can see it.
        episode_began: publishes the first frame of a new episode; the free run pauses for some
            seconds after it.
        after: runs something in the simulation thread, after some seconds.
        when_done: runs something in the simulation thread when a result of another is there.
        expect_subscriber: tells that a client is about to subscribe to a stream, and within how
            many seconds; its tick waits for that.
        packed: results that were packed once, with what they were made of; see
            :meth:`Call.packed`.
    """

    simulation: Simulation
    dialect: Dialect
    streaming_port: int
    traffic_managers: TrafficManagers
    request_tick: Callable[[TickRequest], None]
    episode_began: Callable[[float], None]
    after: Callable[[float, Callable[[], None]], None]
    when_done: Callable[[Future[Any], Callable[[], None]], None]
    expect_subscriber: Callable[[int, float, Connection], None]
    packed: dict[str, tuple[object, Packed]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Call:
    """One request in the hands of its handler."""

    session: Session
    request: Request

    @property
    def world(self) -> World:
        """The current episode's world."""
        return self.session.simulation.world

    @property
    def simulation(self) -> Simulation:
        """The simulation that owns the world."""
        return self.session.simulation

    @property
    def connection(self) -> Connection:
        """Who asks."""
        return self.request.connection

    def live(self, actor_id: int) -> Actor | None:
        """The live actor of that id, None if it was destroyed a while ago.

        Raises:
            ActorNotFoundError: there never was one.
        """
        actor = self.world.live_or_dead(actor_id)
        return actor if actor.actor_id in self.world.actors else None

    def packed(self, source: object, make: Callable[[], Any]) -> Packed:
        """A large result that stays the same as long as it is made of the same object.

        Args:
            source: what it is made of.
            make: makes the value.
        """
        kept = self.session.packed.get(self.request.name)
        if kept is not None and kept[0] is source:
            return kept[1]
        packed = Packed.of(make())
        self.session.packed[self.request.name] = (source, packed)
        return packed

    def conclude(self, handle: Callable[[], Any]) -> None:
        """Answer with what ``handle`` returns, or with the failure that it raises."""
        try:
            value = handle()
            if value is not LATER:
                self.answer(value)
        except Exception as error:  # noqa: BLE001 - every failure becomes a reply
            self.fail(refusal(self.request.name, error, self.request.arguments))

    def once_done(self, future: Future[_T], encode: Callable[[_T], Any]) -> Any:
        """Answer with an encoded result, at once or when it is there; for a handler to return."""
        if future.done():
            return encode(future.result())
        self.session.when_done(future, lambda: self.conclude(lambda: encode(future.result())))
        return LATER

    def answer(self, value: Any) -> None:
        """Send a value as this call's reply."""
        if isinstance(value, Packed):
            self.connection.reply_packed(self.request, value)
        else:
            wrapping = _HANDLERS[self.request.name].wrapping
            self.connection.reply(self.request, _wrapped(wrapping, value))

    def fail(self, text: str) -> None:
        """Send a refusal that the client raises as ``RuntimeError``."""
        failed = True if _HANDLERS[self.request.name].wrapping is Wrapping.VOID else 0
        self.connection.reply(self.request, [[failed, [text]]])


@dataclass(frozen=True, slots=True)
class _Handled:
    """A handler, how its value is wrapped, and what refuses arguments that do not fit it."""

    handler: Handler
    wrapping: Wrapping
    check: Callable[[str, Sequence[Any]], None]


_HANDLERS: dict[str, _Handled] = {}


class TickRequest(NamedTuple):
    """Somebody wants a frame.

    Attributes:
        call: which asks for it.
        asked_s: when, by the monotonic clock.
        is_answered: whether it has its answer; otherwise that is the frame's number.
    """

    call: Call
    asked_s: float
    is_answered: bool = False


def handles(name: str, wrapping: Wrapping = Wrapping.VALUE) -> Callable[[_H], _H]:
    """Register a handler for the call ``name``."""

    def register(handler: _H) -> _H:
        if name in _HANDLERS:
            raise ValueError(f"two handlers for {name}")
        _HANDLERS[name] = _Handled(handler, wrapping, argument_check(handler))
        return handler

    return register


def handles_void(*names: str) -> Callable[[_H], _H]:
    """Register a handler for calls without a result."""

    def register(handler: _H) -> _H:
        for name in names:
            handles(name, Wrapping.VOID)(handler)
        return handler

    return register


def known_calls() -> frozenset[str]:
    """Names of all calls that are answered."""
    return frozenset(_HANDLERS)


def parameters_of(name: str) -> list[tuple[str, str]]:
    """Names and annotations of the arguments that a call takes from a client."""
    given = client_parameters(_HANDLERS[name].handler)
    return [(parameter.name, str(parameter.annotation)) for parameter in given]


def serve(session: Session, request: Request) -> None:
    """Run the handler of a request and answer it.

    Every failure becomes a reply: an error of the envelope would end a client's background thread
    and with it the client's process, so only calls that do not exist in the
    dialect get one, in rpclib's words.
    """
    count = len(request.arguments)
    if request.name not in _HANDLERS or request.name in session.dialect.missing_calls:
        _warnings.warn("unknown call", f"{shortened(request.name)} of {count} arguments")
        request.connection.refuse(
            request,
            f"rpclib: server could not find function '{request.name}' with argument count "
            f"{count + 1}.",  # rpclib counts the metadata too
        )
        return
    handled = _HANDLERS[request.name]

    def handle() -> Any:
        handled.check(request.name, request.arguments)
        return handled.handler(call, *request.arguments)

    call = Call(session, request)
    call.conclude(handle)


def refusal(name: str, error: Exception, arguments: object) -> str:
    """The error text that a client gets; the log gets what is our fault.

    Values of the wrong type fail where they are decoded, in this package. What fails deeper has
    passed the decoders and must not have.
    """
    if isinstance(error, ActorError):
        # CARLA's RespondError, its two spaces included: programs look for its words.
        return f"Responding error from function {name}: {error.reason}.  Actor Id: {error.actor_id}"
    if isinstance(error, CallError | WorldError):
        logger.debug("%s refused: %s", name, error)
        return str(error)
    if isinstance(error, _UNFIT) and _raised_at_the_wire(error):
        _warnings.warn(f"arguments that do not fit {name}", shortened(arguments))
        return f"the arguments do not fit {name}: {type(error).__name__}: {error}"
    logger.error("%s%s failed", name, shortened(arguments), exc_info=error)
    return f"{name} failed in the simulator: {type(error).__name__}: {error}"


def _raised_at_the_wire(error: Exception) -> bool:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    module = trace.tb_frame.f_globals.get("__name__", "") if trace is not None else ""
    return module == _WIRE or module.startswith(f"{_WIRE}.")


def _wrapped(wrapping: Wrapping, value: Any) -> Any:
    if wrapping is Wrapping.VOID:
        return [[False]]
    return [[1, value]] if wrapping is Wrapping.VALUE else value
