"""Bytes of a text file turned into text, whatever program wrote them."""

from __future__ import annotations

from collections.abc import Iterator

from rsmkit.errors import RsmkitError

__all__ = ["USUAL", "decoded", "readings"]

USUAL = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252")
"""Encodings that nobody needs to be told of."""
_HEAD = 4096
"""Bytes that are looked at for what they are."""
_MARKS = ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"), (b"\xef\xbb\xbf", "utf-8-sig"))
_SINGLE = ("cp1250", "cp1251", "cp1253", "cp1254", "cp1255", "cp1256", "cp1257", "cp1258", "cp874")
_OTHERS = (*_SINGLE, "cp932", "gbk", "cp949", "cp950")
"""Windows code pages, those of single bytes first."""


def decoded(data: bytes, source: str) -> str:
    """Turn bytes into text: by their byte-order mark, else as UTF-8, else as Windows-1252.

    Raises
    ------
    RsmkitError
        If they are none of these.
    """
    encoding, text = next(readings(data), ("", ""))
    if encoding not in USUAL:
        raise RsmkitError(f"{source}: is not UTF-8 text; save it as CSV UTF-8")
    return text


def readings(data: bytes) -> Iterator[tuple[str, str]]:
    """Every encoding that the bytes may be in, the likeliest first, with the text they then are."""
    marked = [encoding for mark, encoding in _MARKS if data.startswith(mark)]
    head = data[:_HEAD]
    if not marked and b"\0" in head:  # half of every plain letter, separator and line end in UTF-16
        marked = ["utf-16-be" if head[::2].count(0) > head[1::2].count(0) else "utf-16-le"]
    for encoding in marked or ("utf-8", "cp1252", *_OTHERS):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        yield encoding, text
        if encoding not in ("cp1252", *_OTHERS):
            return
