"""What the browser sends and fetches as files: volumes and sessions up, segments and sessions down."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aiohttp import web

from ..Logic.core.errors import InputError
from .scene_files import write_segmentation, write_session
from .uploads import receive_files

if TYPE_CHECKING:
    from .app import WebApp

_CHUNK = 1 << 20


class Routes:
    """Adds the routes to the web server.

    Args:
        app: whose scene they open and save.
        path: of a route by its name, as `Access` has it.
    """

    def __init__(self, app: WebApp, path: Callable[[str], str]) -> None:
        self._app = app
        self._path = path

    def add(self, web_server: Any) -> None:
        """To be called when the server is bound."""
        router = web_server.app.router
        router.add_post(self._path("upload"), self._upload)
        router.add_get(self._path("download/segmentation"), self._download_segmentation)
        router.add_get(self._path("download/session"), self._download_session)

    async def _upload(self, request: web.Request) -> web.StreamResponse:
        with tempfile.TemporaryDirectory(prefix="vittf-") as folder:
            try:
                paths = await receive_files(request, Path(folder))
            except InputError as error:
                self._app.report(str(error))
                self._app.refresh()
                return web.json_response({"error": str(error)}, status=400)
            await self._app.open_files(paths)
        return web.json_response({})

    async def _download_segmentation(self, request: web.Request) -> web.StreamResponse:
        node = self._app.session.parameters.segmentation
        if node is None:
            return web.Response(status=404, text="Create segments first.")
        return await self._send(request, f"{self._volume_name()}.seg.nrrd", lambda path: write_segmentation(node, path))

    async def _download_session(self, request: web.Request) -> web.StreamResponse:
        response = await self._send(request, f"{self._volume_name()}.mrb", lambda path: write_session(self._app.scene, path))
        if response.status == 200:
            self._app.mark_saved()
        return response

    def _volume_name(self) -> str:
        """The volume's name, as far as it may be part of a file's."""
        volume = self._app.session.parameters.volume
        return re.sub(r"[^A-Za-z0-9._-]+", "_", volume.GetName() if volume else "").strip("._-") or "volume"

    async def _send(self, request: web.Request, name: str, write: Callable[[Path], None]) -> web.StreamResponse:
        with tempfile.TemporaryDirectory(prefix="vittf-") as folder:
            path = Path(folder) / name
            try:
                write(path)
            except InputError as error:
                self._app.report(str(error))
                self._app.refresh()
                return web.Response(status=500, text=str(error))
            headers = {"Content-Disposition": f'attachment; filename="{name}"', "Content-Type": "application/octet-stream"}
            response = web.StreamResponse(headers=headers)
            response.content_length = path.stat().st_size
            await response.prepare(request)
            # Whole, before the folder goes.
            with path.open("rb") as file:
                while chunk := file.read(_CHUNK):
                    await response.write(chunk)
            await response.write_eof()
            return response
