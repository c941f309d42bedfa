"""Corner files that are damaged or out of order."""

import re

import numpy as np

from recording import Recording, make
from registry import kind, kinds

LINE = [r"line \d+"]


def edited(rng, edit, style="vnl", **fields):
    rec = make(rng, count=4, frames=30)
    return Recording(rec.scene, rec.corners, edit=edit, format=style, **fields)


def at_random_row(rng, change):
    """Changes one row of corners in the later half of the text."""
    def edit(text):
        lines = text.splitlines()
        k = int(rng.integers(len(lines) // 2, len(lines) - 5))
        while "- -" in lines[k]:
            k -= 1
        lines[k] = change(lines[k])
        return "\n".join(line for line in lines if line is not None) + "\n"
    return edit


def second_number(value):
    return lambda line: re.sub(r"^(\S+\s)\S+", rf"\g<1>{value}", line)


kinds("file", LINE, {
    "file_nan": ("One corner is `nan`.", lambda rng: edited(rng, at_random_row(rng, second_number("nan")))),
    "file_inf": ("One corner is `inf`.", lambda rng: edited(rng, at_random_row(rng, second_number("-inf")))),
    "file_huge": ("One corner is 1e300.", lambda rng: edited(rng, at_random_row(rng, second_number("1e300")))),
    "file_text": ("One corner is a word.", lambda rng: edited(rng, at_random_row(rng, second_number("N/A")))),
}, simpler=())


@kind("file", clean=True)
def file_empty_lines(rng):
    """Empty lines stand here and there."""
    def edit(text):
        lines = text.splitlines()
        for k in sorted(rng.integers(1, len(lines), 30), reverse=True):
            lines.insert(k, "" if k % 2 else "   ")
        return "\n".join(lines) + "\n\n"
    return edited(rng, edit)


@kind("file", clean=True)
def file_windows(rng):
    """Lines end as on Windows."""
    return edited(rng, lambda text: text.replace("\n", "\r\n"))


@kind("file", LINE, simpler=())
def file_decimal_commas(rng):
    """Numbers have decimal commas."""
    return edited(rng, lambda text: re.sub(r"(\d)\.(\d{4})", r"\1,\2", text))


@kind("file", LINE, simpler=())
def file_decimal_commas_csv(rng):
    """The same in a CSV."""
    return edited(rng, lambda text: re.sub(r"(\d)\.(\d{4})", r"\1,\2", text), "csv")


@kind("file", LINE, simpler=())
def file_cut(rng):
    """The file ends in the middle of a line."""
    share = rng.uniform(0.5, 0.9)
    return edited(rng, lambda text: text[:text.rindex(" ", 0, int(share * len(text)))])


@kind("file", [r"line \d+", r"corners, the board"], simpler=())
def file_cut_at_line(rng):
    """The file ends after a line in the middle of a board."""
    def edit(text):
        lines = text.splitlines()
        k = int(rng.uniform(0.5, 0.9) * len(lines))
        while lines[k].split()[0] != lines[k - 1].split()[0]:
            k += 1
        return "\n".join(lines[:k]) + "\n"
    return edited(rng, edit)


@kind("file", LINE + [r"together", r"order"], simpler=())
def file_unordered_lines(rng):
    """The lines of a vnl file, whose order numbers the corners, are in random order."""
    def edit(text):
        head, *lines = text.splitlines()
        return "\n".join([head, *(lines[k] for k in rng.permutation(len(lines)))]) + "\n"
    return edited(rng, edit)


@kind("file", clean=True)
def file_unordered_csv(rng):
    """The lines of a CSV, which name their corners, are in random order."""
    def edit(text):
        lines = text.splitlines()
        first = next(k for k, line in enumerate(lines) if line.startswith("camera,")) + 1
        return "\n".join(lines[:first] + [lines[first + k] for k in rng.permutation(len(lines) - first)]) + "\n"
    return edited(rng, edit, "csv")


@kind("file", clean=True)
def file_unordered_images(rng):
    """The images of a vnl file are in random order."""
    rec = make(rng, count=4, frames=30)
    keys = sorted(rec.corners)
    rec.order = [keys[k] for k in rng.permutation(len(keys))]
    return rec


@kind("file", [r"twice", r"line \d+"], simpler=())
def file_twice(rng):
    """A board of a camera stands in the file twice."""
    def edit(text):
        lines = text.splitlines()
        name = lines[len(lines) // 2].split(",")[:2]
        again = [line for line in lines if line.split(",")[:2] == name]
        return "\n".join(lines + again) + "\n"
    return edited(rng, edit, "csv")


@kind("file", [r"0, 0", r"zero", r"pixel", r"CAL-REJECTED", r"CAL-GROSS", r"same place", r"not found"])
def file_zeros(rng):
    """Corners that were not found stand as 0 0."""
    rec = make(rng, partial=True, frames=40)
    rec.judged = {}
    for key, px in rec.corners.items():
        lost = ~np.isfinite(px[:, 0]) | (rng.uniform(size=len(px)) < 0.03)
        rec.judged[key] = np.where(lost[:, None], np.nan, px)
        px[lost] = 0
    return rec


@kind("file", [r"size", r"outside", r"beyond the image", r"larger than"])
def wrong_size(rng):
    """A camera's images are told half as large as they are: corners lie outside."""
    rec = make(rng)
    c = int(rng.integers(len(rec.scene.cameras)))
    w, h = rec.scene.cameras[c].size
    return Recording(rec.scene, rec.corners, sizes={c: (w // 2, h // 2)}, culprits=[rec.scene.cameras[c].name])
