"""From names in a list, written on some other computer, to image files on this one."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from psstereo.errors import InputError, MissingFileError
from psstereo.stack.decode import IMAGE_SUFFIXES

__all__ = ["Matches", "base_name", "match_files", "name_key"]

_HOW = {
    "folder": "The folders in the names of {list} are not there; the images were found by their base names.",
    "case": "{count} names in {list} differ in letter case or blanks from the files, such as {example}.",
    "ending": "{count} names in {list} have another ending than the files, such as {example}.",
}


@dataclass(frozen=True)
class Matches:
    """Files for the names of a list.

    Attributes
    ----------
    paths : tuple of Path
        One file a name, in the order of the list.
    notes : tuple of str
        Where names and files differ, as sentences.
    """

    paths: tuple[Path, ...]
    notes: tuple[str, ...]


def base_name(name: str) -> str:
    r"""Return the last part of a path in Unix or Windows writing.

    Examples
    --------
    >>> base_name(r"C:\photos\img 1.jpg")
    'img 1.jpg'
    """
    return re.split(r"[\\/]+", name.strip())[-1]


def name_key(name: str) -> str:
    """Return a form that is the same for names that differ in letter case, runs of blanks or coding of accents only."""
    return " ".join(unicodedata.normalize("NFC", name).casefold().split())


@dataclass(frozen=True)
class _Listing:
    """Names of the image files of folders, read once each."""

    known: dict[Path, list[Path]] = field(default_factory=dict)

    def images(self, folder: Path) -> list[Path]:
        if folder not in self.known:
            files = folder.iterdir() if folder.is_dir() else ()
            self.known[folder] = sorted(p for p in files if p.suffix.lower() in IMAGE_SUFFIXES and p.name[0] != ".")
        return self.known[folder]


def match_files(folder: Path, names: Sequence[str], listed_in: str) -> Matches:
    """Find the image of each name of a list.

    A name is taken as it stands if there is such a file; otherwise its last part is looked for in the folder, in the
    sub-folder or neighbour folder that it names, then without regard to letter case, then with any other ending.

    Parameters
    ----------
    folder : Path
        Folder of the list.
    names : sequence of str
        Names in Unix or Windows writing, with or without folders.
    listed_in : str
        Name of the list, for messages.

    Returns
    -------
    Matches
        Files and notes.

    Raises
    ------
    MissingFileError
        Naming all files that are not there.
    InputError
        If a name fits several files, or two names the same file.
    """
    listing = _Listing()
    found = [_locate(folder, name, listing, listed_in) for name in names]
    missing = [base_name(name) for name, hit in zip(names, found, strict=True) if hit is None]
    if missing:
        raise MissingFileError(
            given=f"{listed_in} lists {len(names)} images, of which {len(missing)} are not there: "
            f"{', '.join(missing[:20])}{' …' if len(missing) > 20 else ''}.",
            needed=f"Every listed image must be in {folder}.",
            remedy="Copy the missing ones, or take their lines out of the list and of the lights.",
        )
    hits = [hit for hit in found if hit is not None]
    _refuse_repeats([path for path, _ in hits], names, listed_in)
    notes = []
    for how, sentence in _HOW.items():
        odd = [f"{base_name(n)} for {p.name}" for n, (p, h) in zip(names, hits, strict=True) if h == how]
        if odd:
            notes.append(sentence.format(list=listed_in, count=len(odd), example=odd[0]))
    return Matches(tuple(path for path, _ in hits), tuple(notes))


def _locate(folder: Path, name: str, listing: _Listing, listed_in: str) -> tuple[Path, str] | None:
    parts = [part for part in re.split(r"[\\/]+", name.strip()) if part]
    if not parts:
        return None
    relative = not re.match(r"[\\/]|[A-Za-z]:", name.strip())
    if relative and (folder / Path(*parts)).is_file():
        return folder / Path(*parts), ""
    places = [folder, *((folder / parts[-2], folder.parent / parts[-2]) if len(parts) > 1 else ())]
    for place in places:
        if (place / parts[-1]).is_file():
            return place / parts[-1], "folder" if place == folder else ""
    for how in ("case", "ending"):
        for place in places:
            fits = [p for p in listing.images(place) if _same(p.name, parts[-1], how)]
            if len(fits) > 1:
                raise InputError(
                    given=f"The name {parts[-1]} in {listed_in} fits {', '.join(p.name for p in fits[:4])}.",
                    needed="Each name must stand for one file.",
                    remedy="Write the file's exact name into the list, or move the other files away.",
                )
            if fits:
                return fits[0], how
    return (Path(name.strip()), "") if not relative and Path(name.strip()).is_file() else None


def _same(file: str, name: str, how: str) -> bool:
    if how == "case":
        return name_key(file) == name_key(name)
    return name_key(Path(file).stem) == name_key(Path(name).stem)


def _refuse_repeats(paths: Sequence[Path], names: Sequence[str], listed_in: str) -> None:
    first: dict[Path, int] = {}
    for index, path in enumerate(paths):
        if path in first:
            raise InputError(
                given=f"Rows {first[path] + 1} and {index + 1} of {listed_in} ({base_name(names[first[path]])} and "
                f"{base_name(names[index])}) stand for the same file {path.name}.",
                needed="Each image is listed once, with its own light.",
                remedy="Take one of the two rows out, or correct its name.",
            )
        first[path] = index
