"""What the browser sends and fetches as files: volumes, sessions and points up, segments, sessions and points down."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from aiohttp import web

from ..Logic.core.system.errors import Cancelled, InputError
from ..Logic.core.system.file_names import kept_name
from ..Logic.core.system.private_folder import private_folder
from ..Logic.core.system.progress import Progress
from ..Logic.files.annotation_files import ANNOTATIONS_ENDING
from ..Logic.files.image_formats import SEGMENTATION_ENDING
from .opening import OPENING
from .packing import gzip_nrrd, zip_folder
from .points_file import save_points
from .scene_files import stage_segmentation, stage_session
from .uploads import receive_files
from .view_camera import save_camera
from .view_pictures import asked_size, pack_picture, stage_picture

if TYPE_CHECKING:
    from .app import WebApp

SERIES = "DICOM series"
"""Name of a volume that was sent as slices without the name of their folder."""

Pack = Callable[[Path, Path, Progress], None]
"""Makes the file that is sent out of what was staged for it."""

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
        router.add_get(self._path("served"), self._tell_whether_served)
        router.add_post(self._path("upload"), self._upload)
        router.add_get(self._path("download/segmentation"), self._download_segmentation)
        router.add_get(self._path("download/session"), self._download_session)
        router.add_get(self._path("download/points"), self._download_points)
        router.add_get(self._path("download/picture"), self._download_picture)
        router.add_get(self._path("download/camera"), self._download_camera)
        router.add_get(self._path("download/film"), self._download_film)

    async def _tell_whether_served(self, request: web.Request) -> web.StreamResponse:
        """Tell a page that lost its connection whether it may come back, or another one was opened since."""
        return web.Response(status=204 if self._app.requests.is_of(request.query.get("page", "")) else 409)

    async def _upload(self, request: web.Request) -> web.StreamResponse:
        try:
            with private_folder() as private:
                # What a series in it will be called, and its segments, and what is saved of them. Windows finds no folder again
                # whose name ends in dots.
                folder = Path(private, kept_name(request.query.get("folder") or SERIES).rstrip(". ") or SERIES)
                folder.mkdir()
                await self._app.opening.open(await receive_files(request, folder))
        except InputError as error:
            self._app.report(str(error), OPENING)
            self._app.refresh()
            return web.json_response({"error": str(error)}, status=400)
        return web.json_response({})

    async def _download_segmentation(self, request: web.Request) -> web.StreamResponse:
        node = self._app.session.parameters.segmentation
        if node is None:
            return web.Response(status=404, text="Create segments first.")
        name = f"{self._volume_name()}{SEGMENTATION_ENDING}"
        return await self._send(request, name, lambda staged: stage_segmentation(node, staged), gzip_nrrd)

    async def _download_session(self, request: web.Request) -> web.StreamResponse:
        session, work = self._app.session, self._app.work
        name = f"{self._volume_name()}.mrb"
        response = await self._send(request, name, lambda staged: stage_session(self._app.scene, staged), zip_folder)
        if response.status == 200 and self._app.session is session:
            self._app.mark_saved(work)
        return response

    async def _download_points(self, request: web.Request) -> web.StreamResponse:
        session, classes = self._app.session, self._app.session.classes
        # As `vittf cohort` looks for it.
        name = f"{self._volume_name()}{ANNOTATIONS_ENDING}"
        response = await self._send(request, name, lambda staged: save_points(session, staged), _as_it_is)
        if response.status == 200 and self._app.session is session:
            self._app.unsaved_points.mark_saved(classes)
        return response

    async def _download_picture(self, request: web.Request) -> web.StreamResponse:
        asked, window = request.query, self._app.views.view_3d.render_window()

        def stage(staged: Path) -> None:
            size = asked_size(asked.get("width"), asked.get("height"))
            self._app.views.leave()
            stage_picture(window, size, asked.get("transparent") == "true", staged)

        return await self._send(request, f"{self._volume_name()}.png", stage, pack_picture)

    async def _download_camera(self, request: web.Request) -> web.StreamResponse:
        asked, window = request.query, self._app.views.view_3d.render_window()

        def stage(staged: Path) -> None:
            save_camera(self._app.session, window, asked_size(asked.get("width"), asked.get("height")), staged)

        return await self._send(request, f"{self._volume_name()}.json", stage, _as_it_is)

    async def _download_film(self, request: web.Request) -> web.StreamResponse:
        path = self._app.films.path
        if path is None:
            return web.Response(status=404, text="Make a film first.")
        return await _sent(request, path, f"{self._volume_name()}{path.suffix}")

    def _volume_name(self) -> str:
        """The volume's name, as files are called after it."""
        volume = self._app.session.parameters.volume
        return kept_name((volume.GetName() if volume else "") or "volume")

    async def _send(self, request: web.Request, name: str, stage: Callable[[Path], None], pack: Pack) -> web.StreamResponse:
        """Send what `stage` writes, quickly, and `pack` compresses while everything else goes on."""
        self._app.try_again(request.path)
        self._app.refresh()
        try:
            with private_folder() as folder:
                # A session has a folder in it of this name, and not every program reads every alphabet in archives.
                staged, path = Path(folder, "staged", _in_ascii(name.removesuffix(".mrb"))), Path(folder, name)
                staged.parent.mkdir()
                stage(staged)
                await self._pack(staged, path, pack)
                # Whole, before the folder goes.
                return await _sent(request, path, name)
        except InputError as error:
            self._app.report(str(error), request.path)
            self._app.refresh()
            # The page tells why. With any content, browsers would keep that as a file, or go to it.
            return web.Response(status=204)
        except Cancelled:
            return web.Response(status=503, text="The app was ended.")

    async def _pack(self, staged: Path, path: Path, pack: Pack) -> None:
        """Have a thread compress, and the page show how far it is."""
        loop = asyncio.get_running_loop()

        def progress(done: int, total: int, what: str) -> None:
            if self._app.stopping:
                raise Cancelled
            loop.call_soon_threadsafe(self._app.show_saving, path.name, done / max(total, 1))

        try:
            await asyncio.to_thread(pack, staged, path, progress)
        except OSError as error:
            reason = error.strerror or str(error)
            raise InputError(
                f"{path.name} could not be saved: {reason}. Make room on the disk of temporary files, and try again."
            ) from error
        finally:
            self._app.show_saving(path.name, None)


def _in_ascii(name: str) -> str:
    """A file's name for those that know no other letters."""
    return re.sub(r'[^ -~]|["\\]', "_", name)


def _as_it_is(staged: Path, path: Path, progress: Progress) -> None:
    """Send what was staged; not renamed, which Windows refuses while a virus scanner looks at what is new."""
    path.write_bytes(staged.read_bytes())


async def _sent(request: web.Request, path: Path, name: str) -> web.StreamResponse:
    """Send a file, which the browser keeps under a name."""
    disposition = f"attachment; filename=\"{_in_ascii(name)}\"; filename*=UTF-8''{quote(name)}"
    headers = {"Content-Disposition": disposition, "Content-Type": "application/octet-stream"}
    response = web.StreamResponse(headers=headers)
    with path.open("rb") as file:
        response.content_length = path.stat().st_size
        await response.prepare(request)
        while chunk := file.read(_CHUNK):
            await response.write(chunk)
    await response.write_eof()
    return response
