#!/usr/bin/env python3
"""Checks the layers of the project: which folder may include which, that third-party types stay out of headers, and
that libraries know no flags of the command line.

Usage: layering_test.py [PROJECT_ROOT]. Prints FILE:LINE: REASON for every violation and exits 1 when there is one.
"""

import pathlib
import re
import sys

from modules import folders, modules, targets

TARGETS = targets(pathlib.Path(__file__).parent.parent)  # folder -> whether it needs libtorch
CORE = {"core", "core/hash", "core/disk", "core/choice", "core/charts", "core/optimise", "core/text"}
GEOMETRY = {"geometry/rigid", "geometry/solve", "geometry/lens/models", "geometry/lens", "geometry/rig", "geometry/skeleton"}
CALIB = {"calib", "calib/board", "calib/bundle", "calib/covariance", "calib/lens", "calib/rig", "calib/check"}


def module_of(folder):
    """The folder of cmake/modules.txt whose target holds this one: the longest name that it begins with."""
    return max((m for m in TARGETS if folder == m or folder.startswith(m + "/")), key=len, default=folder.split("/")[0])


def needs_torch(folder):
    return TARGETS.get(module_of(folder), False)


# Folder -> folders it may include besides itself. Arrows go down only.
MAY_INCLUDE = {
    "core": set(),
    "core/hash": {"core"},
    "core/disk": {"core", "core/hash"},
    "core/choice": {"core"},
    "core/charts": {"core"},
    "core/optimise": {"core"},
    "core/text": {"core"},
    "core/imgcodecs": {"core"},
    "geometry/rigid": {"core"},
    "geometry/solve": {"core"},
    "geometry/lens/models": {"core"},
    "geometry/lens": {"core", "core/text", "geometry/rigid", "geometry/lens/models"},
    "geometry/rig": {"core", "core/disk", "geometry/rigid", "geometry/lens/models", "geometry/lens"},
    "geometry/skeleton": {"core", "core/disk", "core/text"},
    "avatar/body": CORE | GEOMETRY,
    "avatar/body/fit": CORE | GEOMETRY | {"avatar/body"},
    "avatar/body/soft": CORE | GEOMETRY | {"avatar/body", "avatar/body/fit"},
    "avatar/body/dynamic": CORE | GEOMETRY | {"avatar/body", "avatar/body/fit"},
    "avatar/body/texture": CORE | GEOMETRY | {"avatar/body"},
    "avatar/body/offset_net": CORE | GEOMETRY | {"avatar/body", "avatar/body/texture"},
    "avatar/body/makehuman": CORE | GEOMETRY | {"avatar/body"},
    "avatar/body/smpl": CORE | GEOMETRY | {"dataset/arrays", "avatar/body", "avatar/body/files"},
    "avatar/body/files": CORE | GEOMETRY | {"dataset/arrays", "avatar/body", "avatar/body/fit", "avatar/body/texture", "avatar/body/offset_net"},
    "avatar/body/templates": CORE | GEOMETRY | {"avatar/body", "avatar/body/makehuman", "avatar/body/smpl"},
    "avatar/splats": CORE | GEOMETRY | {"avatar/metrics", "avatar/body", "avatar/body/texture"},
    "avatar/splats/train": CORE | GEOMETRY | {"avatar/metrics", "avatar/body", "avatar/body/texture", "avatar/splats"},
    "avatar/splats/files": CORE | GEOMETRY | {"dataset/arrays", "avatar/body", "avatar/body/files", "avatar/splats"},
    "avatar/body/measure": CORE | GEOMETRY | {"dataset/arrays", "avatar/body", "avatar/body/fit", "avatar/body/files"},
    "triangulate/point": CORE | GEOMETRY,
    "triangulate/batch": CORE | GEOMETRY | {"triangulate/point"},
    "triangulate/people": CORE | GEOMETRY | {"triangulate/point"},
    "triangulate/sync": CORE | GEOMETRY | {"triangulate/point", "triangulate/people"},
    "triangulate/take": CORE | GEOMETRY | {"triangulate/point", "triangulate/people", "triangulate/sync"},
    "triangulate/skeleton": CORE | GEOMETRY | {"triangulate/point", "triangulate/take"},
    "triangulate/budget": CORE | GEOMETRY | {"triangulate/point", "triangulate/people", "triangulate/sync", "triangulate/take"},
    "calib/board": CORE | GEOMETRY,
    "calib/detect": CORE | GEOMETRY | {"calib/board"},
    "calib/formats": CORE | GEOMETRY | {"calib/board"},
    "calib/formats/colmap": CORE | GEOMETRY | {"calib/board", "calib/formats"},
    "calib/corners": CORE | GEOMETRY | {"calib/board", "calib/formats"},
    "calib/bundle": CORE | GEOMETRY | {"calib/board"},
    "calib/covariance": CORE | GEOMETRY | {"calib/board", "calib/bundle"},
    "calib/lens": CORE | GEOMETRY | {"calib/board", "calib/bundle", "calib/covariance"},
    "calib/rig": CORE | GEOMETRY | {"triangulate/point", "calib/board", "calib/bundle"},
    "calib/check": CORE | GEOMETRY | {"calib/board", "calib/bundle", "calib/lens", "calib/rig"},
    "calib/points": CORE | GEOMETRY | {"calib/board", "calib/bundle", "calib/covariance", "calib/formats"},
    "calib/keypoints": CORE | GEOMETRY | {"triangulate/point", "triangulate/people", "calib/covariance", "calib/points"},
    "calib": CORE | GEOMETRY | CALIB - {"calib"},
    "calib/verdict": CORE | GEOMETRY | CALIB,
    "calib/pipeline": CORE | GEOMETRY | CALIB | {"calib/verdict"},
    "dataset/arrays": CORE,
    "dataset/json": CORE,
    "dataset/footage": CORE,
    "dataset/pose": CORE | GEOMETRY | {"dataset/arrays", "dataset/json", "dataset/footage"},
    "dataset/time": CORE | {"dataset/json", "dataset/footage"},
    "dataset/session": CORE | {"dataset/json", "dataset/footage", "dataset/time"},
    "dataset/panoptic": CORE | GEOMETRY | {"dataset/json", "dataset/footage", "dataset/pose"},
    "dataset/views": CORE | GEOMETRY | {"dataset/json", "dataset/pose", "dataset/panoptic"},
    "dataset/masks": CORE | GEOMETRY | {"dataset/footage", "dataset/pose"},
    "dataset/colour": CORE | GEOMETRY | {"dataset/footage", "dataset/panoptic", "dataset/views"},
    "dataset/verify": CORE | GEOMETRY | {"dataset/json", "dataset/footage", "dataset/pose", "dataset/session", "dataset/panoptic"},
    "dataset/import": CORE | GEOMETRY | {"dataset/footage", "dataset/session", "dataset/panoptic", "dataset/verify"},
    "dataset/build": CORE | GEOMETRY | {"dataset/json", "dataset/footage", "dataset/pose", "dataset/time", "dataset/session",
                                        "dataset/panoptic", "dataset/masks", "dataset/verify"},
    "dataset/pack": CORE | GEOMETRY | {"dataset/arrays", "dataset/json", "dataset/footage", "dataset/pose", "dataset/panoptic", "dataset/views",
                                       "dataset/colour", "dataset/verify"},
    "dataset/trackers": CORE | GEOMETRY | {"dataset/pose", "dataset/arrays"},
    "dataset/detect/tfjs": CORE,
    "dataset/detect/models": CORE | {"dataset/detect/tfjs"},
    "dataset/detect/joints": CORE | GEOMETRY | {"dataset/pose", "dataset/detect/tfjs", "dataset/detect/models"},
    "dataset/detect/segment": CORE | GEOMETRY | {"dataset/detect/tfjs", "dataset/detect/models"},
    "dataset/markers": CORE | GEOMETRY | {"dataset/pose"},
    "dataset/exports": CORE | GEOMETRY | {"dataset/markers", "calib/board", "calib/formats", "dataset/footage", "dataset/pose", "dataset/panoptic",
                                  "dataset/views", "dataset/colour", "dataset/arrays", "dataset/pack"},
    "dataset/exports/read": CORE | GEOMETRY | {"dataset/arrays", "calib/board", "calib/formats", "dataset/footage", "dataset/pack",
                                       "dataset/trackers", "dataset/exports"},
    "synth/cloth": CORE | GEOMETRY | {"avatar/body"},
    "synth": CORE | GEOMETRY | {"dataset/arrays", "avatar/body", "avatar/body/files", "avatar/body/templates", "calib/board", "dataset/footage", "dataset/pose",
                                "dataset/session", "synth/cloth"},
    "avatar/metrics": {"core"},
    "avatar/settings": CORE,
    "avatar/maps": CORE | {"avatar/settings"},
    "avatar/data": CORE | {"avatar/settings", "avatar/maps"},
    "avatar/nets": CORE | {"avatar/settings", "avatar/maps", "avatar/data"},
    "avatar/train": CORE | {"avatar/settings", "avatar/maps", "avatar/data", "avatar/nets"},
    "avatar/lift": CORE | {"avatar/data", "avatar/train"},
    "avatar/scores": CORE | {"avatar/metrics", "avatar/nets"},
    "avatar/run/surface": CORE | GEOMETRY | {"avatar/body", "avatar/body/fit", "avatar/body/dynamic", "avatar/body/soft", "avatar/body/offset_net", "avatar/train"},
    "avatar/run/pack": CORE | GEOMETRY | {"avatar/body", "avatar/body/fit", "avatar/body/dynamic", "avatar/body/texture", "avatar/body/files", "avatar/body/templates", "dataset/footage", "dataset/pose", "dataset/panoptic", "dataset/views", "avatar/settings",
                                         "avatar/maps", "avatar/data", "avatar/run/surface"},
    "avatar/run/references": CORE | GEOMETRY | {"avatar/body", "avatar/body/texture", "avatar/body/files", "dataset/views", "avatar/settings", "avatar/data", "avatar/run/pack"},
    "avatar/run/render": CORE | GEOMETRY | {"avatar/body", "avatar/body/fit", "avatar/body/files", "dataset/footage", "dataset/pose", "dataset/session", "dataset/panoptic", "dataset/views", "avatar/maps",
                                           "avatar/nets", "avatar/run/pack", "avatar/run/references"},
    "avatar/run/evaluate": CORE | GEOMETRY | {"avatar/metrics", "avatar/body", "avatar/body/texture", "avatar/body/files", "avatar/splats", "avatar/splats/files", "dataset/footage", "dataset/panoptic", "dataset/session", "dataset/views", "dataset/detect/tfjs",
                                             "dataset/detect/models", "avatar/maps", "avatar/data", "avatar/nets", "avatar/scores",
                                             "avatar/run/pack", "avatar/run/references"},
    "avatar/run/gaussians": CORE | GEOMETRY | {"avatar/metrics", "avatar/body", "avatar/body/files", "avatar/body/texture", "avatar/splats", "avatar/splats/train", "avatar/splats/files", "dataset/footage", "dataset/pose", "dataset/panoptic", "dataset/views", "avatar/settings", "avatar/data", "avatar/run/pack", "avatar/run/render"},
    "avatar/run/lift": CORE | GEOMETRY | {"avatar/body", "dataset/pose", "dataset/panoptic", "avatar/lift"},
    "avatar/run/pretrain": CORE | GEOMETRY | {"avatar/body", "avatar/body/texture", "dataset/pose", "dataset/panoptic", "dataset/views", "avatar/maps",
                                             "avatar/data", "avatar/nets", "avatar/run/pack", "avatar/run/render", "avatar/run/lift"},
    "report/page": {"core", "core/hash"},
    "report/svg": {"core", "report/page"},
    "report/scene": {"core"},
    "report/study": CORE | {"report/page"},
    "report/viewer": set(),
    "report": CORE | {"report/page", "report/scene", "report/svg", "report/viewer"},
    "report/compare": CORE | {"report", "report/page", "report/svg"},
}
LIBRARIES = set(MAY_INCLUDE)
STAGE_LIBRARIES = LIBRARIES - {"dataset/exports", "dataset/exports/read", "synth"}
WITHOUT_TORCH = {f for f in STAGE_LIBRARIES if not needs_torch(f)}
NET_ROOM = STAGE_LIBRARIES | {"stages", "stages/budget", "stages/input", "stages/nets"}
MAY_INCLUDE |= {
    "stages": {"core", "core/disk", "core/text"},
    "stages/input": WITHOUT_TORCH | {"stages", "dataset/exports/read"},
    "stages/calib": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/serve": {"core"},
    "stages/click": WITHOUT_TORCH | {"stages", "stages/input", "stages/serve"},
    "stages/dataset": WITHOUT_TORCH | {"stages"},
    "stages/people": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/calibrate": WITHOUT_TORCH | {"stages", "stages/budget", "stages/input", "stages/calib", "stages/people"},
    "stages/align": WITHOUT_TORCH | {"stages", "stages/input", "stages/calib", "stages/people"},
    "stages/avatar_compare": WITHOUT_TORCH | {"stages", "stages/study"},
    "stages/body_mesh": WITHOUT_TORCH | {"stages"},
    "stages/body_template": WITHOUT_TORCH | {"stages"},
    "stages/demo": WITHOUT_TORCH | {"stages", "stages/input", "stages/pipeline"},
    "stages/doctor": WITHOUT_TORCH | {"stages", "stages/dataset"},
    "stages/pack_speed": WITHOUT_TORCH | {"stages"},
    "stages/synth": WITHOUT_TORCH | {"stages", "synth"},
    "stages/board": WITHOUT_TORCH | {"stages"},
    "stages/calib_files": WITHOUT_TORCH | {"stages", "stages/input", "stages/calib", "dataset/exports"},
    "stages/compare": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/dataset_build": WITHOUT_TORCH | {"stages", "stages/input", "stages/people"},
    "stages/dataset_export": WITHOUT_TORCH | {"stages", "stages/input", "dataset/exports"},
    "stages/dataset_import": WITHOUT_TORCH | {"stages", "stages/dataset"},
    "stages/dataset_pack": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/dataset_split": WITHOUT_TORCH | {"stages"},
    "stages/dataset_verify": WITHOUT_TORCH | {"stages", "stages/dataset", "stages/input"},
    "stages/error_budget": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/eval": WITHOUT_TORCH | {"stages", "stages/input", "stages/calib"},
    "stages/markers": WITHOUT_TORCH | {"stages", "stages/people"},
    "stages/refine": WITHOUT_TORCH | {"stages", "stages/input", "stages/calib", "stages/people"},
    "stages/scores": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/report": WITHOUT_TORCH | {"stages"},
    "stages/session": WITHOUT_TORCH | {"stages", "stages/dataset"},
    "stages/surface": WITHOUT_TORCH | {"stages"},
    "stages/sync": WITHOUT_TORCH | {"stages", "stages/input"},
    "stages/budget": CORE | {"stages"},
    "stages/triangulate": WITHOUT_TORCH | {"stages", "stages/budget", "stages/input", "stages/calib", "stages/people"},
    "stages/fronts": WITHOUT_TORCH | {"stages", "stages/budget", "stages/dataset", "stages/study"},
    "stages/tradeoff": WITHOUT_TORCH | {"stages", "stages/budget", "stages/input", "stages/people", "stages/study"},
    "stages/pipeline": WITHOUT_TORCH | {"stages", "stages/budget", "stages/input"},
    "stages/plan": WITHOUT_TORCH | {"stages", "stages/input", "stages/pipeline"},
    "stages/study": WITHOUT_TORCH | {"stages", "stages/dataset"},
    "stages/view": WITHOUT_TORCH | {"stages", "stages/input", "stages/serve", "stages/calib"},
    "stages/overlay": WITHOUT_TORCH | {"stages", "stages/input", "stages/calib", "stages/view"},
    "stages/nets": STAGE_LIBRARIES | {"stages", "stages/input", "stages/scores"},
    "stages/nets/evaluate": NET_ROOM,
    "stages/nets/fit": NET_ROOM,
    "stages/nets/lift": NET_ROOM,
    "stages/nets/mask": NET_ROOM,
    "stages/nets/pose2d": NET_ROOM | {"stages/people"},
    "stages/nets/render": NET_ROOM,
    "stages/nets/texture": NET_ROOM,
    "stages/nets/info": NET_ROOM,
    "stages/nets/models": {"core", "dataset/detect/models", "stages"},
    "stages/nets/trials": NET_ROOM | {"stages/study"},
    "stages/nets/train": NET_ROOM,
}
COMMANDS = {"cli/calib", "cli/dataset", "cli/people", "cli/avatar", "cli/tradeoff"}
STAGES = {f for f in MAY_INCLUDE if f.split("/")[0] == "stages"}
MAY_INCLUDE |= {"cli/help": {"core"}}
MAY_INCLUDE |= {"cli/program": LIBRARIES | STAGES | {"cli/help"}}
MAY_INCLUDE |= {folder: LIBRARIES | STAGES | {"cli/program"} for folder in COMMANDS}
MAY_INCLUDE |= {"cli": LIBRARIES | STAGES | COMMANDS | {"cli/program", "cli/help"}}
MAY_INCLUDE |= {"python": LIBRARIES | STAGES}
MOST_FILES = 40  # source files of a folder, headers and .cc files counted
FREE = {"bench", "tests"}  # may include everything
EVERYTHING = {"cli", *FREE}  # programs: may print and exit

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
    "avatar/metrics": re.compile(r".*"),
    "avatar": re.compile(r"^(?!torch/|ATen/|c10/).*"),
}
# Interfaces whose purpose is another library's type.
HEADER_EXCEPTIONS = {
    ("stages", re.compile(r"^nlohmann/")),
    ("cli", re.compile(r"^(CLI/|nlohmann/|spdlog/|toml\+\+/)")),
    ("tests", re.compile(r".*")),
    ("bench", re.compile(r".*")),
}
PRIVATE = re.compile(r"// Private: \S")  # how a header begins that is not installed (cmake/InstallHeaders.cmake)
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
# A library's text names an option as: option 'max-error-px' (core/fields.h); only the program makes --max-error-px of it.
FLAG = re.compile(r'--[a-z]|^"--"$')
FLAGS_ALLOWED = {
    "calib/points/colmap_program.cc",  # COLMAP's command line
    "dataset/detect/models/npm.cc",  # npm's
    "dataset/session/write.cc",  # comments in a session's mvstudio.toml
    "stages/plan/engines.cc",  # those of sbatch and snakemake
    "stages/stage_call.cc",  # command lines that stages call
    "stages/nets/train/rank_processes.cc",  # this program's, for the other ranks
    "report/section_avatar.cc",  # this and those below: what the page shows, style sheets too
    "report/section_calibration.cc",
    "report/section_common.cc",
    "report/section_stages.cc",
    "report/section_studio.cc",
    "report/section_triangulation.cc",
    "report/page/page_style.cc",
    "report/study/study_page.cc",
}
# Comments and characters are matched so that their quotes begin no text.
LITERAL = re.compile(
    r'R"(?P<end>[^()\\\s]*)\(.*?\)(?P=end)"|"(?:[^"\\\n]|\\.)*"|(?<![0-9A-Za-z])\'(?:[^\'\\\n]|\\.)+\'|//[^\n]*|/\*.*?\*/', re.S)


def folder_of(path):
    """The layer a path (relative to the root) belongs to, or None."""
    parts = pathlib.PurePosixPath(path).parts[:-1]
    if parts and parts[0] in FREE:
        return parts[0]
    return "/".join(parts) if "/".join(parts) in MAY_INCLUDE else None


def is_third_party(name):
    return name not in STANDARD and not POSIX.match(name)


def is_private(path, text):
    return path.endswith(".h") and bool(PRIVATE.match(text))


def check_own(layer, target, root, installed=False):
    """Reason why a file of `layer` may not include the project header `target`, or None. `installed`: the file is a header that is."""
    if not (root / target).is_file():
        return f'"{target}" is no file of the project: the include path is the file path from the root'
    if installed and is_private(target, (root / target).read_text(encoding="utf-8")):
        return f"a header that is installed includes {target}, which is private"
    other = folder_of(target)
    if other is None or other == layer or layer in FREE:
        return None
    if other in MAY_INCLUDE[layer]:
        return None
    allowed = ", ".join(sorted(MAY_INCLUDE[layer])) or "nothing"
    return f"{layer}/ includes {target}; it may include only {allowed}"


def check_foreign(layer, name, path, private=False):
    """Reason why the file `path`, a private header or not, may not include <name>, or None."""
    if not is_third_party(name):
        if path.endswith(".h") and POSIX.match(name) and layer.split("/")[0] not in EVERYTHING:
            return f"system header <{name}> in a header; keep it in the .cc file"
        return None
    module, top = module_of(layer), layer.split("/")[0]
    forbidden = NOT_IN_LAYER.get(module)
    if forbidden and forbidden.match(name):
        return f"{layer}/ includes <{name}>, which its layer does not allow"
    if path.endswith(".h") and not private:
        if EIGEN.match(name) or (TORCH.match(name) and module in ("avatar", "avatar/run")):
            return None
        if any(top == folder and pattern.match(name) for folder, pattern in HEADER_EXCEPTIONS):
            return None
        return f"third-party <{name}> in a header; only Eigen and torch may stand there (or it begins with // Private: WHY)"
    if TORCH.match(name) and not needs_torch(layer) and top not in ("stages", *EVERYTHING):
        return f"{layer}/ includes <{name}>: torch belongs to the modules that cmake/modules.txt marks"
    return None


def lines_with_flags(text):
    """Numbers of the lines where a string literal that holds a flag begins."""
    return [text.count("\n", 0, found.start()) + 1 for found in LITERAL.finditer(text)
            if found.group().startswith(('"', 'R"')) and FLAG.search(found.group())]


def check_flags(path, text):
    """Yields (line number, reason) where a library names a flag."""
    lines = lines_with_flags(text)
    if path in FLAGS_ALLOWED:
        if not lines:
            yield 1, "holds no flag any more: take it out of FLAGS_ALLOWED"
        return
    for number in lines:
        yield number, "a library knows no flags: write option 'name' for --name (core/fields.h)"


def check_file(path, root):
    """Yields (line number, reason)."""
    layer = folder_of(path)
    if layer is None:
        yield 1, "lies in a folder that the table does not know"
        return
    text = (root / path).read_text(encoding="utf-8")
    private = is_private(path, text)
    installed = path.endswith(".h") and not private and layer.split("/")[0] not in EVERYTHING
    if path.endswith(".h") and "#pragma once" not in text:
        yield 1, "header without #pragma once"
    for number, line in enumerate(text.splitlines(), 1):
        found = INCLUDE.match(line)
        if not found:
            continue
        quoted, name = found.group(1) == '"', found.group(2)
        own = quoted or folder_of(name) is not None and (root / name).is_file()
        reason = check_own(layer, name, root, installed) if own else check_foreign(layer, name, path, private)
        if reason:
            yield number, reason
    if layer == "tests":
        return
    if layer.split("/")[0] not in EVERYTHING:
        for number, line in enumerate(text.splitlines(), 1):
            code = line.split("//")[0]
            if re.search(r"\bstd::(cout|cerr|clog)\b|(?<![a-zA-Z_.:])(printf|fprintf|puts|abort|exit)\s*\(", code):
                yield number, "a library neither prints nor exits"
        yield from check_flags(path, text)


def check_sizes(root):
    """Yields (folder, reason) for folders with too many source files."""
    for folder in sorted(MAY_INCLUDE):
        number = sum(p.suffix in (".h", ".cc") for p in (root / folder).iterdir())
        if number > MOST_FILES:
            yield folder, f"{number} source files; at most {MOST_FILES}"


def check_arrows():
    """Yields (folder, reason) where the table itself lets two folders include each other, directly or not."""
    def below(folder, seen):
        for other in MAY_INCLUDE[folder] - seen:
            seen.add(other)
            below(other, seen)
        return seen
    for folder in MAY_INCLUDE:
        if folder in below(folder, set()):
            yield folder, "includes itself by way of others"


def check_list(root):
    """Yields (folder, reason) for folders at the top that hold sources and are not in cmake/modules.txt, and the other way round."""
    listed = set(modules(root))
    for folder in sorted(p for p in root.iterdir() if p.is_dir() and p.name not in FREE | {"build"} and p.name[0] != "."):
        if folder.name not in listed and any(p.suffix in (".h", ".cc") for p in folder.rglob("*.*")):
            yield folder.name, "holds sources and is not in cmake/modules.txt"
    for name in sorted(listed ^ {folder.split("/")[0] for folder in MAY_INCLUDE}):
        yield name, "is in one of cmake/modules.txt and the table above, not in both"
    for name in sorted(set(folders(root)) ^ set(MAY_INCLUDE)):
        yield name, "is in one of cmake/folders.txt and the table above, not in both"
    header_filter = re.search(r"HeaderFilterRegex: '/\((.*)\)/'", (root / ".clang-tidy").read_text(encoding="utf-8")).group(1)
    for name in sorted(listed - set(header_filter.split("|"))):
        yield name, "is not in the HeaderFilterRegex of .clang-tidy"


def self_test():
    """The rules must catch what they are for."""
    assert check_foreign("core", "Eigen/Core", "core/a.cc")
    assert check_foreign("avatar/nets", "Eigen/Core", "avatar/nets/a.cc") and not check_foreign("avatar/body", "Eigen/Core", "avatar/body/a.h")
    assert check_foreign("avatar/body", "torch/torch.h", "avatar/body/a.cc") and not check_foreign("avatar/run", "torch/torch.h", "avatar/run/a.cc")
    assert check_foreign("avatar/nets", "torch/torch.h", "avatar/nets/a.h") is None
    assert check_foreign("calib", "ceres/ceres.h", "calib/a.h")
    assert check_foreign("calib", "ceres/ceres.h", "calib/a.cc") is None
    assert check_foreign("calib", "ceres/ceres.h", "calib/a.h", private=True) is None
    assert check_foreign("calib", "torch/torch.h", "calib/a.h", private=True)
    assert is_private("a.h", "// Private: its types.\n") and not is_private("a.h", "#pragma once\n// Private: its types.\n")
    assert check_foreign("geometry", "Eigen/Core", "geometry/a.h") is None
    assert check_foreign("dataset", "torch/torch.h", "dataset/a.cc")
    assert check_foreign("core", "vector", "core/a.h") is None
    assert folder_of("avatar/run/pack/a.h") == "avatar/run/pack" and folder_of("tests/calib/a.h") == "tests"
    assert folder_of("calib/lens/a.h") == "calib/lens" and folder_of("calib/a.h") == "calib"
    assert check_own("calib/board", "calib/calibrate.h", pathlib.Path(__file__).parent.parent)
    assert check_own("calib/pipeline", "calib/verdict/judgement.h", pathlib.Path(__file__).parent.parent, installed=True)
    assert lines_with_flags('a("b");  // "--c"\nd = \'"\'; e("f --g");\nh(1\'000, R"(\n--i)"); /* "--j" */ --k;\n') == [2, 3]
    assert lines_with_flags('a("b -- c", "-d", "<!--");\ne("--" + f);') == [2]
    assert list(check_flags("calib/a.cc", 'a("give --b");')) and not list(check_flags("calib/a.cc", "a(\"give option 'b'\");"))
    assert list(check_flags(min(FLAGS_ALLOWED), ""))


def main():
    self_test()
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
    folders = {*modules(root), *FREE}
    files = sorted(str(p.relative_to(root)) for folder in folders for p in (root / folder).rglob("*.*") if p.suffix in (".h", ".cc"))
    violations = [f"{path}:{line}: {reason}" for path in files for line, reason in check_file(path, root)]
    violations += [f"{folder}/: {reason}" for check in (check_sizes(root), check_arrows(), check_list(root)) for folder, reason in check]
    print("\n".join(violations + [f"{len(files)} files, {len(violations)} violations of the layers"]))
    return 1 if violations or not files else 0


if __name__ == "__main__":
    sys.exit(main())
