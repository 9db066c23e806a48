"""Headers that tell the browser what pages of this server may do."""

from __future__ import annotations

import base64
import hashlib
import re

from aiohttp import web

_INLINE_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)

_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    # The address has the token in it.
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}

_DEFAULTS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "Cache-Control": "private, no-cache",
}

_OF_DOWNLOADS = {"Content-Security-Policy": "default-src 'none'; frame-ancestors 'self'", "X-Frame-Options": "SAMEORIGIN"}
"""The page downloads through a frame, and WebKit, of which Safari is made, keeps no file that no frame may show."""


async def add_security_headers(request: web.Request, response: web.StreamResponse) -> None:
    """Complete a response's headers; aiohttp calls it before it sends one."""
    response.headers.update(_HEADERS)
    is_download = request.path.split("/")[2:3] == ["download"]
    for name, value in (_DEFAULTS | (_OF_DOWNLOADS if is_download else {})).items():
        response.headers.setdefault(name, value)


def page_policy(page: str, host: str) -> str:
    """The `Content-Security-Policy` of trame's page: nothing comes from elsewhere, and nothing goes there.

    Vue makes functions of templates in the browser, hence `unsafe-eval`: what users and files say must never be part of a
    template.

    Args:
        page: its HTML; the scripts that stand in it are allowed by their hashes.
        host: name and port of this server, as the browser calls it.
    """
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in _INLINE_SCRIPT.findall(page)]
    rules = {
        "default-src": "'none'",
        "script-src": " ".join(["'self'", "'unsafe-eval'", *(f"'sha256-{digest}'" for digest in hashes)]),
        "style-src": "'self' 'unsafe-inline'",
        "font-src": "'self' data:",
        "img-src": "'self' data: blob:",
        "media-src": "'self' blob:",
        "worker-src": "'self' blob:",
        # Not every browser takes websockets of the same server for 'self'.
        "connect-src": f"'self' ws://{host} wss://{host}",
        # Where files are downloaded to.
        "frame-src": "'self'",
        "base-uri": "'self'",
        "form-action": "'none'",
        "frame-ancestors": "'none'",
    }
    return "; ".join(f"{name} {value}" for name, value in rules.items())
