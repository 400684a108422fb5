"""Slots that are actors of a Ray cluster: each owns a process, and with it a server, on its node.

Ray finds the place for a slot and tells of nodes that go. It does not restart anything: who is
started again, and what becomes of a lost job, is decided in one place, ``slots``.
"""

from __future__ import annotations

import importlib
import json
import os
import selectors
import signal
import socket
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from queue import Queue
from typing import Any

from carstage.errors import BadInputError, WorkerLostError
from carstage.execution.local_processes import SlotProcess
from carstage.execution.slots import MOST_WORKERS, Slot, SlotEnd, SlotProgram, SlotsExecutor

LOCAL = "local"
DEFAULT_RESOURCES: Mapping[str, float] = {"CPU": 1.0}
CARD_VARIABLE = "CARSTAGE_GRAPHICS_CARD"
"""The graphics card that Ray has allotted to a slot."""
OFF = ("RAY_USAGE_STATS_ENABLED", "RAY_ENABLE_UV_RUN_RUNTIME_ENV")
"""What Ray would do unasked: tell its makers of its use; and, below ``uv run``, make every process
on the nodes begin by ``uv run``, in a copy of this folder."""
_READ_S = 1.0
_CONNECT_S = 10.0
_END_S = 20.0
_MOST_UNHEARD = 64
_MEMORY = "memory"
_LARGEST_AMOUNT, _LEAST_AMOUNT = 1e15, 1e-4


def parse_resources(text: str) -> dict[str, float]:
    """What a worker takes of the cluster, as users write it: ``{"CPU": 2, "GPU": 0.5}``.

    Raises:
        BadInputError: it is not written so.
    """
    try:
        given = json.loads(text)
    except ValueError:
        given = None
    if not isinstance(given, dict) or not all(
        isinstance(amount, int | float)
        and not isinstance(amount, bool)
        and 0 <= amount <= _LARGEST_AMOUNT
        for amount in given.values()
    ):
        raise BadInputError(
            f"ray-resources: {text[:80]!r} does not name amounts.",
            """Write JSON, such as '{"CPU": 2, "GPU": 0.5, "simulator": 1}'.""",
        )
    return {**DEFAULT_RESOURCES, **{name: float(amount) for name, amount in given.items()}}


def _check_resources(resources: Mapping[str, float]) -> None:
    """Refuse what Ray would only refuse when the first worker is opened.

    Raises:
        BadInputError: names the resource.
    """
    for name, amount in resources.items():
        if name == "object_store_memory":
            why = "Ray gives it to nobody"
        elif 0.0 < amount < _LEAST_AMOUNT:
            why = f"{_LEAST_AMOUNT:g} is the least that Ray can give"
        elif name == "GPU" and amount > 1.0 and amount != int(amount):
            why = "above 1 it has to be a whole number"
        else:
            continue
        raise BadInputError(f"ray-resources: {name} cannot be {amount:g}: {why}.")


class RayExecutor(SlotsExecutor):
    """Workers on the nodes of a Ray cluster.

    All nodes have Car-STAGE installed in this version, and see the dataset's folder at the same
    path.

    Args:
        count: how many workers there are at most; None: as many as the cluster has room for.
        address: of the cluster, ``auto`` for the one that this node belongs to, or ``local`` for a
            cluster of this machine that ends with the run.
        resources: what each worker takes: ``CPU``, ``GPU`` (fractions too), ``memory`` in bytes,
            and resources that the nodes were started with.

    Raises:
        BadInputError: Ray is not installed, or gives nobody such resources.
    """

    def __init__(
        self,
        count: int | None,
        address: str = "auto",
        resources: Mapping[str, float] = DEFAULT_RESOURCES,
    ) -> None:
        super().__init__(1 if count is None else count)
        _check_resources(resources)
        self._wanted = count
        self._address = address
        self._resources = dict(resources)
        for name in OFF:
            os.environ.setdefault(name, "0")  # read by Ray's import
        try:
            self._ray: Any = importlib.import_module("ray")
        except ImportError as error:
            raise BadInputError(
                "Ray is not installed.", "Install it: pip install 'carstage[ray]'."
            ) from error

    @property
    def cores_per_worker(self) -> int:
        """As ``resources`` has it."""
        return max(1, int(self._resources.get("CPU", 1.0)))

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Be a driver of the cluster; a cluster of this machine is started and ended.

        Raises:
            BadInputError: there is no such cluster, or no node has room for a worker.
        """
        self._check_address()
        local = self._address == LOCAL
        options = {"include_dashboard": False, "_node_ip_address": "127.0.0.1"} if local else {}
        in_main = threading.current_thread() is threading.main_thread()
        before = signal.getsignal(signal.SIGTERM)
        try:
            self._ray.init(address=self._address, log_to_driver=False, **options)
        except (ConnectionError, RuntimeError, ValueError, self._ray.exceptions.RayError) as error:
            raise self._no_cluster(error) from error
        finally:
            if in_main:  # Ray has a handler of its own
                signal.signal(signal.SIGTERM, before)
        try:
            room = self._room()
            if not room:
                raise BadInputError(
                    f"No node of the Ray cluster has {self._resources} for a worker.",
                    "Ask for less by --ray-resources, or start nodes that have it.",
                )
            self.count = min(self._wanted or room, MOST_WORKERS)
            yield
        finally:
            self._ray.shutdown()
            if in_main:
                signal.signal(signal.SIGTERM, before)

    def open_slot(self, number: int, program: SlotProgram) -> RaySlot:
        """See ``SlotsExecutor.open_slot``."""
        resources = dict(self._resources)
        actor = _actor_class(self._ray).options(
            name=None,
            num_cpus=resources.pop("CPU", 0.0),
            num_gpus=resources.pop("GPU", 0.0),
            memory=int(resources.pop(_MEMORY, 0.0)) or None,
            resources=resources,
            scheduling_strategy="SPREAD",
            max_restarts=0,
        )
        return RaySlot(self._ray, actor.remote(program), number)

    def _no_cluster(self, error: Exception) -> BadInputError:
        return BadInputError(
            f"There is no Ray cluster at {self._address[:80]!r}: {error}",
            "Start one (`ray start --head`), or use --ray-address local.",
        )

    def _check_address(self) -> None:
        """Refuse an address where nobody listens; Ray would try for minutes."""
        if self._address in (LOCAL, "auto"):
            return
        host, _, port = self._address.rpartition(":")
        if not (host and port.isdigit()) or "/" in host:
            raise self._no_cluster(ValueError("that is not HOST:PORT, auto or local"))
        try:
            socket.create_connection((host, int(port)), timeout=_CONNECT_S).close()
        except (OSError, OverflowError, UnicodeError) as error:
            raise self._no_cluster(error) from error

    def _room(self) -> int:
        """How many workers the nodes have room for."""
        room = 0
        for node in self._ray.nodes():
            if node["Alive"]:
                has = node["Resources"]
                wanted = [(name, amount) for name, amount in self._resources.items() if amount]
                fits = [int(has.get(name, 0.0) / amount + 1e-9) for name, amount in wanted]
                room += min(fits, default=MOST_WORKERS)
        return room


class RaySlot(Slot):
    """A slot on some node of the cluster.

    A thread listens to the actor; what it hears waits in a queue of bounded length.

    Args:
        ray: the library.
        actor: handle of a :class:`_SlotActor`.
        number: of the slot.
    """

    def __init__(self, ray: Any, actor: Any, number: int) -> None:
        self._ray = ray
        self._actor = actor
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._heard = Queue[list[dict[str, Any]] | None](_MOST_UNHEARD)
        self._closing = threading.Event()
        self._reason = ""
        self._certain = False
        self.waiting = True
        self._thread = threading.Thread(target=self._listen, name=f"ray-{number}", daemon=True)
        self._thread.start()

    def fileno(self) -> int:
        """See ``Slot.fileno``."""
        return self._event

    def read(self) -> list[dict[str, Any]]:
        """See ``Slot.read``."""
        with suppress(BlockingIOError):
            os.eventfd_read(self._event)
        messages: list[dict[str, Any]] = []
        while not self._heard.empty():
            heard = self._heard.get()
            if heard is None:
                self.ended = True
            else:
                messages += heard
        return messages

    def send(self, message: Mapping[str, Any]) -> None:
        """See ``Slot.send``; the actor's calls keep their order."""
        self._actor.send.remote(dict(message))

    def interrupt(self) -> None:
        """See ``Slot.interrupt``."""
        if self.waiting:  # it has no place yet, and nothing to give back
            self._ray.kill(self._actor)
        else:
            self._actor.interrupt.remote()

    def kill(self) -> None:
        """See ``Slot.kill``."""
        self._actor.kill.remote()

    def close(self) -> SlotEnd:
        """See ``Slot.close``."""
        self._closing.set()
        if not self.waiting and not self._reason:
            self._end_process()
        with suppress(self._ray.exceptions.RayError):
            self._ray.kill(self._actor)
        while self._thread.is_alive():
            self.read()  # it may wait for room in the queue
            self._thread.join(0.05)
        os.close(self._event)
        return SlotEnd(self._reason or "it was ended.", self._certain)

    def _end_process(self) -> None:
        """Let the actor end its process, and remember how that ended."""
        try:
            self._reason = self._ray.get(self._actor.close.remote(), timeout=_END_S)
            self._certain = True
        except self._ray.exceptions.RayError as error:
            self._reason = f"its actor is gone ({type(error).__name__})."

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                messages, ended = self._ray.get(self._actor.read.remote())
            except self._ray.exceptions.RayError as error:
                self._reason = f"its actor or node is gone ({type(error).__name__})."
                break
            except Exception as error:  # noqa: BLE001 - Ray's own, of its shutdown
                self._reason = f"Ray has ended ({error})."
                break
            self.waiting = False
            if messages:
                self._tell(messages)
            if ended:
                break
        self._tell(None)

    def _tell(self, heard: list[dict[str, Any]] | None) -> None:
        self._heard.put(heard)
        os.eventfd_write(self._event, 1)


class _SlotActor:
    """Owns a slot's process, on the node where Ray has put it."""

    def __init__(self, program: SlotProgram) -> None:
        ray = importlib.import_module("ray")
        environment = dict(program.environment)
        cards = ray.get_gpu_ids()
        if cards:
            environment[CARD_VARIABLE] = str(cards[0])
        self._process = SlotProcess(replace(program, environment=environment))

    def read(self) -> tuple[list[dict[str, Any]], bool]:
        """What the process has said, after a second at most; and whether that is all."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._process, selectors.EVENT_READ)
            if not selector.select(_READ_S):
                return [], False
        try:
            return self._process.read(), self._process.ended
        except WorkerLostError:
            self._process.kill()
            return [], True

    def send(self, message: Mapping[str, Any]) -> None:
        """Tell it something."""
        self._process.send(message)

    def interrupt(self) -> None:
        """Ask it to end at once."""
        self._process.interrupt()

    def kill(self) -> None:
        """End it."""
        self._process.kill()

    def close(self) -> str:
        """End it, and say how it ended."""
        return self._process.close().reason


def _actor_class(ray: Any) -> Any:
    """The class for Ray: one thread reads, one tells, so that what is told keeps its order."""
    telling = ray.method(concurrency_group="telling")
    members = {
        "__init__": _SlotActor.__init__,
        "read": ray.method(concurrency_group="reading")(_SlotActor.read),
        **{
            name: telling(getattr(_SlotActor, name))
            for name in ("send", "interrupt", "kill", "close")
        },
    }
    actor = type("SlotActor", (), members)
    return ray.remote(concurrency_groups={"telling": 1, "reading": 1})(actor)
