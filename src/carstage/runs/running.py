"""``run``: checks what was asked for, plans it, and records it."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

from carstage.config import Config, check_config, dump_config, load_config
from carstage.config.servers import CarlaServerConfig
from carstage.execution import Executor, InlineExecutor, LocalProcesses, SlotProgram
from carstage.plan import Shard, estimate_run, plan_episodes
from carstage.runs.allotment import (
    Machine,
    Workers,
    check_ports,
    config_of_worker,
    number_of_workers,
)
from carstage.runs.attempts import clear_up_all
from carstage.runs.cataloguing import run_catalog
from carstage.runs.continuing import environment_of, refuse_to_mix
from carstage.runs.enough import QuotaWatch
from carstage.runs.events import Notice, OnEvent, RunPlanned
from carstage.runs.fleet import Fleet
from carstage.runs.folder import RunFolder
from carstage.runs.interruption import ANSWER_S, Interruption
from carstage.runs.orphans import marked
from carstage.runs.outcome import RunResult
from carstage.runs.preflight import (
    check_before_server,
    check_disk,
    check_open_files,
    check_output,
    recording_of,
    work_folder,
)
from carstage.runs.record import RunRecord
from carstage.runs.run_session import ENOUGH, RunSession
from carstage.runs.server_lock import server_lock
from carstage.runs.servers import ServerSetup
from carstage.runs.session import Session
from carstage.runs.slot import slot_program
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.server import ClientPython
from carstage.storage import RemotePath, Store, open_store

DEFAULT_RETRIES = 2

ConfigSource: TypeAlias = "Config | str | os.PathLike[str] | Mapping[str, Any]"
"""A checked configuration, the path of a YAML file, or its content as plain values."""


def run(
    config: ConfigSource,
    out: Path | str,
    on_event: OnEvent | None = None,
    *,
    retries: int = DEFAULT_RETRIES,
    executor: Executor | None = None,
    run_id: str | None = None,
    append: bool = False,
    shard: str | None = None,
    catalog: str | None = None,
    work: Path | str | None = None,
    workers: Workers = 1,
) -> RunResult:
    """Record a configuration's episodes into a dataset; those that it has already are skipped.

    Returns only when server, collector and converters are gone, whatever happens. The processes
    that it starts never import the caller's main module: it works in a notebook, in a script
    without ``if __name__ == "__main__"``, by ``python -c`` and on standard input, from any thread.

    Called from the main thread, SIGINT (Ctrl-C, a notebook's stop button), SIGTERM and SIGHUP end
    the run well: the result says ``interrupted``, committed episodes stay, and the same call again
    continues. A second signal kills server and collector and ends the process with status 130; an
    interactive session stays and gets ``KeyboardInterrupt``.

    Args:
        config: what to record: a ``Config``, the path of a YAML file, or a mapping of plain values
            as in that file.
        out: folder of the dataset, or its place in an object store, such as
            ``s3://bucket/prefix``; it is made if missing.
        on_event: called with each typed event of ``carstage.runs.events``.
        retries: further attempts of an episode that fails.
        executor: where episodes are recorded, such as ``carstage.execution.ray_slots.RayExecutor``;
            default: on this machine, by ``workers`` workers.
        run_id: name of the run's folder; default: a new one.
        append: record also beside episodes of other settings, of another version or environment.
        shard: record this share of the episodes alone, as ``"2/8"``; the others are for other
            machines, which may fill the same dataset at the same time. Default: all.
        catalog: also write what is committed to this catalog, ``postgresql://…`` or an SQLite
            file. Default: the one that ``CARSTAGE_CATALOG`` names, if it is set.
        work: folder of this machine for raw recordings, logs and the run's state. Default: the
            dataset's folder; for an object store one in the user's cache.
        workers: how many servers record at the same time on this machine, each an episode of its
            own; ``"auto"``: as many as its cores and memory (with CARLA, its graphics cards) are
            good for. The bytes do not depend on it.

    Returns:
        How the run ended. Failed episodes are in ``failures``; they raise nothing.

    Raises:
        ConfigError: a value of the configuration is wrong, or its file cannot be read.
        OtherSettingsError: ``out`` holds episodes of other settings; see ``append``.
        BadInputError: something cannot be, or another run uses the server; nothing was started.
        ServerError: the server cannot be started, or fails a self-test that it must pass.
        StoreAccessError: the object store lets this user do nothing, or cannot hold a dataset.
        StorageError: the dataset cannot be written, for example as the disk is full.
        CatalogError: the catalog cannot be opened; nothing was started.
        KeyboardInterrupt: a signal came before the first episode was planned, or a second one.

    Example:
        >>> import carstage
        >>> result = carstage.run({"duration_s": 2.0, "rig": {"preset": "demo"}}, "datasets/short")
        >>> result.state, result.frames
        ('done', 20)
    """
    config = _checked(config)
    share = Shard(1, 1) if shard is None else Shard.parse(shard)
    store = open_store(out)
    place = work_folder(store.root, work)
    notice = _noticing(on_event)
    executor = executor or _local_executor(number_of_workers(config, workers))
    if not executor.in_process:
        number_of_workers(config, 2)  # each needs a server of its own
    with Interruption(notice) as interruption, ExitStack() as stack:
        stack.enter_context(store.within(partial(interruption.left_before_s, ANSWER_S)))
        _check(config, place, store, notice)
        follow = stack.enter_context(run_catalog(catalog, store.root, notice))
        stack.enter_context(executor.opened())
        if executor.count > 1:
            check_ports(config, executor.count)
        present = _take_over(place, store, notice)
        settings = dump_config(config)
        if not append:  # as far as it is known without the server
            refuse_to_mix(store.root, place, present, None, settings)
        setup = ServerSetup(config)
        with server_lock(config), setup.facts() as facts:
            plan = plan_episodes(config, facts, recording_of(config))
            environment = environment_of(facts.dialect, setup.client.client)
            if not append:
                refuse_to_mix(store.root, place, present, plan.ids, settings, environment)
            episodes = plan[share.places]
            todo = episodes.without(present)
            quotas = QuotaWatch(config, store, plan.ids)
            if quotas.met():
                notice(ENOUGH % len(todo))
                episodes, todo = episodes.without(set(todo.ids)), todo[:0]
            estimate = estimate_run(config, todo, executor.count)
            check_disk(place, estimate, dataset_elsewhere=isinstance(store.root, RemotePath))
            store.initialise(config.name)
            if on_event is not None:
                on_event(RunPlanned(estimate, len(todo), len(episodes) - len(todo)))
            with RunFolder(place, run_id) as folder, marked(folder.run_id), WakeupPipe() as wakeup:
                folder.write_plan(config, episodes, environment, shard)
                listener = quotas.listening(follow(on_event, folder))
                record = RunRecord(folder, interruption, listener)
                if executor.in_process:
                    session: RunSession = Session(
                        config,
                        setup,
                        store,
                        record,
                        interruption,
                        wakeup,
                        retries,
                        environment,
                        executor,
                    )
                else:
                    setup.cool_down()
                    given = (folder, store, config, setup.client, environment, retries, executor)
                    programs = _programs(*given)
                    session = Fleet(store, record, interruption, retries, executor, programs)
                session.enough = quotas.met
                return session.run(episodes, todo)


def _programs(
    folder: RunFolder,
    store: Store,
    config: Config,
    client: ClientPython,
    environment: Mapping[str, str],
    retries: int,
    executor: Executor,
) -> Callable[[int], SlotProgram]:
    """What each of several workers is to run."""
    count, cores = executor.count, executor.cores_per_worker
    machine = Machine.here(cards=cores is None and isinstance(config.server, CarlaServerConfig))
    if cores is not None:
        machine = replace(machine, cores=cores * count)

    def program(number: int) -> SlotProgram:
        own = config_of_worker(config, number, count, machine)
        return slot_program(folder, store.root, number, count, own, client, environment, retries)

    return program


def _noticing(on_event: OnEvent | None) -> Callable[[str], None]:
    def notice(sentence: str) -> None:
        if on_event is not None:
            on_event(Notice(sentence))

    return notice


def _local_executor(workers: int) -> Executor:
    return InlineExecutor() if workers == 1 else LocalProcesses(workers)


def _check(config: Config, work: Path, store: Store, notice: Callable[[str], None]) -> None:
    for warning in config.warnings():
        notice(warning)
    check_output(work)
    check_open_files()
    check_before_server(config)
    store.check()


def _checked(config: ConfigSource) -> Config:
    if isinstance(config, Config):
        return config
    if isinstance(config, Mapping):
        return check_config(dict(config))
    return load_config(Path(config))


def _take_over(work: Path, store: Store, notice: Callable[[str], None]) -> Collection[str]:
    """Clear up after earlier runs; returns the ids of the episodes that need not be recorded."""
    present = clear_up_all(work, store, notice)
    for marker in store.lost(present.values()) if present else ():
        store.retire(marker)
        del present[marker.episode_id]
        notice(
            f"No file of episode {marker.episode_id} is there any more, though it was committed. "
            "Its marker is kept in lost/; it is recorded again."
        )
    return present.keys()
