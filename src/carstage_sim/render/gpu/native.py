"""Calls of wgpu-native itself, where wgpu's Python does more than is needed in every frame.

Its own way to read a buffer submits once more, wakes a thread that waits until all work is done,
and copies. Here the caller waits for one submission, and gets the mapped memory itself.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

READ, WRITE = 1, 2
"""Modes of mapping, as ``WGPUMapMode`` has them."""

_BOUNDS_CHECKS = 1
_ANSWERS_WITHIN_S = 10.0
"""Another thread may have been given the answer, and be about to tell it; else the card is lost."""


class _Answer:
    """What a card says to a wish to map a buffer."""

    def __init__(self) -> None:
        self.came = threading.Event()
        self.status = 0

    def is_there(self, status: int) -> None:
        self.status = status
        self.came.set()


class Commands:
    """Work for a card in the order in which it is recorded.

    wgpu's Python makes an object of each step and asks after each whether it went well: that took
    longer than the card casts a picture's rays. Here the end of the recording is asked.
    """

    def __init__(self, ffi: Any, lib: Any, device: Any) -> None:
        self._ffi, self._lib, self._device = ffi, lib, device
        self._encoder = lib.wgpuDeviceCreateCommandEncoder(device._internal, ffi.NULL)
        self._compute = ffi.NULL

    def dispatch(self, pipeline: Any, groups: Sequence[Any], size: tuple[int, int, int]) -> None:
        """A pipeline with all its bind groups, over so many work groups."""
        lib, none = self._lib, self._ffi.NULL
        if self._compute == none:
            self._compute = lib.wgpuCommandEncoderBeginComputePass(self._encoder, none)
        lib.wgpuComputePassEncoderSetPipeline(self._compute, pipeline._internal)
        for number, group in enumerate(groups):
            lib.wgpuComputePassEncoderSetBindGroup(self._compute, number, group._internal, 0, none)
        lib.wgpuComputePassEncoderDispatchWorkgroups(self._compute, *size)

    def copy(self, source: Any, start: int, target: Any, offset: int, size: int) -> None:
        """Bytes from a place in one buffer to a place in another."""
        self._end_computing()
        self._lib.wgpuCommandEncoderCopyBufferToBuffer(
            self._encoder, source._internal, start, target._internal, offset, size
        )

    def clear(self, buffer: Any, size: int) -> None:
        """Zeros in the first bytes of a buffer."""
        self._end_computing()
        self._lib.wgpuCommandEncoderClearBuffer(self._encoder, buffer._internal, 0, size)

    def submit(self) -> int:
        """Let the card begin, once; the number tells this submission from others.

        Raises:
            wgpu.GPUValidationError: something cannot be done as it was recorded.
        """
        from wgpu.backends.wgpu_native import _api as api

        self._end_computing()
        lib, commands = self._lib, self._ffi.new("WGPUCommandBuffer[1]")
        try:
            commands[0] = api.libf.wgpuCommandEncoderFinish(self._encoder, self._ffi.NULL)
        finally:
            lib.wgpuCommandEncoderRelease(self._encoder)
        queue = self._device.queue._internal
        submission = int(lib.wgpuQueueSubmitForIndex(queue, 1, commands))
        lib.wgpuCommandBufferRelease(commands[0])
        return submission

    def _end_computing(self) -> None:
        if self._compute != self._ffi.NULL:
            self._lib.wgpuComputePassEncoderEnd(self._compute)
            self._lib.wgpuComputePassEncoderRelease(self._compute)
            self._compute = self._ffi.NULL


class Native:
    """The functions of one device; one thread at a time records and submits, any may map.

    Args:
        device: wgpu's device.
    """

    def __init__(self, device: Any) -> None:
        from wgpu.backends.wgpu_native._ffi import ffi, lib

        self._ffi, self._lib = ffi, lib
        self._device = device

        def mapped(status: int, message: object, answer: object, second: object) -> None:
            ffi.from_handle(answer).is_there(int(status))

        signature = "void(WGPUMapAsyncStatus, WGPUStringView, void *, void *)"
        self._callback = ffi.callback(signature, mapped)
        self._waiting = threading.Lock()

    def commands(self) -> Commands:
        """Begin to record work."""
        return Commands(self._ffi, self._lib, self._device)

    def write(self, buffer: Any, offset: int, array: NDArray[Any]) -> None:
        """Copy an array into a buffer before what is submitted next.

        Raises:
            ValueError: the buffer has no room for it.
        """
        if offset + array.nbytes > buffer.size:
            raise ValueError(f"{array.nbytes} bytes at {offset} of a buffer of {buffer.size}")
        queue, data = self._device.queue._internal, self._ffi.from_buffer(array)
        self._lib.wgpuQueueWriteBuffer(queue, buffer._internal, offset, data, array.nbytes)

    def map(
        self, buffer: Any, size: int, mode: int, after: int, done: Callable[[], None]
    ) -> NDArray[np.uint8]:
        """A buffer's memory, once the card has done a submission.

        Args:
            buffer: that may be mapped so.
            size: its first bytes.
            mode: :data:`READ` or :data:`WRITE`.
            after: the submission.
            done: called, from any thread, when nobody holds the memory any more.

        Raises:
            RuntimeError: the card was lost.
        """
        ffi, lib, internal = self._ffi, self._lib, buffer._internal
        answer = _Answer()
        handle = ffi.new_handle(answer)
        info = ffi.new("WGPUBufferMapCallbackInfo *")
        info.mode = lib.WGPUCallbackMode_AllowProcessEvents
        info.callback, info.userdata1 = self._callback, handle
        lib.wgpuBufferMapAsync(internal, mode, 0, size, info[0])
        self._await(answer, ffi.new("WGPUSubmissionIndex *", after))
        if answer.status != lib.WGPUMapAsyncStatus_Success:
            raise RuntimeError(f"the card's memory could not be mapped (status {answer.status})")
        get = lib.wgpuBufferGetConstMappedRange if mode == READ else lib.wgpuBufferGetMappedRange
        memory = ffi.gc(get(internal, 0, size), lambda _: done())
        return np.frombuffer(ffi.buffer(memory, size), np.uint8)

    def _await(self, answer: _Answer, submission: Any) -> None:
        """Wait for an answer, which comes in the thread that happens to ask for any."""
        poll, device = self._lib.wgpuDevicePoll, self._device._internal
        poll(device, False, self._ffi.NULL)
        if not answer.came.is_set():
            # One at a time waits within the library: who submits gets in between.
            with self._waiting:
                if not answer.came.is_set():
                    poll(device, True, submission)
            answer.came.wait(_ANSWERS_WITHIN_S)

    def unmap(self, buffer: Any) -> None:
        """Give a buffer's memory back to the card."""
        self._lib.wgpuBufferUnmap(buffer._internal)

    def shader(self, code: str) -> Any:
        """A shader whose loops are known to end: WebGPU would count every round of each.

        wgpu 0.31, the last for Python 3.10, cannot be told and counts.
        """
        from wgpu.backends.wgpu_native import _api as api

        create = getattr(api.libf, "wgpuDeviceCreateShaderModuleTrusted", None)
        if create is None:
            return self._device.create_shader_module(code=code)
        ffi, lib = self._ffi, self._lib
        source = api.new_struct_p("WGPUShaderSourceWGSL *", code=api.to_c_string_view(code))
        source[0].chain.next = ffi.NULL
        source[0].chain.sType = lib.WGPUSType_ShaderSourceWGSL
        descriptor = api.new_struct_p(
            "WGPUShaderModuleDescriptor *",
            nextInChain=ffi.cast("WGPUChainedStruct *", source),
            label=api.to_c_string_view(""),
        )
        made = create(self._device._internal, descriptor, _BOUNDS_CHECKS)
        if made == ffi.NULL:
            raise RuntimeError("a shader was refused")
        return api.GPUShaderModule("", made, self._device)
