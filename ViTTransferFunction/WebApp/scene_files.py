"""Reads and writes sessions, and writes segmentations, as Slicer's Save and Add data do, with the same scene."""

from __future__ import annotations

import re
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any
from xml.etree import ElementTree

import slicer

from ..Logic.core.system.errors import InputError, shown
from ..Logic.core.system.file_names import kept_name
from ..Logic.core.system.regular_file import check_regular_file
from ..Logic.files.image_formats import named_voxels

MODULE = "ViTTransferFunction"
LARGEST_SCENE = 8 << 30
"""Largest total size of the unpacked files of a session, bytes."""
_DAMAGES = (
    zipfile.BadZipFile, zlib.error, ElementTree.ParseError, NotImplementedError, EOFError, RuntimeError, ValueError, LookupError
)  # fmt: skip
"""Exceptions from unpacking and reading an archive that is damaged or encrypted, or whose scene has an unknown encoding."""
_BARE_AMPERSAND = re.compile(rb"&(?!(?:amp|lt|gt|quot|apos|#\d+|#x[0-9a-fA-F]+);)")


def parameter_node(scene: Any) -> Any:
    """The module's parameter node in a scene, the same that Slicer uses; it is created if it is missing."""
    node = scene.GetSingletonNode(MODULE, "vtkMRMLScriptedModuleNode")
    if node is not None:
        return node
    node = slicer.vtkMRMLScriptedModuleNode()
    node.SetAttribute("ModuleName", MODULE)
    node.SetSingletonTag(MODULE)
    node.SetName(MODULE)
    return scene.AddNode(node)


def unpacked_session(path: Path, folder: Path) -> Path:
    """Unpack a session (.mrb) into an empty folder; returns the path of the scene (.mrml).

    Raises:
        InputError: the file is not a session, is damaged or too large, refers to data outside it, or cannot be unpacked.
    """
    check_regular_file(path)
    problem = f"{path.name} is no session of Slicer or of this app (.mrb)"
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LARGEST_SCENE:
                raise InputError(f"{path.name} has more than {LARGEST_SCENE >> 30} GB in it; open its volume alone.")
            for entry in archive.infolist():
                if ".." in PurePosixPath(entry.filename.replace("\\", "/")).parts:
                    raise InputError(f"{problem}: it has a file outside of its folder.")
            archive.extractall(folder)
        scenes = sorted(folder.rglob("*.mrml"), key=lambda file: len(file.parts))
        if not scenes:
            raise InputError(f"{problem}: there is no scene in it.")
        _check_self_contained(scenes[0])
        _check_voxels_are_inside(folder, scenes[0])
    except InputError:
        raise
    except OSError as error:
        raise InputError(
            f"{path.name} could not be unpacked to {folder}: {error.strerror or error}. Make room there, or open its "
            "volume alone."
        ) from error
    except _DAMAGES as error:
        raise InputError(f"{problem}, or it is damaged ({shown(str(error))}).") from error
    return scenes[0]


def import_scene(scene: Any, scene_file: Path) -> None:
    """Add the contents of a scene file to an empty scene.

    Raises:
        InputError: the file cannot be read completely.
    """
    scene.SetURL(scene_file.as_posix())
    scene.SetRootDirectory(scene_file.parent.as_posix())
    if not scene.Import():
        raise InputError(f"{scene_file.stem} could not be read whole. Save the session again, or open its volume.")


def stage_session(scene: Any, folder: Path) -> None:
    """Write the scene with its volumes, points and segments to a new folder; zipped (`packing`), it is a session (.mrb).

    Voxels are not compressed, since the scene, and so the page, is blocked meanwhile.

    Raises:
        InputError: the session cannot be written.
    """
    try:
        folder.mkdir()
        with _uncompressed(_storage_nodes(scene)) as ids, _names_for_windows(scene):
            is_written = scene.SaveSceneToSlicerDataBundleDirectory(folder.as_posix(), None)
        for scene_file in folder.glob("*.mrml"):
            _escape_ampersands(scene_file)
            _say_compressed(scene_file, ids)
    # Slicer does not notice if a full disk truncates the scene file, which is then not valid XML.
    except (OSError, ElementTree.ParseError):
        is_written = False
    if not is_written:
        raise InputError("The session could not be saved. Make room on the disk of temporary files, and try again.")


def stage_segmentation(segmentation: Any, path: Path) -> None:
    """Write a segmentation node to a new, uncompressed file (.seg.nrrd), which `packing.gzip_nrrd` compresses.

    Raises:
        InputError: the file cannot be written.
    """
    storage = slicer.vtkMRMLSegmentationStorageNode()
    storage.SetFileName(path.as_posix())
    storage.UseCompressionOff()
    if not storage.WriteData(segmentation):
        raise InputError("The segments could not be written. Make room on the disk of temporary files, and try again.")


@contextmanager
def _names_for_windows(scene: Any) -> Iterator[None]:
    """Give files names that are valid on all systems within: Slicer's own, after nodes, may contain < or be CON, for example.

    Slicer adds numbers to equal names.
    """
    storages = [
        (node.GetStorageNode(), kept_name(node.GetName()))
        for node in _storable_nodes(scene)
        if node.GetStorageNode() is not None and not node.GetStorageNode().GetFileName()
    ]
    for storage, stem in storages:
        storage.SetFileName(f"{stem}.{storage.GetDefaultWriteFileExtension()}")
    try:
        yield
    finally:
        for storage, _ in storages:
            storage.SetFileName(None)


def _storable_nodes(scene: Any) -> list[Any]:
    count = scene.GetNumberOfNodesByClass("vtkMRMLStorableNode")
    return [scene.GetNthNodeByClass(index, "vtkMRMLStorableNode") for index in range(count)]


def _storage_nodes(scene: Any) -> list[Any]:
    """All storage nodes that will write the scene's data; missing ones are created."""
    storable = _storable_nodes(scene)
    for node in storable:
        if node.GetSaveWithScene() and node.GetStorageNode() is None:
            node.AddDefaultStorageNode()
    return [node.GetStorageNode() for node in storable if node.GetStorageNode() is not None]


@contextmanager
def _uncompressed(nodes: list[Any]) -> Iterator[set[str]]:
    """Turn compression of storage nodes off within; yields the ids of those that had it on."""
    compressing = [node for node in nodes if node.GetUseCompression()]
    for node in compressing:
        node.UseCompressionOff()
    try:
        yield {node.GetID() for node in compressing}
    finally:
        for node in compressing:
            node.UseCompressionOn()


def _escape_ampersands(scene_file: Path) -> None:
    """Make a scene valid XML: Slicer does not escape an & of a node's name in the name of the node's file."""
    scene_file.write_bytes(_BARE_AMPERSAND.sub(b"&amp;", scene_file.read_bytes()))


def _say_compressed(scene_file: Path, ids: set[str]) -> None:
    """Turn compression on in the scene file, for the next time that Slicer saves the scene."""
    tree = ElementTree.parse(scene_file)
    for element in tree.iter():
        if element.get("id") in ids:
            element.set("useCompression", "1")
    tree.write(scene_file, encoding="UTF-8", xml_declaration=True)


def _check_self_contained(scene_file: Path) -> None:
    """Raise InputError if a scene would load something from the network, or a file that is not part of the session."""
    for element in ElementTree.parse(scene_file).iter():
        for name, value in element.attrib.items():
            if name.startswith("uri") and value:
                where = "in the network"
            elif name.startswith(("fileName", "fileListMember")) and _leads_out(value):
                where = f"outside of it ({shown(value)})"
            else:
                continue
            raise InputError(f"{scene_file.stem} refers to data {where}, which is not loaded. Save it with its data.")


def _check_voxels_are_inside(folder: Path, scene_file: Path) -> None:
    """Raise InputError if the header of an image may refer to a file outside the session for its voxels."""
    for path in folder.rglob("*"):
        name = named_voxels(path) if path.is_file() else None
        if name is not None and (_leads_out(name) or name.split()[:1] in ([], ["-"], ["LIST"])):
            raise InputError(
                f"{scene_file.stem} refers to data outside of it ({shown(path.name)}: {shown(name)}), which is not loaded. "
                "Save it with its data."
            )


def _leads_out(file_name: str) -> bool:
    """Whether a file name in a scene, of any system, leads out of the scene's folder."""
    return PureWindowsPath(file_name).anchor != "" or ".." in PureWindowsPath(file_name).parts
