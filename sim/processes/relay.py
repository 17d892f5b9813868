"""A TCP relay between one robot and the coordinator (or its router): a network that can be cut.

Decides: when bytes are passed on.  Must not know: what the bytes mean, or which robot sends them.

While the relay is cut it passes nothing in either direction, not even the end of a connection, and
does not forward new connections: to both sides it looks like a network that loses everything.  What
was sent meanwhile arrives when the cut is healed, as TCP would retransmit it.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import suppress
from typing import Final

_CHUNK: Final = 65_536


class Relay:
    """Listens on a loopback port of its own until it is closed, and forwards to another port.

    Runs in a thread of its own; its methods may be called from any thread.
    """

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self._target = (host, port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self._loop = asyncio.new_event_loop()
        self._whole = asyncio.Event()
        self._over = asyncio.Event()
        self._connections: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._run, name=f"relay {self.port}", daemon=True)
        self._whole.set()
        self._thread.start()

    def close(self) -> None:
        """Close every connection and the port; may be called twice."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
            self._thread.join()

    def cut(self) -> None:
        """Pass nothing from now on."""
        self._loop.call_soon_threadsafe(self._whole.clear)

    def heal(self) -> None:
        """Pass on the bytes that were held back, and all that come later."""
        self._loop.call_soon_threadsafe(self._whole.set)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._accept, sock=self._listener)
        async with server:
            await self._over.wait()
            server.close()
            for connection in self._connections:
                connection.cancel()
            await asyncio.gather(*self._connections, return_exceptions=True)

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = asyncio.create_task(self._connect(reader, writer))
        self._connections.add(connection)
        connection.add_done_callback(self._connections.discard)

    async def _connect(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Pass one connection on until both of its ends have closed it."""
        with suppress(OSError):
            try:
                await self._whole.wait()
                there = await asyncio.open_connection(*self._target)
                try:
                    await asyncio.gather(self._pump(reader, there[1]), self._pump(there[0], writer))
                finally:
                    await _close(there[1])
            finally:
                await _close(writer)

    async def _pump(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        """Pass bytes on in one direction, and then the end of the stream."""
        while content := await _read(source):
            await self._whole.wait()
            sink.write(content)
            await sink.drain()
        await self._whole.wait()
        sink.write_eof()


async def _read(source: asyncio.StreamReader) -> bytes:
    """Return the bytes that have arrived; none at the end, also of a broken connection."""
    try:
        return await source.read(_CHUNK)
    except OSError:
        return b""


async def _close(writer: asyncio.StreamWriter) -> None:
    writer.close()
    with suppress(OSError):
        await writer.wait_closed()
