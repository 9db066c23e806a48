"""`vittf render`: pictures and films as they were asked for, and refusals before anything is drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from ViTTransferFunction.CommandLine.canvas import BACKGROUND
from ViTTransferFunction.CommandLine.pictures import NO_CONTEXT
from ViTTransferFunction.CommandLine.render_command import CONTEXTS, STYLES
from ViTTransferFunction.CommandLine.rendering_picture import Rendering
from ViTTransferFunction.CommandLine.vittf import main
from ViTTransferFunction.Logic.core.classes.colors import default_color
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.files.camera_files import read_camera
from ViTTransferFunction.Logic.rendering.appearance import STYLES as ALL_STYLES
from ViTTransferFunction.Logic.rendering.composition import MOST_STRUCTURES
from ViTTransferFunction.Logic.rendering.surroundings import CONTEXTS as ALL_CONTEXTS
from ViTTransferFunction.Testing.support.pictures import BLUE, GREEN, RED, ball, dark_volume, landmarks, pixels_of, place_of

SHAPE, SPACING_MM = (40, 40, 40), 2.0


@pytest.fixture(scope="module")
def opengl() -> None:
    """Skip where nothing can be rendered."""
    geometry = Geometry((8, 8, 8), np.eye(4))
    try:
        with Rendering(dark_volume(geometry), [_anything(geometry)]):
            pass
    except InputError as error:
        pytest.skip(str(error))


def _anything(geometry: Geometry):
    segment = ball(geometry, "any", RED)
    segment.mask[:] = True
    return segment


def write_case(folder: Path, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[str, str]:
    """A scan and its labels: a large ball in front, and a small one to the patient's left; in LPS, as ITK has it."""
    folder.mkdir()
    k, j, i = np.indices(SHAPE)
    labels = np.zeros(SHAPE, dtype=np.uint8)
    labels[(i - 15) ** 2 + (j - 10) ** 2 + (k - 20) ** 2 < 64] = 1
    labels[(i - 32) ** 2 + (j - 25) ** 2 + (k - 20) ** 2 < 16] = 2
    # Brighter towards the head, for styles by which intensities decide what is seen.
    scan = np.where(labels > 0, labels * 50 + 4 * k, 0).astype(np.int16)
    for name, array in (("scan.nrrd", scan), ("labels.nrrd", labels)):
        image = sitk.GetImageFromArray(array)
        image.SetSpacing([SPACING_MM] * 3)
        image.SetOrigin(origin)
        sitk.WriteImage(image, str(folder / name))
    return str(folder / "scan.nrrd"), str(folder / "labels.nrrd")


@pytest.fixture
def case(tmp_path: Path) -> tuple[str, str]:
    return write_case(tmp_path / "case")


def read_png(path: Path) -> np.ndarray:
    return sitk.GetArrayFromImage(sitk.ReadImage(str(path)))


@pytest.mark.parametrize("options", [[], ["--transparent"]], ids=str)
def test_a_picture_has_the_size_that_was_asked_for(
    opengl: None, tmp_path: Path, case: tuple[str, str], options: list[str]
) -> None:
    assert main(["render", *case, "--3d", str(tmp_path / "p.png"), "--size", "211x160", *options]) == 0
    assert read_png(tmp_path / "p.png").shape == (160, 211, 4 if options else 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case", "p.png"]


def test_both_pictures_are_drawn_where_they_were_before(opengl: None, tmp_path: Path, case: tuple[str, str]) -> None:
    assert main(["render", *case, "-o", str(tmp_path / "p.png"), "--size", "200x160"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case", "p.png", "p_3d.png"]


@pytest.mark.parametrize("context", list(CONTEXTS))
@pytest.mark.parametrize("style", ["surface", "as-scanned"])
def test_each_context_and_style_is_drawn(opengl: None, tmp_path: Path, case: tuple[str, str], context: str, style: str) -> None:
    options = ["--context", context, "--style", style, "--size", "120x120"]
    assert main(["render", *case, "--3d", str(tmp_path / "p.png"), *options]) == 0
    assert np.ptp(read_png(tmp_path / "p.png")[:80]) > 50


@pytest.mark.parametrize("context", ["bones-and-vessels", None])
def test_what_surrounds_a_scan_is_not_drawn_as_bone(
    opengl: None, tmp_path: Path, case: tuple[str, str], context: str | None
) -> None:
    """A scan padded with a value above all else looks like the same with air there."""
    scan = sitk.ReadImage(case[0])
    ct = sitk.GetArrayFromImage(scan).astype(np.int32) - 1000
    pictures = []
    for padding in (-1000, 65535):
        ct[:, :, :3] = padding
        padded = sitk.GetImageFromArray(ct)
        padded.CopyInformation(scan)
        sitk.WriteImage(padded, str(tmp_path / "padded.nrrd"))
        options = ["--context", context] if context else []
        assert main(["render", str(tmp_path / "padded.nrrd"), case[1], "-o", str(tmp_path / "p.png"), *options]) == 0
        pictures.append([read_png(tmp_path / name) for name in ("p.png", "p_3d.png")])
    for drawn, with_air in zip(*pictures, strict=True):
        np.testing.assert_array_equal(drawn, with_air)


def test_what_one_types_are_the_contexts_and_styles_that_there_are() -> None:
    assert set(CONTEXTS.values()) == {NO_CONTEXT, *ALL_CONTEXTS}
    assert set(STYLES.values()) == set(ALL_STYLES)


def test_views_by_name_show_the_patient_from_that_side(opengl: None, tmp_path: Path, case: tuple[str, str]) -> None:
    places = {}
    for view in ("front", "left", "back"):
        assert main(["render", *case, "--3d", str(tmp_path / "p.png"), "--size", "200x160", "--view", view]) == 0
        # Above the legend, which has the colours as well.
        picture = read_png(tmp_path / "p.png")[:125]
        places[view] = place_of(picture, default_color(0))[0] - place_of(picture, default_color(1))[0]
    # The first ball is the patient's right one, and in front.
    assert places["front"] < -0.1
    assert places["back"] > 0.1
    assert places["left"] < -0.1


def test_a_saved_camera_shows_another_case_alike(opengl: None, tmp_path: Path, case: tuple[str, str]) -> None:
    other = write_case(tmp_path / "other", origin=(400.0, -90.0, 777.0))
    camera, first, second = tmp_path / "c.json", tmp_path / "first.png", tmp_path / "second.png"
    view = ["--azimuth", "-35", "--elevation", "20", "--size", "200x160"]
    assert main(["render", *case, "--3d", str(first), *view, "--save-camera", str(camera)]) == 0
    assert main(["render", *other, "--3d", str(second), "--camera", str(camera)]) == 0
    assert read_camera(camera).size[0] == 200
    # The second is as high as the first without its legend, and has one of its own below.
    height = read_camera(camera).size[1]
    difference = abs(read_png(first)[:height].astype(int) - read_png(second)[:height])
    assert np.percentile(difference, 99) <= 8


def test_a_transparent_picture_is_clear_where_nothing_is_and_laid_on_the_background_is_the_other(
    opengl: None, aligned: Geometry
) -> None:
    glass = ball(aligned, "glass", GREEN, radius_mm=30.0, opacity=0.4)
    with Rendering(dark_volume(aligned), [*landmarks(aligned), glass]) as rendering:
        camera = rendering.framing(size=(240, 240))
        clear, solid = rendering.picture(camera, transparent=True), rendering.picture(camera)
    opacity = clear[..., 3:] / 255.0
    assert (opacity[[0, 0, -1, -1], [0, -1, 0, -1]] == 0.0).all()
    assert opacity.max() == 1.0
    assert 0.2 < np.median(opacity[(opacity > 0.0) & (opacity < 1.0)]) < 0.9
    background = solid[:, :1].astype(float)
    laid = opacity * clear[..., :3] + (1.0 - opacity) * background
    assert abs(laid - solid).max() <= 4.0
    assert pixels_of(clear[..., :3], BLUE).any()


@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_a_turntable_shows_all_sides(opengl: None, tmp_path: Path, case: tuple[str, str], ending: str) -> None:
    from ViTTransferFunction.Testing.files.test_film import frames_of

    pytest.importorskip({"gif": "PIL", "mp4": "imageio_ffmpeg"}[ending])
    film = tmp_path / f"film.{ending}"
    arguments = ["--turntable", str(film), "--frames", "8", "--seconds", "2", "--size", "160x144"]
    assert main(["render", *case, *arguments]) == 0
    frames, seconds = frames_of(film)
    assert seconds == pytest.approx(2.0, abs=0.02)
    assert [frame.shape for frame in frames] == [(144, 160, 3)] * 8
    across = [place_of(frame[:110], default_color(0))[0] for frame in frames]
    # The first ball is to the left of the axis from the front, and on its other side from behind.
    assert across[0] < 0.45
    assert across[4] > 0.55
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case", film.name]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "Nothing to draw"),
        (["--save-camera", "c.json"], "Nothing to draw"),
        (["--3d", "p.jpg"], "ends in .png"),
        (["--turntable", "f.avi"], ".mp4 or .gif"),
        (["--turntable", "f.gif", "--frames", "1"], "frames"),
        (["--turntable", "f.gif", "--seconds", "0.1"], "seconds"),
        (["--turntable", "f.gif", "--transparent"], "transparent"),
        (["--3d", "p.png", "--frames", "20"], "--turntable"),
        (["--3d", "p.png", "--size", "big"], "--size"),
        (["--3d", "p.png", "--size", "640"], "--size"),
        (["--3d", "p.png", "--size", "0x100"], "--size"),
        (["--3d", "p.png", "--size", "100x99999999999"], "--size"),
        (["-o", "p.png", "--size", "400x20"], "legend"),
        (["--3d", "p.png", "--elevation", "91"], "elevation"),
        (["--3d", "p.png", "--azimuth", "nan"], "azimuth"),
        (["--3d", "p.png", "--camera", "c.json", "--view", "left"], "--camera"),
        (["--3d", "p.png", "--camera", "missing.json"], "missing.json"),
        (["--3d", "p.png", "--save-camera", "c.txt"], ".json"),
        (["-o", "p.png", "--3d", "p.png"], "written over"),
        (["--3d", "p.png", "--turntable", "p.png"], ".mp4 or .gif"),
        (["--3d", "p.png", "--camera", "case/labels.nrrd"], "JSON"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    tmp_path: Path,
    case: tuple[str, str],
    options: list[str],
    says: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["render", *case, *options]) == 2
    (line,) = (line for line in capsys.readouterr().err.splitlines() if line.startswith("error:"))
    assert says in line
    assert [path.name for path in tmp_path.iterdir()] == ["case"]


def test_the_segment_that_the_annotations_lack_is_named(
    tmp_path: Path, case: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    points = tmp_path / "clicks.json"
    points.write_text('{"coordinate_system": "IJK", "classes": [{"name": "liver", "positive": [[15, 10, 20]]}]}')
    assert main(["render", *case, "-o", str(tmp_path / "p.png"), "--annotations", str(points)]) == 2
    assert f"no class for the segment '1' of {case[1]}; it has liver." in capsys.readouterr().err


def test_points_outside_the_volume_are_refused_as_by_segment(
    tmp_path: Path, case: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    points = tmp_path / "clicks.json"
    classes = '[{"name": "1", "positive": [[15, 10, 200]]}, {"name": "2", "positive": [[32, 25, 20]]}]'
    points.write_text(f'{{"coordinate_system": "IJK", "classes": {classes}}}')
    assert main(["render", *case, "-o", str(tmp_path / "p.png"), "--annotations", str(points)]) == 2
    assert "1 of 1 points of class '1' lie outside the volume" in capsys.readouterr().err
    assert not (tmp_path / "p.png").exists()


@pytest.mark.parametrize("segments", [MOST_STRUCTURES, MOST_STRUCTURES + 1])
def test_more_segments_than_can_be_drawn_are_refused_with_advice_that_one_can_follow(
    opengl: None, tmp_path: Path, segments: int, capsys: pytest.CaptureFixture[str]
) -> None:
    # Of brightness like CT, where faint bones would be one more.
    scan = np.full((8, 8, 8), 50, dtype=np.int16)
    scan[0], scan[1] = -1000, 1000
    labels = np.zeros(scan.shape, dtype=np.int16)
    labels.flat[-segments:] = np.arange(1, segments + 1)
    # Of several voxels each: else it looks like a scan.
    scan, labels = scan.repeat(4, axis=2), labels.repeat(4, axis=2)
    for name, array in (("scan.nrrd", scan), ("labels.nrrd", labels)):
        sitk.WriteImage(sitk.GetImageFromArray(array), str(tmp_path / name))
    files = [str(tmp_path / name) for name in ("scan.nrrd", "labels.nrrd", "p.png")]
    fits = segments == MOST_STRUCTURES
    assert main(["render", *files[:2], "--3d", files[2], "--transparent"]) == (0 if fits else 2)
    told = f"{files[1]} has 208 segments inside the volume; a 3D picture shows up to 207. Save those you want to see as"
    assert (told in capsys.readouterr().err) is not fits


def test_the_background_of_a_picture_is_dark_unless_transparent(opengl: None, tmp_path: Path, case: tuple[str, str]) -> None:
    assert main(["render", *case, "--3d", str(tmp_path / "p.png"), "--size", "200x160"]) == 0
    np.testing.assert_allclose(read_png(tmp_path / "p.png")[-1, 0], np.array(BACKGROUND) * 255.0, atol=2)
