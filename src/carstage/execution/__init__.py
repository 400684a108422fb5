"""Where episodes are recorded: the executor's seam, and a collector as a child process."""

from carstage.execution.collector_process import CollectorProcess, InterpreterError
from carstage.execution.executor import Executor, InlineExecutor, Worker

__all__ = ["CollectorProcess", "Executor", "InlineExecutor", "InterpreterError", "Worker"]
