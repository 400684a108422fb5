"""Where episodes are recorded: the executors' seam, and a collector as a child process."""

from carstage.execution.collector_process import (
    CollectorAhead,
    CollectorProcess,
    InterpreterError,
)
from carstage.execution.executor import Executor, InlineExecutor, InlineWork, Worker
from carstage.execution.local_processes import LocalProcesses
from carstage.execution.slots import Slot, SlotEnd, SlotProgram, SlotsExecutor, SlotWork

__all__ = [
    "CollectorAhead",
    "CollectorProcess",
    "Executor",
    "InlineExecutor",
    "InlineWork",
    "InterpreterError",
    "LocalProcesses",
    "Slot",
    "SlotEnd",
    "SlotProgram",
    "SlotWork",
    "SlotsExecutor",
    "Worker",
]
