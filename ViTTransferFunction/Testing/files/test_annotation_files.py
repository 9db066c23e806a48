"""Annotations and the files that hold them."""

from __future__ import annotations

import json
import os
import re
import unicodedata
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.classes.annotated_class import AnnotatedClass
from ViTTransferFunction.Logic.core.classes.class_request import ClassRequest, check_inside
from ViTTransferFunction.Logic.core.classes.close_up import CloseUp
from ViTTransferFunction.Logic.core.classes.diameter_points import points_of_diameter
from ViTTransferFunction.Logic.core.classes.iso_proposals import LARGEST_SIZE, SMALLEST_SIZE
from ViTTransferFunction.Logic.core.classes.region_points import points_of_outline
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.given_numbers import FARTHEST
from ViTTransferFunction.Logic.core.volumes.geometry import Geometry
from ViTTransferFunction.Logic.core.volumes.thumbnail import Thumbnail
from ViTTransferFunction.Logic.files.annotation_files import (
    classes_from_markups,
    read_annotations,
    read_markups,
    write_annotations,
)

GEOMETRY = Geometry((20, 30, 40), np.array([[0.0, -2.0, 0, 50], [3.0, 0, 0, -7], [0, 0, 4.0, 10], [0, 0, 0, 1.0]]))
POINTS_IJK = np.array([[3.0, 4.0, 5.0], [10.5, 20.25, 15.0]])
POINTS_RAS = GEOMETRY.ijk_to_ras_points(POINTS_IJK)
BOX: dict[str, Any] = {"center": [1, 2, 3], "size_mm": [30, 20, 25.5]}


def write(path: Path, content: Any) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


coordinates = st.floats(-FARTHEST, FARTHEST).map(lambda value: value + 0.0)  # No negative zero: reading makes it a zero.
shares = st.floats(0.0, 1.0)


def points_of(least: int) -> st.SearchStrategy[np.ndarray]:
    return st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=least, max_size=4).map(
        lambda points: np.array(points, dtype=np.float64).reshape(-1, 3)
    )


edges_mm = st.floats(0.0, FARTHEST, exclude_min=True, exclude_max=True)
centres_mm = coordinates.filter(lambda value: abs(value) < FARTHEST)
close_ups = st.builds(CloseUp, st.tuples(centres_mm, centres_mm, centres_mm), st.tuples(edges_mm, edges_mm, edges_mm))
names = st.text(
    st.characters(exclude_categories=("Cc", "Cs"), exclude_characters="\ufffe\uffff"), min_size=1, max_size=20
).filter(lambda name: any(not one.isspace() and unicodedata.category(one) != "Cf" for one in name))
thresholds: st.SearchStrategy[dict[str, Any]] = st.one_of(
    st.fixed_dictionaries({"iso": shares}), st.fixed_dictionaries({"size": st.floats(SMALLEST_SIZE, LARGEST_SIZE)})
)


@st.composite
def annotated_classes(draw: st.DrawFn) -> AnnotatedClass:
    """Any class that has either a threshold or a size, and either a box or the wish for one."""
    from_map = draw(st.booleans())
    request = ClassRequest(
        draw(names),
        draw(points_of(least=1)),
        draw(points_of(least=0)),
        proximity=draw(shares),
        refine=draw(st.booleans()),
        close_up=None if from_map else draw(st.none() | close_ups),
        **draw(thresholds),
    )
    return AnnotatedClass(request, draw(st.tuples(shares, shares, shares)), draw(shares), close_up_from_map=from_map)


@given(st.lists(annotated_classes(), max_size=3))
def test_what_is_written_and_read_again_is_equal(
    tmp_path_factory: pytest.TempPathFactory, classes: list[AnnotatedClass]
) -> None:
    path = tmp_path_factory.mktemp("written") / "scan.annotations.json"
    write_annotations(classes, path)
    assert read_annotations(path, GEOMETRY) == classes


def test_what_is_written_says_only_what_was_decided_a_class_a_line(tmp_path: Path) -> None:
    request = ClassRequest("3f", np.array([[1.0, 2.0, 3.5]]), iso=0.5, size=1.0, name="Leber – groß")
    write_annotations([AnnotatedClass(request, (1.0, 0.0, 0.5))], tmp_path / "a.json")
    assert (tmp_path / "a.json").read_text(encoding="utf-8").splitlines() == [
        '{"coordinate_system": "RAS",',
        ' "classes": [',
        '  {"name": "Leber – groß", "color": [1.0, 0.0, 0.5], "positive": [[1.0, 2.0, 3.5]], "negative": [], "iso": 0.5}]}',
    ]


def test_what_points_were_placed_on_is_written_for_the_whole_file_and_read_again(tmp_path: Path) -> None:
    arrays = np.random.default_rng(0).normal(size=(2, *GEOMETRY.shape))
    placed_on = Thumbnail.of(arrays[0], GEOMETRY)
    annotated = AnnotatedClass(ClassRequest("liver", POINTS_RAS), (1.0, 0.0, 0.0), placed_on=placed_on)
    write_annotations([annotated, replace(annotated, request=ClassRequest("spleen", POINTS_RAS))], tmp_path / "a.json")
    content = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert list(content) == ["coordinate_system", "classes", "placed_on"]
    for read in read_annotations(tmp_path / "a.json", GEOMETRY):
        assert read.placed_on is not None
        assert [read.placed_on.may_be_of(array, GEOMETRY) for array in arrays] == [True, False]


@pytest.mark.parametrize("placed_on", ["garbled", 3, None, ["x"]])
def test_what_points_were_placed_on_is_passed_over_where_it_says_nothing(tmp_path: Path, placed_on: Any) -> None:
    (annotated,) = read_annotations(write(tmp_path / "a.json", one_class() | {"placed_on": placed_on}), GEOMETRY)
    assert annotated.placed_on is None


def one_class(**fields: Any) -> dict[str, Any]:
    return {"coordinate_system": "RAS", "classes": [{"name": "liver", "positive": POINTS_RAS.tolist(), **fields}]}


def test_ras_lps_and_ijk_points_agree(tmp_path: Path) -> None:
    systems = {"RAS": POINTS_RAS, "LPS": POINTS_RAS * [-1, -1, 1], "IJK": POINTS_IJK}
    for system, points in systems.items():
        content = {"coordinate_system": system, "classes": [{"name": "a", "positive": points.tolist()}]}
        (annotated,) = read_annotations(write(tmp_path / f"{system}.json", content), GEOMETRY)
        np.testing.assert_allclose(annotated.request.positive, POINTS_RAS)


def test_every_field_of_a_class_is_read(tmp_path: Path) -> None:
    fields = {"color": "#ff8000", "opacity": 0.5, "iso": 0.4, "proximity": 0.2, "refine": False, "negative": [[0, 0, 0]]}
    (annotated,) = read_annotations(write(tmp_path / "a.json", one_class(**fields)), GEOMETRY)
    assert annotated.color == pytest.approx((1.0, 128 / 255, 0.0))
    request = annotated.request
    assert (annotated.opacity, request.iso, request.proximity, request.refine) == (0.5, 0.4, 0.2, False)
    np.testing.assert_array_equal(request.negative, [[0, 0, 0]])


@pytest.mark.parametrize(("given", "size"), [("smaller", -1.0), ("larger", 1.0), (-2.5, -2.5), (2, 2.0), (None, 0.0)])
def test_a_size_is_a_name_or_a_number(tmp_path: Path, given: Any, size: float) -> None:
    (annotated,) = read_annotations(write(tmp_path / "a.json", one_class(size=given)), GEOMETRY)
    assert annotated.request.size == size


def test_the_centre_of_a_close_up_is_a_position_as_points_are_and_its_size_is_along_the_volumes_axes(tmp_path: Path) -> None:
    systems = {"RAS": POINTS_RAS, "LPS": POINTS_RAS * [-1, -1, 1], "IJK": POINTS_IJK}
    for system, points in systems.items():
        close_up = {"center": points[1].tolist(), "size_mm": [12, 30.5, 20]}
        content = {**one_class(close_up=close_up), "coordinate_system": system}
        (annotated,) = read_annotations(write(tmp_path / f"{system}.json", content), GEOMETRY)
        assert annotated.request.close_up is not None
        assert annotated.request.close_up.centre_ras == pytest.approx(POINTS_RAS[1])
        assert annotated.request.close_up.size_mm == (12.0, 30.5, 20.0)
        assert not annotated.close_up_from_map


@pytest.mark.parametrize(("given", "chosen"), [(True, True), (False, False), (None, False)])
def test_a_close_up_without_a_box_is_to_be_chosen_or_there_is_none(tmp_path: Path, given: Any, chosen: bool) -> None:
    (annotated,) = read_annotations(write(tmp_path / "a.json", one_class(close_up=given)), GEOMETRY)
    assert (annotated.request.close_up, annotated.close_up_from_map) == (None, chosen)


def test_only_name_and_positive_points_are_required(tmp_path: Path) -> None:
    (annotated,) = read_annotations(write(tmp_path / "a.json", one_class(iso=None)), GEOMETRY)
    request = annotated.request
    assert (annotated.opacity, request.iso, request.proximity, request.refine) == (1.0, None, 0.0, True)
    assert len(request.negative) == 0
    assert (request.close_up, annotated.close_up_from_map) == (None, False)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "not an annotation file"),
        ({"classes": [{"name": "a", "positive": [[0, 0, 0]]}]}, "'coordinate_system' is missing; expected"),
        ({"coordinate_system": "XYZ", "classes": []}, "'coordinate_system' is 'XYZ'"),
        (one_class(positive=[]), "'liver' has no positive points"),
        (one_class(positive=[[1, 2]]), r"not a list of finite.*got \[\[1, 2\]\]"),
        (one_class(positive=[[1, 2, float("nan")]]), "not a list of finite"),
        (one_class(positive="here"), "not a list of finite"),
        (one_class(positive=3), "not a list of finite"),
        (one_class(color="red"), "color of class 'liver' is 'red'"),
        (one_class(color="#gggggg"), "color of class 'liver'"),
        (one_class(color=[0, 0, 255]), "color of class 'liver'"),
        (one_class(color=[0, 0, 1.01]), "color of class 'liver'"),
        (one_class(color=["1", 0, 0]), "color of class 'liver'"),
        (one_class(color=[True, 0, 0]), "color of class 'liver'"),
        (one_class(opacity=1.5), "'opacity' of class 'liver' is 1.5"),
        (one_class(iso=-0.1), "'iso' of class 'liver'"),
        (one_class(size="large"), "size of class 'liver' is 'large'; expected 'smaller' or 'larger', or a number from -3 to 3"),
        (one_class(size=4), "'size' of class 'liver' is 4; expected a number from -3 to 3"),
        (one_class(size=True), "'size' of class 'liver' is True"),
        (one_class(size=[1]), "'size' of class 'liver'"),
        (one_class(size="larger", iso=0.2), "'liver' has an 'iso' and a 'size'"),
        (one_class(proximity="near"), "'proximity' of class 'liver'"),
        (one_class(refine="yes"), "'refine' of class 'liver'"),
        (one_class(close_up="yes"), "'close_up' of class 'liver' is 'yes'; expected true, for a box that is chosen from the"),
        (one_class(close_up=1), "'close_up' of class 'liver' is 1"),
        (one_class(close_up=[1, 2, 3]), "'close_up' of class 'liver'"),
        (one_class(close_up={}), "'close_up' of class 'liver' is {}"),
        (one_class(close_up={"center": [1, 2, 3]}), "'close_up' of class 'liver'"),
        (one_class(close_up={**BOX, "margin": 1}), "'close_up' of class 'liver'"),
        (one_class(close_up={"centre": [1, 2, 3], "size_mm": [1, 2, 3]}), "'close_up' of class 'liver'"),
        (
            one_class(close_up={**BOX, "center": [1, 2]}),
            "'center' of the close-up of class 'liver' is \\[1, 2\\]; expected three",
        ),
        (one_class(close_up={**BOX, "center": [1, 2, "3"]}), "'center' of the close-up of class 'liver'"),
        (one_class(close_up={**BOX, "center": [1, 2, float("nan")]}), "'center' of the close-up of class 'liver'"),
        (one_class(close_up={**BOX, "center": [1, 2, 10**400]}), "'center' of the close-up of class 'liver'"),
        (
            one_class(close_up={**BOX, "size_mm": 30}),
            "'size_mm' of the close-up of class 'liver' is 30; expected three numbers ab",
        ),
        (one_class(close_up={**BOX, "size_mm": [30, 0, 30]}), "'size_mm' of the close-up of class 'liver'"),
        (one_class(close_up={**BOX, "size_mm": [30, -1, 30]}), "'size_mm' of the close-up of class 'liver'"),
        (one_class(close_up={**BOX, "size_mm": [30, True, 30]}), "'size_mm' of the close-up of class 'liver'"),
        (one_class(close_up={**BOX, "size_mm": [30, 1e300, 30]}), "'size_mm' of the close-up of class 'liver'"),
        (one_class(colour="red"), "class 1 has an unknown field 'colour'"),
        (one_class(name=" "), "empty name"),
        (one_class(name="\u200b\u2066\ufeff"), "empty name"),
        (one_class(name=7), "class 1 has no name"),
        (one_class(positive=[[1, 2, 3], [1, 2]]), "not a list of finite"),
        (one_class(positive=[[1, 2, 3], 4]), "not a list of finite"),
        (one_class(positive=[[1, 2, [3]]]), "not a list of finite"),
        (one_class(positive=[["1", "2", "3"]]), "not a list of finite"),
        (one_class(positive=[[True, 2, 3]]), "not a list of finite"),
        (one_class(positive=[[None, 2, 3]]), "not a list of finite"),
        (one_class(positive=[[10**400, 2, 3]]), "not a list of finite"),
        (one_class(positive=[[1e300, 2, 3]]), "not a list of finite"),
        (one_class(positive={}), "not a list of finite"),
        (one_class(positive=[{}]), "not a list of finite"),
        (one_class(negative=[[[1, 2, 3]]]), "not a list of finite"),
        (one_class(iso=10**400), "'iso' of class 'liver' is 1000"),
        (one_class(iso=[0.5]), "'iso' of class 'liver'"),
        (one_class(size=10**400), "'size' of class 'liver' is 1000"),
        (one_class(size=float("nan")), "'size' of class 'liver' is nan"),
        (one_class(size={}), "'size' of class 'liver'"),
        (one_class(color=[10**400, 0, 0]), "color of class 'liver'"),
        (one_class(color={"red": 1}), "color of class 'liver'"),
        (one_class(opacity="1"), "'opacity' of class 'liver'"),
        (one_class(name=["liver"]), "class 1 has no name"),
        (one_class(name="a\uffff"), r"class 'a\\uffff' holds characters that cannot be written"),
        (one_class(name="\ud800"), r"class '\\ud800' holds characters that cannot be written"),
        (one_class(name="liver\nSegment1_Name:=x"), "holds characters that cannot be written"),
        (one_class(**{"\ud800": 1}), "unknown field"),
        ({"coordinate_system": ["RAS"], "classes": []}, "'coordinate_system' is \\['RAS'\\]"),
        ({"coordinate_system": {}, "classes": []}, "'coordinate_system' is {}"),
        ({"coordinate_system": "RAS", "classes": {"name": "a"}}, "not an annotation file"),
        ({"coordinate_system": "RAS", "classes": [[]]}, "not an annotation file"),
        (None, "not an annotation file"),
        ("RAS", "not an annotation file"),
    ],
)
def test_an_unusable_annotation_file_is_refused_with_what_is_wrong(tmp_path: Path, content: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_annotations(write(tmp_path / "a.json", content), GEOMETRY)


def test_broken_json_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(InputError, match="not valid JSON"):
        read_annotations(tmp_path / "broken.json", GEOMETRY)
    with pytest.raises(InputError, match="There is no file"):
        read_annotations(tmp_path / "missing.json", GEOMETRY)


def test_an_annotation_file_in_place_of_a_point_list_is_told_where_it_goes(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"takes it by --annotations a\.json"):
        read_markups(write(tmp_path / "a.json", {"coordinate_system": "RAS", "classes": []}), GEOMETRY)


def test_an_image_in_place_of_points_is_called_one(tmp_path: Path) -> None:
    for name in ("scan.nii.gz", "scan.NRRD"):
        (tmp_path / name).write_bytes(b"\x1f\x8b")
        with pytest.raises(InputError, match="is an image, by its ending; expected a file of JSON"):
            read_annotations(tmp_path / name, GEOMETRY)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "is empty; expected JSON. Save it again"),
        (b"\xef\xbb\xbf \r\n", "is empty"),
        (b"R,A,S\r\n1,2,3\r\n", "not valid JSON: Expecting value.* save the list as .mrk.json"),
        (b'{"classes": ', "not valid JSON: Expecting value.*. Correct it there"),
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a":' * 100_000, "nested too deeply"),
        (b'{"classes": ' + b"9" * 5000 + b"}", "not valid JSON: it holds a number of thousands of digits. Correct"),
        (b"\xff\xfe{\x00}\x00", "not a text in UTF-8, .*. Save it as UTF-8"),
        (b"\x00", "not valid JSON"),
        (b'{"classes": [], "classes": []}', "'classes' stands twice"),
        (
            b'{"coordinate_system": "RAS", "classes": [{"name": "a", "positive": [[1, 2, 3]], "positive": []}]}',
            "'positive' stands",
        ),
        (b'{"coordinate_system": "RAS", "classes": [{"name": "a", "positive": [[1e400, 2, 3]]}]}', "not a list of finite"),
    ],
)
@pytest.mark.parametrize(("read", "about"), [(read_annotations, GEOMETRY), (read_markups, 1.0)])
def test_text_that_holds_no_annotations_is_refused_in_a_short_sentence(
    tmp_path: Path, text: bytes, message: str, read: Callable[[Path, Any], Any], about: Any
) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(text)
    with pytest.raises(InputError) as refused:
        read(path, about)
    assert re.search(message, str(refused.value)) or read is read_markups
    assert len(str(refused.value)) < 300 + len(str(path))


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(one_class()).encode())
    assert read_annotations(path, GEOMETRY)[0].name == "liver"


@pytest.mark.parametrize("name", ["folder", "x" * 300, "a\0b"])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match=r"is a folder|Cannot open|is too long a path|is no path"):
        read_annotations(tmp_path / name, GEOMETRY)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes among its files")
def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(InputError, match="is a pipe"):
        read_annotations(tmp_path / "fifo", GEOMETRY)


def test_names_of_all_scripts_are_kept(tmp_path: Path) -> None:
    (annotated,) = read_annotations(write(tmp_path / "a.json", one_class(name="肝臓 🫀 Ü")), GEOMETRY)
    assert annotated.name == "肝臓 🫀 Ü"


def markups(points: list[dict[str, Any]], **fields: Any) -> dict[str, Any]:
    return {"@schema": "…", "markups": [{"type": "Fiducial", "controlPoints": points, **fields}]}


def test_slicer_point_lists_give_their_placed_points_in_ras(tmp_path: Path) -> None:
    points = [
        {"position": [-1.0, -2.0, 3.0], "positionStatus": "defined"},
        {"position": [9.0, 9.0, 9.0], "positionStatus": "undefined"},
        {"position": [9.0, 9.0, 9.0], "positionStatus": "preview"},
    ]
    lps = write(tmp_path / "lps.mrk.json", markups(points, coordinateSystem="LPS"))
    np.testing.assert_array_equal(read_markups(lps, GEOMETRY)[0], [[1.0, 2.0, 3.0]])
    ras = write(tmp_path / "ras.mrk.json", markups([{"position": [1.0, 2.0, 3.0]}], coordinateSystem="RAS"))
    np.testing.assert_array_equal(read_markups(ras, GEOMETRY)[0], [[1.0, 2.0, 3.0]])


def test_classes_from_point_lists_join_polarities_by_name(tmp_path: Path) -> None:
    path = write(tmp_path / "l.mrk.json", markups([{"position": [1.0, 2.0, 3.0]}], coordinateSystem="RAS"))
    first, second = classes_from_markups({"liver": path, "spleen": path}, {"spleen": path}, GEOMETRY)
    assert (first.name, len(first.request.negative)) == ("liver", 0)
    assert (second.name, len(second.request.negative)) == ("spleen", 1)
    assert first.color != second.color
    with pytest.raises(InputError, match="negative points for 'kidney'"):
        classes_from_markups({"liver": path}, {"kidney": path}, GEOMETRY)


def line(tmp_path: Path, *ends_ras: np.ndarray) -> Path:
    points = [{"position": end.tolist()} for end in ends_ras]
    return write(tmp_path / "line.mrk.json", markups(points, coordinateSystem="RAS", type="Line"))


def test_a_line_that_was_measured_with_is_a_diameter(tmp_path: Path) -> None:
    ends = GEOMETRY.ijk_to_ras_points(np.array([[10.0, 15.0, 10.0], [30.0, 15.0, 10.0]]))
    (found,) = classes_from_markups({"lesion": line(tmp_path, *ends)}, {}, GEOMETRY)
    inside, outside = points_of_diameter(ends, 1.0)
    np.testing.assert_allclose(found.request.positive, inside)
    np.testing.assert_allclose(found.request.negative, outside)


def test_what_lies_beyond_a_line_and_the_volume_is_left_out(tmp_path: Path) -> None:
    ends = GEOMETRY.ijk_to_ras_points(np.array([[0.0, 15.0, 10.0], [20.0, 15.0, 10.0]]))
    (found,) = classes_from_markups({"lesion": line(tmp_path, *ends)}, {}, GEOMETRY)
    np.testing.assert_allclose(GEOMETRY.ras_to_ijk(found.request.negative), [[24.0, 15.0, 10.0]])


def test_half_a_line_and_a_line_off_a_structure_are_refused(tmp_path: Path) -> None:
    ends = GEOMETRY.ijk_to_ras_points(np.array([[10.0, 15.0, 10.0], [30.0, 15.0, 10.0]]))
    with pytest.raises(InputError, match=r"line\.mrk\.json holds a line with 1 of its ends placed; expected 2\."):
        read_markups(line(tmp_path, ends[0]), GEOMETRY)
    with pytest.raises(InputError, match=r"line\.mrk\.json: The diameter is 0 mm long"):
        read_markups(line(tmp_path, ends[0], ends[0]), GEOMETRY)
    path = line(tmp_path, *ends)
    with pytest.raises(InputError, match=r"holds a line or a closed curve, .* Give it by --positive"):
        classes_from_markups({"lesion": path}, {"lesion": path}, GEOMETRY)


def test_a_line_off_a_structure_is_refused_as_such_in_small_specimens_too(tmp_path: Path) -> None:
    specimen = Geometry(GEOMETRY.shape, np.diag([0.005, 0.005, 0.005, 1.0]) @ GEOMETRY.ijk_to_ras)
    path = line(tmp_path, *specimen.ijk_to_ras_points(np.array([[10.0, 15.0, 10.0], [30.0, 15.0, 10.0]])))
    with pytest.raises(InputError, match="holds a line or a closed curve"):
        classes_from_markups({"lesion": path}, {"lesion": path}, specimen)


def curve(tmp_path: Path, radius: float, count: int, middle_i: float = 20.0) -> tuple[Path, np.ndarray]:
    """A circle in a slice, and so many points on it in a file."""
    angles = np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)
    circle = np.stack([middle_i + radius * np.cos(angles), 16.0 + radius * np.sin(angles), np.full(120, 10.0)], axis=1)
    points = GEOMETRY.ijk_to_ras_points(circle[:: 120 // count])
    content = markups([{"position": point.tolist()} for point in points], coordinateSystem="RAS", type="ClosedCurve")
    return write(tmp_path / "curve.mrk.json", content), GEOMETRY.ijk_to_ras_points(circle)


def test_a_closed_curve_around_a_structure_is_its_outline(tmp_path: Path) -> None:
    path, circle = curve(tmp_path, 8.0, 6)
    (found,) = classes_from_markups({"lesion": path}, {}, GEOMETRY)
    inside, outside = points_of_outline(circle, 1.0)
    middle = circle.mean(axis=0)
    assert found.outline_ras is not None
    np.testing.assert_allclose(found.outline_ras[::10], circle[::20])
    for points, expected in ((found.request.positive, inside), (found.request.negative, outside)):
        assert len(points) == len(expected)
        # Between its few control points the curve bulges as a circle does.
        far = [np.linalg.norm(each - middle, axis=1).max() for each in (points, expected)]
        assert far[0] == pytest.approx(far[1], rel=0.02)


def test_what_is_drawn_around_a_structure_that_the_volume_cuts_counts_as_far_as_the_volume_goes(tmp_path: Path) -> None:
    path, circle = curve(tmp_path, 8.0, 6, middle_i=0.0)
    (found,) = classes_from_markups({"lesion": path}, {}, GEOMETRY)
    inside, _ = points_of_outline(circle, 1.0)
    assert 0 < len(found.request.positive) < len(inside)
    check_inside([found.request], GEOMETRY)
    ends = GEOMETRY.ijk_to_ras_points(np.array([[-8.0, 15.0, 10.0], [12.0, 15.0, 10.0]]))
    (found,) = classes_from_markups({"lesion": line(tmp_path, *ends)}, {}, GEOMETRY)
    check_inside([found.request], GEOMETRY)


def test_what_is_drawn_on_another_volume_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"curve\.mrk\.json: No part of the curve lies in the volume\."):
        classes_from_markups({"lesion": curve(tmp_path, 8.0, 6, middle_i=-100.0)[0]}, {}, GEOMETRY)


def test_several_markups_in_one_file_are_taken_together_and_then_none_is_the_outline(tmp_path: Path) -> None:
    curve_path, _ = curve(tmp_path, 8.0, 6)
    line_path = line(tmp_path, *GEOMETRY.ijk_to_ras_points(np.array([[10.0, 15.0, 5.0], [30.0, 15.0, 5.0]])))
    list_path = write(tmp_path / "list.mrk.json", markups([{"position": [1.0, 2.0, 3.0]}], coordinateSystem="RAS"))
    paths = (list_path, line_path, curve_path)
    alone = [read_markups(path, GEOMETRY) for path in paths]
    together: list[Any] = [json.loads(path.read_text(encoding="utf-8"))["markups"][0] for path in paths]
    found = read_markups(write(tmp_path / "all.mrk.json", {"markups": together}), GEOMETRY)
    np.testing.assert_array_equal(found.inside, np.concatenate([each.inside for each in alone]))
    np.testing.assert_array_equal(found.outside, np.concatenate([each.outside for each in alone]))
    assert [each.outline is None for each in (*alone, found)] == [True, True, False, True]


def test_a_curve_of_two_points_and_one_off_a_structure_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"curve\.mrk\.json holds a closed curve with 2 points placed; expected 3 or more\."):
        read_markups(curve(tmp_path, 8.0, 2)[0], GEOMETRY)
    path, _ = curve(tmp_path, 8.0, 6)
    with pytest.raises(InputError, match=r"holds a line or a closed curve, .* Give it by --positive"):
        classes_from_markups({"lesion": path}, {"lesion": path}, GEOMETRY)


@pytest.mark.parametrize("kind", ["Fiducial", "Curve", "ROI"])
def test_what_encloses_a_structure_is_not_taken_for_points_on_it(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path / "l.mrk.json", markups([{"position": [-1.0, -2.0, 3.0]}], type=kind))
    if kind in ("Fiducial", "Curve"):
        np.testing.assert_array_equal(read_markups(path, GEOMETRY)[0], [[1.0, 2.0, 3.0]])
    else:
        with pytest.raises(InputError, match=f"markups of the type {kind}, .* expected a point list, a line"):
            read_markups(path, GEOMETRY)


@pytest.mark.parametrize(
    "content",
    [
        {},
        [],
        None,
        {"markups": 3},
        {"markups": [{}]},
        {"markups": ["controlPoints"]},
        markups([{}]),
        markups([[]]),  # type: ignore[list-item]
        markups([{"position": [1]}]),
        markups([{"position": [1, 2, 3]}, {"position": [1, 2]}]),
        markups([{"position": [1, 2, 3, 4, 5, 6]}]),
        markups([{"position": [10**400, 2, 3]}]),
        markups([{"position": [float("nan"), 2, 3]}]),
        markups([{"position": "123"}]),
        markups([{"position": {"x": 1}}]),
        markups([{"position": [1, 2, 3]}], coordinateSystem=["LPS"]),
        {"markups": [{"controlPoints": 3}]},
    ],
)
def test_what_is_no_point_list_is_refused(tmp_path: Path, content: Any) -> None:
    with pytest.raises(InputError, match=r"not a Slicer markups file|not a list of finite|unknown coordinate system"):
        read_markups(write(tmp_path / "l.mrk.json", content), GEOMETRY)


def test_a_point_list_in_place_of_annotations_is_told_where_it_goes(tmp_path: Path) -> None:
    path = write(tmp_path / "l.mrk.json", markups([{"position": [1, 2, 3]}]))
    with pytest.raises(InputError, match=r"takes them by --positive NAME=l\.mrk\.json\. .*Points inside from a markup"):
        read_annotations(path, GEOMETRY)


def test_a_point_list_of_an_older_slicer_is_told_how_to_become_one_of_today(tmp_path: Path) -> None:
    (tmp_path / "F.fcsv").write_text("# Markups fiducial file version = 4.11\n")
    with pytest.raises(InputError, match=r"save it as \.mrk\.json"):
        read_markups(tmp_path / "F.fcsv", GEOMETRY)
    with pytest.raises(InputError, match=r"save it as \.mrk\.json, which `vittf segment` takes by --positive"):
        read_annotations(tmp_path / "F.fcsv", GEOMETRY)


@pytest.mark.parametrize("units", ["mm", ["mm", "UCUM", "millimeter"], "", None])
def test_a_point_list_in_millimetres_is_read_however_it_says_so(tmp_path: Path, units: Any) -> None:
    points = markups([{"position": [-1.0, -2.0, 3.0]}], coordinateUnits=units)
    np.testing.assert_array_equal(read_markups(write(tmp_path / "l.mrk.json", points), GEOMETRY)[0], [[1.0, 2.0, 3.0]])


@pytest.mark.parametrize("units", ["um", ["um", "UCUM", "micrometer"], "cm", 5])
def test_a_point_list_in_another_unit_is_refused(tmp_path: Path, units: Any) -> None:
    path = write(tmp_path / "l.mrk.json", markups([{"position": [1.0, 2.0, 3.0]}], coordinateUnits=units))
    with pytest.raises(InputError, match=r"gives its positions in the unit .*; expected millimetres"):
        read_markups(path, GEOMETRY)
