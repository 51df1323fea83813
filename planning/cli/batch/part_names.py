"""What the parts of a batch are called, and where each one's plan goes."""

import os
import unicodedata
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath

from planning.model.words import printable

# Kinds of characters (Unicode's) that end a line, work a terminal, or aren't text.
_UNSHOWN = {"Cc", "Cs", "Zl", "Zp"}
# Those that folders are called by: letters of all alphabets, their marks, numbers.
_WORDS, _ALSO = "LMN", "._-"
# For a name without any; and for one that a file of the batch itself has.
_NAMELESS = "part"
_OURS = {"batch.csv", "index.html"}
# Of a folder's name [bytes]: file systems take 255, and some of it is for others.
_LONGEST = 160


def one_line(text: str) -> str:
    """Return a text that a table or a terminal shows in one line."""
    return printable(text, lambda c: unicodedata.category(c) not in _UNSHOWN)


def told_apart(paths: Sequence[Path], names: Sequence[str]) -> tuple[str, ...]:
    """Return the names in one line each; those of one name with folders they are in.

    Args:
        paths: Where the files are.
        names: Likewise the last parts of their paths.
    """
    places = [Path(os.path.abspath(path)).parts[1:] for path in paths]
    lengths = [len(PurePosixPath(name).parts) for name in names]
    called = [one_line(name) for name in names]
    while True:
        often = Counter(called)
        longer = [
            n
            for n, name in enumerate(called)
            if often[name] > 1 and lengths[n] < len(places[n])
        ]
        if not longer:
            return tuple(_numbered(called))
        for n in longer:
            lengths[n] += 1
            called[n] = one_line("/".join(places[n][-lengths[n] :]))


def _numbered(names: Sequence[str]) -> Iterator[str]:
    taken: set[str] = set()
    for name in names:
        # In front: what a file is called ends in its format.
        one, again = name, 2
        while one in taken:
            one, again = f"{again}/{name}", again + 1
        taken.add(one)
        yield one


def called_before(
    paths: Sequence[Path], names: Sequence[str], known: Collection[str]
) -> tuple[str, ...]:
    """Return the names, with the folders that earlier runs called these files by.

    A file that is named by itself doesn't tell which folder it was a part of.
    """

    def before(path: Path, name: str) -> str:
        place = one_line(Path(os.path.abspath(path)).as_posix())
        longer = (
            k for k in known if k.endswith(f"/{name}") and place.endswith(f"/{k}")
        )
        return max(longer, key=len, default=name)

    called = [before(path, name) for path, name in zip(paths, names, strict=True)]
    often = Counter(called)
    return tuple(
        name if often[one] > 1 else one for one, name in zip(called, names, strict=True)
    )


def folders_of(
    names: Sequence[str], known: Mapping[str, str] | None = None
) -> tuple[str, ...]:
    """Return a folder for each name, none of which is or lies in another one's.

    Args:
        names: Of parts.
        known: By names those of earlier runs, which stay where none of these goes.
    """
    known = known or {}
    stems = [_folder(name) for name in names]
    often = Counter(map(_key, stems))
    # What holds folders of plans is none itself.
    taken = {_key(str(f)) for stem in stems for f in PurePosixPath(stem).parents}
    folders: list[str] = []
    for name, stem in zip(names, stems, strict=True):
        # Two files of one stem are told apart by what follows it.
        before, whole = known.get(name), _folder(name, whole=True)
        alone = before == stem or (often[_key(stem)] == 1 and before != whole)
        base = stem if alone and _key(stem) not in taken else whole
        folder, again = base, 2
        while _key(folder) in taken:
            folder, again = f"{base}-{again}", again + 1
        taken.add(_key(folder))
        folders.append(folder)
    return tuple(folders)


def _key(folder: str) -> str:
    # What some file systems take for the same.
    return unicodedata.normalize("NFC", folder.casefold())


def _folder(name: str, *, whole: bool = False) -> str:
    *above, last = PurePosixPath(name).parts
    stem = last if whole else last.split(".")[0]
    return "/".join(map(_cleaned, (*above, stem or last)))


def _cleaned(word: str) -> str:
    """Return what is left of one folder's name without what is awkward there."""
    text = unicodedata.normalize("NFC", word)
    words = "".join(c if _is_kept(c) else " " for c in text).split()
    short = "-".join(words).encode()[:_LONGEST].decode(errors="ignore")
    least = short.strip("-").rstrip("-.")
    if least.lower() in _OURS:
        return f"{_NAMELESS}-{least}"
    # Nor is a folder hidden.
    return f"{_NAMELESS}{least}" if least[:1] in ("", ".") else least


def _is_kept(character: str) -> bool:
    return character in _ALSO or unicodedata.category(character)[0] in _WORDS
