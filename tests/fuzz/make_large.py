#!/usr/bin/env python3
"""Writes large files of the formats of the seeds: tests/fuzz/make_large.py SEED_FOLDER OUT_FOLDER [BYTES]. Standard library only.

Each seed is grown in one place at a time: a list or table that repeats its items, with the same and with distinct names and numbers; an
object of many keys; a long text; a line, a row or a cell that repeats. A reader whose time grows with the square of such a thing needs
minutes for a file of 1 MB where others need a moment."""
import copy
import json
import os
import re
import sys

CUT = "\n--8<--\n"
NAMES = ("name", "camera", "picture", "file", "file_path", "image_id", "frame_id", "id", "frame", "rater", "seal", "joint", "path")


def distinct(item, i):
    """A copy of `item` that differs from the others wherever a name or number of it may have to."""
    if isinstance(item, dict):
        return {key: distinct(value, i) if isinstance(value, (dict, list)) or key in NAMES else value for key, value in item.items()}
    if isinstance(item, list):
        return [distinct(value, i) if isinstance(value, (dict, list)) else value for value in item]
    if isinstance(item, str):
        return f"{item}{i}"
    return item + i if isinstance(item, int) and not isinstance(item, bool) else item


def places(value, path=()):
    yield path, value
    items = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, path + (key,))


def replaced(root, path, value):
    if not path:
        return value
    root = copy.deepcopy(root)
    at = root
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return root


def grown_json(root, size):
    for path, value in places(root):
        if isinstance(value, list):
            item = value[0] if value else 0
            count = max(1, size // (len(json.dumps(item)) + 8))
            yield replaced(root, path, [item] * count)
            yield replaced(root, path, [distinct(item, i) for i in range(count)])
        elif isinstance(value, dict):
            yield replaced(root, path, dict(value, **{f"key{i}": 0 for i in range(size // 14)}))
        elif isinstance(value, str):
            yield replaced(root, path, value + "x" * size)
            yield replaced(root, path, '\\"\n\u00e9' * (size // 8))


def grown_text(text, size):
    lines = text.split("\n")
    for at, line in enumerate(lines[:40]):
        if not line.strip():
            continue
        count = size // (len(line) + 6) + 1
        yield "\n".join(lines[:at] + [line] * count + lines[at + 1:])
        counted = [re.sub(r"[A-Za-z_]+\d*|\d+", lambda m, i=i: f"{m.group()}{i}", line, count=1) for i in range(count)]
        yield "\n".join(lines[:at] + counted + lines[at + 1:])
    if len(lines) > 2:
        body = "\n".join(lines[1:]).strip("\n") + "\n"
        yield lines[0] + "\n" + body * (size // len(body) + 1)
    for at in sorted({0, len(lines) // 2, len(lines) - 1}):
        for word in re.findall(r"[^\s,;]+[,;\s]*", lines[at])[:2]:
            yield "\n".join(lines[:at] + [lines[at].replace(word, word * (size // len(word) + 1), 1)] + lines[at + 1:])


def variants(part, size):
    try:
        return [json.dumps(root) for root in grown_json(json.loads(part), size)]
    except ValueError:
        return list(grown_text(part, size))


def main():
    seeds, out = sys.argv[1], sys.argv[2]
    size = int(sys.argv[3]) if len(sys.argv) > 3 else 1 << 20
    os.makedirs(out, exist_ok=True)
    names = [name for name in sorted(os.listdir(seeds)) if not name.startswith("crash")]
    most = max(8, 48 // len(names))  # of each seed
    for name in names:
        with open(os.path.join(seeds, name), "rb") as file:
            try:
                text = file.read().decode()
            except UnicodeDecodeError:
                continue  # no text: pictures, archives
        if "\0" in text:
            continue
        parts = text.split(CUT)
        for k, part in enumerate(parts):
            grown = variants(part, size) if part else []
            step = -(-len(grown) * len(parts) // most) or 1
            for i, large in enumerate(grown[::step]):
                with open(os.path.join(out, f"{name}-{k}-{i}"), "wb") as file:
                    file.write(CUT.join(parts[:k] + [large] + parts[k + 1:]).encode("utf-8", "surrogatepass")[:2 * size])


main()
