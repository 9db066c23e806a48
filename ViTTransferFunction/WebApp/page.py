"""The page: `page.html`, a Vue template that trame fills with its state, beside its style and script.

No text of users or files becomes part of a template, since Vue makes functions of templates; it comes in by the state.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from trame.ui.html import DivLayout

from ..Logic.scene.annotation_tool import TOOL_ICONS
from ..Logic.scene.interface.choice_words import context_words, style_words
from ..Logic.scene.interface.choices import choices
from ..Logic.scene.interface.shortcuts import SHORTCUTS, TABLE_KEYS, WHILE_HELD, meanings
from ..Logic.session.preset_meanings import PRESET_MEANINGS
from .films import film_endings
from .panel_form import panel_form
from .slicer_views import VIEWS

TITLE = "ViT Transfer Function"

_STATIC = Path(__file__).parent / "static"
_ICONS = Path(__file__).parents[1] / "Resources" / "Icons"


def build_page(server: Any, contexts: list[str]) -> None:
    """Make the page of a server whose views are there; `contexts`: what can be shown around structures, by name."""
    server.enable_module({
        "serve": {"__vittf": str(_STATIC), "__vittf_icons": str(_ICONS)},
        "scripts": [f"__vittf/{name}.js" for name in ("requests", "connection", "page", "view_steps", "mouse", "touch")],
        "styles": ["__vittf/page.css"],
    })  # fmt: skip
    words, form, endings = meanings(), panel_form(), film_endings()
    keys = {shortcut.action: shortcut.key for shortcut in SHORTCUTS} | TABLE_KEYS
    server.state.update({
        "trame__title": TITLE,
        "trame__favicon": "__vittf_icons/ViTTransferFunction.svg",
        "keys": [
            {"key": key, "action": action, "meaning": words[action], "while_held": action in WHILE_HELD}
            for action, key in keys.items()
        ],
        "table_keys": list(TABLE_KEYS),
        "tips": {action: f"{words[action].capitalize()} ({key})" for action, key in keys.items()},
        "tools": [
            {"name": tool, "icon": icon, "text": form[f"{tool}Button"]["text"], "tip": f"{words[tool]} ({keys[tool]})"}
            for tool, icon in TOOL_ICONS.items()
        ],
        "form": form,
        "choices": choices(),
        "preset_meanings": PRESET_MEANINGS,
        "styles": [{"name": name, "text": text} for name, text in style_words().items()],
        "contexts": [{"name": name, "text": context_words().get(name, name)} for name in contexts],
        "windows": [],
        "views": list(VIEWS),
        "view_names": VIEWS,
        "enlarged": "",
        # What is being typed in a field: each change of the state fills all fields anew. An end of a window is among these as
        # soon as it has the keyboard: the answer to the other end may write it with other digits, which typing would append to.
        "typing": {},
        # What is being sent, or was dropped, ends with the page, which may be loaded again in the midst of it.
        "sent": None,
        "dragging": False,
        "asking_dropped": False,
        "trame__client_only": [*server.state.trame__client_only, "typing", "sent", "dragging", "asking_dropped"],
        "advanced_open": False,
        "appearance_open": False,
        "picture_width": int(form["pictureWidthSpinBox"]["value"]),
        "picture_height": int(form["pictureHeightSpinBox"]["value"]),
        "picture_transparent": False,
        "film_seconds": form["filmSecondsSpinBox"]["value"],
        "film_endings": endings,
        "film_ending": endings[0],
        "deleting": "",
        "asking_open": False,
        "asking_help": False,
        "path": "",
    })  # fmt: skip
    with DivLayout(server) as layout:
        layout.root.add_child((_STATIC / "page.html").read_text(encoding="utf-8"))
