"""What a folder holds, with what differs from run to run (times, durations) taken out."""

import fnmatch
import hashlib
import json
import os
import pathlib
import re

# Keys of JSON files whose values are times or depend on the load of the machine: in what tells about a run, and elsewhere.
_MEASURED = re.compile(r"^(timing|time|date|generated_at|.*_s|s_per_.*|.*second.*|.*_per_s|.*_ms|ms_per_.*|peak_rss_mb|.*speed.*)$")
_TIMES = re.compile(r"^(time|generated_at|wall_s|made|created|written|before)$")
_BOOKKEEPING = re.compile(r"(^|/)(\.mvstudio\.json|provenance\.jsonl|[a-z_0-9]+\.result\.json)$")


def is_bookkeeping(path):
    """Files that tell about the results and may be one run behind them after a kill."""
    return bool(_BOOKKEEPING.search(path))


def _without_times(value, keys=_MEASURED):
    if isinstance(value, dict):
        return {k: _without_times(v, keys) for k, v in value.items() if not keys.match(k)}
    if isinstance(value, list):
        return [_without_times(v, keys) for v in value]
    return value


def _manifest(value, measured):
    """Sizes and digests of files that hold times differ with them."""
    def strip(entry, name):
        volatile = is_bookkeeping(name) or _volatile_name(name, measured)
        return {} if volatile and isinstance(entry, dict) else _without_times(entry, _TIMES)

    files = value.get("files") if isinstance(value, dict) else None
    if isinstance(files, dict):
        value = dict(value, files={name: strip(entry, name) for name, entry in sorted(files.items())})
    elif isinstance(files, list):
        entries = [dict(strip(entry, str(entry.get("path", entry.get("name", "")))), path=entry.get("path", entry.get("name")))
                   for entry in files if isinstance(entry, dict)]
        value = dict(value, files=sorted(entries, key=lambda entry: str(entry["path"])))
    return _without_times(value, _TIMES)


def _matches(name, patterns):
    return any(fnmatch.fnmatch(os.path.basename(name), pattern) for pattern in patterns)


def _volatile_name(name, measured):
    return _matches(name, ["history.csv", "report.json", "report.html", *measured])


def _history(text):
    lines = [line.split(",") for line in text.splitlines()]
    if not lines:
        return text
    dropped = [i for i, name in enumerate(lines[0]) if name in ("wall_s", "seconds", "s") or name.endswith("_per_s")]
    return "\n".join(",".join(cell for i, cell in enumerate(line) if i not in dropped) for line in lines)


def canonical(path, data, measured=()):
    """Content of a file without what may differ between two equal runs. Broken bookkeeping keeps its bytes, so that it shows."""
    base = os.path.basename(path)
    try:
        if _matches(base, measured):  # holds nothing but measured times; it must be whole
            return b"measured" if data.endswith((b">", b"\n", b"}")) else b"TORN " + data
        if base == "provenance.jsonl":
            lines = data.decode().splitlines()
            if not data.endswith(b"\n"):
                return b"TORN " + data
            for line in lines:
                json.loads(line)
            last = _without_times(json.loads(lines[-1]))
            last.pop("record", None)  # times of files
            for entry in last.get("outputs", []) + last.get("inputs", []):
                for key in ("sha256", "sha256_of_list", "bytes"):
                    entry.pop(key, None)
            return json.dumps(last, sort_keys=True).encode()
        if base == ".mvstudio.json":
            return json.dumps(_manifest(json.loads(data), measured), sort_keys=True).encode()
        if base.endswith(".json") and base != "calibration.json" and len(data) < 4 << 20:
            measured = base.endswith(".result.json") or base == "report.json"
            return json.dumps(_without_times(json.loads(data), _MEASURED if measured else _TIMES), sort_keys=True).encode()
        if base == "history.csv":
            return _history(data.decode()).encode()
        if base.endswith(".html"):
            return re.sub(rb"\d{4}-\d\d-\d\d[T ][\d:]+(Z| UTC)|\d+(\.\d+)?(e-?\d+)? ?(s|ms|MB|min)\b", b"", data)
    except (ValueError, UnicodeDecodeError, AttributeError):
        return b"BROKEN " + data
    return data


def take(root, skip=(), measured=()):
    """Path below `root` -> what is there. Folders end with a slash. Names in `skip` (relative) are left out with all below."""
    state = {}
    root = str(root)
    for folder, folders, files in os.walk(root):
        relative = os.path.relpath(folder, root)
        relative = "" if relative == "." else relative + "/"
        folders[:] = sorted(name for name in folders if relative + name not in skip)
        for name in list(folders):
            path = os.path.join(folder, name)
            if os.path.islink(path):
                state[relative + name] = "-> " + os.readlink(path)
            else:
                state[relative + name + "/"] = "folder"
        for name in files:
            if relative + name in skip:
                continue
            path = os.path.join(folder, name)
            if os.path.islink(path):
                state[relative + name] = "-> " + os.readlink(path)
            elif not os.path.isfile(path):
                state[relative + name] = "special"
            else:
                content = canonical(path, pathlib.Path(path).read_bytes(), measured)
                broken = "broken " if content.startswith((b"BROKEN ", b"TORN ")) else ""
                state[relative + name] = broken + hashlib.sha1(content).hexdigest()
    return state


def digest(root):
    """One number for everything below a folder, byte for byte: of inputs, which nobody may change."""
    all_of_it = hashlib.sha256()
    for folder, folders, files in os.walk(str(root)):
        folders.sort()
        for name in sorted(files) + [f + "/" for f in folders]:
            path = os.path.join(folder, name)
            all_of_it.update(os.path.relpath(path, str(root)).encode() + b"\0")
            if os.path.islink(path.rstrip("/")):
                all_of_it.update(os.readlink(path.rstrip("/")).encode())
            elif os.path.isfile(path):
                all_of_it.update(hashlib.sha256(pathlib.Path(path).read_bytes()).digest())
    return all_of_it.hexdigest()


def key(state):
    return hashlib.sha1(json.dumps(state, sort_keys=True).encode()).hexdigest()


def difference(found, expected, most=4):
    """Short text of what differs, for messages."""
    lines = []
    for path in sorted(set(found) | set(expected)):
        if found.get(path) == expected.get(path):
            continue
        lines.append(("missing " if path not in found else "extra " if path not in expected else "changed ") + path)
    return ", ".join(lines[:most]) + (f" and {len(lines) - most} more" if len(lines) > most else "")
