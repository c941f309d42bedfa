#!/usr/bin/env python3
"""Checks the layers of the project: which folder may include which, and that third-party types stay out of headers.

Usage: layering_test.py [PROJECT_ROOT]. Prints FILE:LINE: REASON for every violation and exits 1 when there is one.
"""

import pathlib
import re
import sys

# Folder -> folders it may include besides itself. Arrows go down only.
MAY_INCLUDE = {
    "core": set(),
    "geometry": {"core"},
    "body": {"core", "geometry"},
    "calib": {"core", "geometry", "triangulate"},
    "triangulate": {"core", "geometry"},
    "dataset": {"core", "geometry", "body"},
    "dataset/pack": {"core", "geometry", "body", "dataset"},
    "exports": {"core", "geometry", "body", "calib", "dataset", "dataset/pack"},
    "detect": {"core", "geometry", "body", "dataset"},
    "synth": {"core", "geometry", "body", "dataset"},
    "metrics": {"core"},
    "avatar": {"core", "metrics"},
    "avatar/io": {"core", "geometry", "body", "dataset", "detect", "metrics", "avatar"},
    "report": {"core"},
}
# The one header that another module may see of a folder it does not depend on otherwise.
SINGLE_HEADERS = {("synth", "calib/board.h")}
EVERYTHING = {"cli", "bench", "fuzz", "tests"}

STANDARD = set(
    """algorithm any array atomic bitset cassert cctype cerrno cfloat charconv chrono cinttypes climits clocale cmath
    complex condition_variable csetjmp csignal cstdarg cstddef cstdint cstdio cstdlib cstring ctime cwchar deque exception execution
    filesystem forward_list fstream functional future initializer_list iomanip ios iosfwd iostream istream iterator limits list locale
    map memory memory_resource mutex new numeric optional ostream queue random ratio regex scoped_allocator set shared_mutex sstream
    stack stdexcept streambuf string string_view system_error thread tuple type_traits typeindex typeinfo unordered_map unordered_set
    utility valarray variant vector""".split())
# Headers of the system and the processor, allowed in .cc files.
POSIX = re.compile(r"^(sys/[a-z]+|fcntl|unistd|pwd|dirent|signal|spawn|poll|pthread|sched|errno|malloc|fenv|cpuid|immintrin)\.h$")
# Third-party headers by folder; the core knows the standard library alone.
EIGEN = re.compile(r"^Eigen/")
TORCH = re.compile(r"^(torch|ATen|c10)/")
NOT_IN_LAYER = {
    "core": re.compile(r".*"),
    "metrics": re.compile(r".*"),
    "avatar": re.compile(r"^(?!torch/|ATen/|c10/).*"),
}
# Interfaces whose purpose is another library's type.
HEADER_EXCEPTIONS = {
    ("cli", re.compile(r"^(CLI/|nlohmann/|spdlog/|toml\+\+/)")),
    ("tests", re.compile(r".*")),
    ("fuzz", re.compile(r".*")),
    ("bench", re.compile(r".*")),
}
INTERNAL_HEADER = re.compile(r"_internal\.h$")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def folder_of(path):
    """The layer a path (relative to the root) belongs to, or None."""
    parts = pathlib.PurePosixPath(path).parts
    if "/".join(parts[:2]) in MAY_INCLUDE:
        return "/".join(parts[:2])
    return parts[0] if parts[0] in MAY_INCLUDE or parts[0] in EVERYTHING else None


def is_third_party(name):
    return name not in STANDARD and not POSIX.match(name)


def check_own(layer, target, root):
    """Reason why `layer` may not include the project header `target`, or None."""
    if not (root / target).is_file():
        return f'"{target}" is no file of the project: the include path is the file path from the root'
    other = folder_of(target)
    if other is None or other == layer or layer in EVERYTHING:
        return None
    if other in MAY_INCLUDE[layer] or (layer, target) in SINGLE_HEADERS:
        return None
    allowed = ", ".join(sorted(MAY_INCLUDE[layer])) or "nothing"
    return f"{layer}/ includes {target}; it may include only {allowed}"


def check_foreign(layer, name, path):
    """Reason why the file `path` may not include <name>, or None."""
    if not is_third_party(name):
        if path.endswith(".h") and POSIX.match(name) and layer not in EVERYTHING:
            return f"system header <{name}> in a header; keep it in the .cc file"
        return None
    forbidden = NOT_IN_LAYER.get(layer)
    if forbidden and forbidden.match(name):
        return f"{layer}/ includes <{name}>, which its layer does not allow"
    if path.endswith(".h"):
        if EIGEN.match(name) or (TORCH.match(name) and layer in ("avatar", "avatar/io")) or INTERNAL_HEADER.search(path):
            return None
        if any(layer == folder and pattern.match(name) for folder, pattern in HEADER_EXCEPTIONS):
            return None
        return f"third-party <{name}> in a header; only Eigen and torch may stand there (or name it *_internal.h)"
    if TORCH.match(name) and layer not in ("avatar", "avatar/io", "detect") and layer not in EVERYTHING:
        return f"{layer}/ includes <{name}>: torch belongs to avatar/ and detect/"
    return None


def check_file(path, root):
    """Yields (line number, reason)."""
    layer = folder_of(path)
    text = (root / path).read_text(encoding="utf-8")
    if path.endswith(".h") and "#pragma once" not in text:
        yield 1, "header without #pragma once"
    for number, line in enumerate(text.splitlines(), 1):
        found = INCLUDE.match(line)
        if not found:
            continue
        quoted, name = found.group(1) == '"', found.group(2)
        own = quoted or folder_of(name) is not None and (root / name).is_file()
        reason = check_own(layer, name, root) if own else check_foreign(layer, name, path)
        if reason:
            yield number, reason
    if layer == "tests":
        return
    if layer not in EVERYTHING:
        for number, line in enumerate(text.splitlines(), 1):
            code = line.split("//")[0]
            if re.search(r"\bstd::(cout|cerr|clog)\b|(?<![a-zA-Z_.:])(printf|fprintf|puts|abort|exit)\s*\(", code):
                yield number, "a library neither prints nor exits"


def self_test():
    """The rules must catch what they are for."""
    assert check_foreign("core", "Eigen/Core", "core/a.cc")
    assert check_foreign("avatar", "Eigen/Core", "avatar/a.cc")
    assert check_foreign("avatar", "torch/torch.h", "avatar/a.h") is None
    assert check_foreign("calib", "ceres/ceres.h", "calib/a.h")
    assert check_foreign("calib", "ceres/ceres.h", "calib/a.cc") is None
    assert check_foreign("geometry", "Eigen/Core", "geometry/a.h") is None
    assert check_foreign("dataset", "torch/torch.h", "dataset/a.cc")
    assert check_foreign("core", "vector", "core/a.h") is None
    assert folder_of("avatar/io/a.h") == "avatar/io"


def main():
    self_test()
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
    files = sorted(str(p.relative_to(root)) for folder in {*MAY_INCLUDE, *EVERYTHING} for p in (root / folder).rglob("*.*")
                   if p.suffix in (".h", ".cc"))
    files = sorted(set(files))
    violations = [f"{path}:{line}: {reason}" for path in files for line, reason in check_file(path, root)]
    print("\n".join(violations + [f"{len(files)} files, {len(violations)} violations of the layers"]))
    return 1 if violations or not files else 0


if __name__ == "__main__":
    sys.exit(main())
