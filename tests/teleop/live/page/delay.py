"""A slow connection."""

from __future__ import annotations

import asyncio
import contextlib


class Delay:
    """A proxy that delays what a server and its clients send to each other."""

    def __init__(self):
        self.seconds = 0.0
        """Present delay in each direction."""

    @contextlib.asynccontextmanager
    async def before(self, address):
        """Delay the connections to a server within the block; yield the address of the proxy."""
        connections = set()

        async def connect(*client):
            connections.add(asyncio.current_task())
            await self._connect(client, await asyncio.open_connection(*address.split(":")))

        proxy = await asyncio.start_server(connect, "127.0.0.1", 0)
        try:
            yield f"127.0.0.1:{proxy.sockets[0].getsockname()[1]}"
        finally:
            proxy.close()
            for connection in connections:
                connection.cancel()
            await asyncio.gather(*connections, return_exceptions=True)

    async def _connect(self, client, server):
        try:
            async with asyncio.TaskGroup() as group:
                for (reader, _), (_, writer) in ((client, server), (server, client)):
                    waiting = asyncio.Queue()
                    group.create_task(self._receive(reader, waiting))
                    group.create_task(self._send(writer, waiting))
        except* ConnectionError:
            pass
        finally:
            for _, writer in (client, server):
                writer.transport.abort()

    async def _receive(self, reader, waiting):
        while content := await reader.read(1 << 16):
            waiting.put_nowait((asyncio.get_running_loop().time() + self.seconds, content))
        waiting.put_nowait((0.0, b""))

    async def _send(self, writer, waiting):
        while True:
            due, content = await waiting.get()
            await asyncio.sleep(due - asyncio.get_running_loop().time())
            if not content:
                raise ConnectionResetError  # ends both directions, after all data were sent
            writer.write(content)
            await writer.drain()
