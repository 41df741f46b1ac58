"""Pages that need nothing but themselves: the policy by which a browser holds them to it.

Source: W3C, Content Security Policy Level 3.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable

__all__ = ["hash_source", "policy"]


def hash_source(text: str) -> str:
    """What a policy calls an element of the page that holds this text and no other."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def policy(*, scripts: Iterable[str], styles: Iterable[str], images: Iterable[str]) -> str:
    """What a page may do: run these scripts, use these styles, show these images, and nothing else.

    Each is the sources that are allowed, in the words of a policy: what hash_source gives, "data:", "'self'".
    Returns the content of the page's Content-Security-Policy; it is yet to be escaped.
    """
    return (
        f"default-src 'none'; script-src {' '.join(scripts)}; style-src {' '.join(styles)}; "
        f"img-src {' '.join(images)}; base-uri 'none'; form-action 'none'"
    )
