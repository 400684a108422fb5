"""The WebSocket: a snapshot, then what changes."""

from __future__ import annotations

from fastapi import APIRouter, WebSocket

router = APIRouter()


@router.websocket("/api/live")
async def live(socket: WebSocket) -> None:
    """Snapshot, then deltas; binary previews of the watched run, newest only."""
    await socket.app.state.services.live.serve(socket)
