"""Text of a file."""

from rubberfric.base.atomic import LARGEST, StrPath, as_path, check_readable

# Bytes above ASCII that exports in Latin-1 have: ° µ ² ³ · and German vowels.
_LATIN = b"\xb0\xb5\xb2\xb3\xb7\xe4\xf6\xfc\xc4\xd6\xdc\xdf"


def read_text(path: StrPath, exports: bool = False) -> str:
    """Text of a file; ValueError in one line if it is missing, too large, no file at all or not UTF-8.

    `exports` says that UTF-16 and signs like ° and µ in Latin-1 will do as well.
    """
    check_readable(as_path(path), LARGEST)
    try:
        content = as_path(path).read_bytes()
        if exports and content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return content.decode("utf-16")
        if exports and set(content) - set(range(128)) <= set(_LATIN):
            return content.decode("latin-1")
        return content.decode("utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # not UTF-8
        raise ValueError(f"{path}: cannot be read as text: {error}") from None
