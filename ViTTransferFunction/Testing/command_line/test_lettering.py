"""Letters of any alphabet in pictures: from a font of the system, or else numbers and a warning."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from ViTTransferFunction.CommandLine import lettering
from ViTTransferFunction.CommandLine.lettering import font_of, legible_names, text_coverage
from ViTTransferFunction.CommandLine.right_to_left import set_from_the_left


@pytest.fixture
def fonts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A computer with one font, which has Greek and Cyrillic letters and no Chinese ones."""
    folder = Path(mpl.get_data_path(), "fonts", "ttf")
    monkeypatch.setattr(lettering, "_font_folders", lambda: iter([folder]))
    forget()
    yield folder / "DejaVuSans.ttf"
    forget()


def forget() -> None:
    for remembered in (lettering.font_of, lettering._system_fonts, lettering._has):
        remembered.cache_clear()


def test_names_that_the_own_font_has_are_drawn_in_it(fonts: Path) -> None:
    assert [font_of(name) for name in ("liver", "Leber, größer", "Łęk Ő 2½ µm", "")] == ["", "", "", ""]


@pytest.mark.parametrize("name", ["Печень", "Ήπαρ", "liver → 2"])
def test_other_letters_are_drawn_in_a_font_of_the_system(fonts: Path, name: str) -> None:
    assert font_of(name) == str(fonts)
    assert legible_names([name]) == [name]
    assert text_coverage(name, 20).max() > 0.9
    assert not np.array_equal(text_coverage(name, 20), text_coverage(name[::-1], 20))


@pytest.mark.parametrize("name", ["كبد", "כבד", "کبد", "liver (כבד)", "الأورطى 2"])
def test_what_is_written_from_the_right_is_drawn_as_it_is_read(fonts: Path, name: str) -> None:
    assert legible_names([name]) == [name]
    drawn = text_coverage(name, 40)
    np.testing.assert_array_equal(drawn, lettering._coverage(set_from_the_left(name), 40, str(fonts)))
    assert not np.array_equal(drawn, lettering._coverage(name, 40, str(fonts)))


def test_a_letter_and_its_accent_may_be_apart(fonts: Path) -> None:
    np.testing.assert_array_equal(text_coverage("Mu\u0308ller", 20), text_coverage("Müller", 20))


@pytest.mark.parametrize("name", ["肝臓", "간", "liver 肝", "ܟܒܕܐ", "כָּבֵד", "كَبِد"])
def test_a_name_that_cannot_be_drawn_is_its_number_and_that_is_told(
    fonts: Path, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    assert legible_names(["liver", name]) == ["liver", "No. 2"]
    assert f"in the picture, No. 2 is {name}." in caplog.text


def test_names_are_text_also_where_vtk_has_matplotlib_for_mathematics(fonts: Path) -> None:
    pytest.importorskip("vtkmodules.vtkRenderingMatplotlib")
    plain = text_coverage("a b", 20)
    assert text_coverage("$a b$", 20).shape[1] > plain.shape[1]
    assert font_of("肝") is None


def test_without_any_font_numbers_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lettering, "_font_folders", lambda: iter(()))
    forget()
    assert legible_names(["Печень", "liver"]) == ["No. 1", "liver"]
    forget()
