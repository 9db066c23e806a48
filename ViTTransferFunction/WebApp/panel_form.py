"""What the Slicer module's panel calls its settings, and how it explains them: its form is the one place that says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

FORM = Path(__file__).parents[1] / "Resources" / "UI" / "ViTTransferFunction.ui"


def panel_form() -> dict[str, dict[str, Any]]:
    """The words and ranges of the panel's widgets, by their names.

    Returns:
        Of each widget that explains itself: "label", which stands beside it, else what is written on it; "text", what is
        written on it; "special", what it shows for its lowest number; "value", the number that it begins with; and attributes
        of HTML: "about" says what it is, "range" which numbers it takes.
    """
    found = {widget.get("name", ""): _properties(widget) for widget in ElementTree.parse(FORM).iter("widget")}
    return {name: _words(name, found) for name, properties in found.items() if "toolTip" in properties}


def _properties(widget: ElementTree.Element) -> dict[str, str]:
    return {found.get("name", ""): "".join(found.itertext()).strip() for found in widget.findall("property")}


def _words(name: str, found: dict[str, dict[str, str]]) -> dict[str, Any]:
    properties = found[name]
    text = properties.get("text", properties.get("title", ""))
    label = found.get(f"{name}Label", {}).get("text", text).rstrip(":")
    ends = {"min": "minimum", "max": "maximum", "step": "singleStep"}
    return {
        "label": label,
        "text": text,
        "special": properties.get("specialValueText", ""),
        "about": {"title": properties["toolTip"], "aria-label": label},
        "value": float(properties.get("value", 0.0)),
        "range": {end: float(properties[named]) for end, named in ends.items() if named in properties},
    }
