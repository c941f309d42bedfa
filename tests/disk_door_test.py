#!/usr/bin/env python3
"""Checks that nothing but core/disk/ writes to the disk.

Usage: disk_door_test.py [PROJECT_ROOT]. Prints FILE:LINE: REASON for every call that makes, changes, renames or removes files
outside the door (core/disk/files.h, core/disk/output.h, core/disk/lock.h, core/disk/manifest.h), and exits 1 when there is one.
"""

import pathlib
import re
import sys

from modules import sources

# The door itself.
DOOR = re.compile(r"^core/disk/(files|lock|manifest|manifest_write|output|output_publish|temporary)\.cc$")
FORBIDDEN = {
    r"\b(std::)?(basic_)?(o|w)?fstream\b": "a stream that may write; use WriteFileAtomic",
    r"\bofstream\b": "a stream that writes; use WriteFileAtomic",
    r"\bfs(64)?open\s*\(|\bfopen(64)?\s*\(|\bfreopen\s*\(|\btmpfile\s*\(": "fopen may write",
    r"\b(fs|std::filesystem)::(remove|remove_all|rename|resize_file|permissions|copy|copy_file|copy_symlink|"
    r"create_directory|create_directories|create_symlink|create_directory_symlink|create_hard_link)\s*\(": "changes the disk",
    r"(?<![\w.>])(::)?(unlink|unlinkat|rename|renameat|renameat2|mkdir|mkdirat|rmdir|link|linkat|symlink|symlinkat|truncate|ftruncate|"
    r"mkstemp|mkostemp|mkdtemp|mknod|mkfifo|creat|chmod|fchmod|chown|utimes|copy_file_range|remove)\s*\(": "changes the disk",
    r"\bO_(WRONLY|RDWR|CREAT|TRUNC|APPEND)\b": "opens for writing",
    r"\bH5Fcreate\b": "HDF5 makes a file",
    r"\bH5F_ACC_RDWR\b": "HDF5 opens for writing",
    r"\bavio_open2?\s*\(": "libav opens for writing",
    r"\bimwrite\s*\(": "OpenCV writes a file",
    r"\bFileStorage\s+\w+\s*\(|cv::FileStorage\b": "OpenCV's FileStorage may write",
    r"\btorch::save\s*\(|\bpickle_save\b": "torch writes a file",
    r"\bsystem\s*\(|\bpopen\s*\(": "a shell",
}
# What has a reason: (file, pattern in the line).
ALLOWED = [
    ("dataset/arrays/hdf5_write.cc", r'H5Fcreate\("in memory"'),  # the core driver without a backing file
    ("dataset/footage/video_writer.cc", r"avio_open\(&format->pb, Url\(\)"),  # the temporary of an AtomicFile
    ("core/process.cc", r"O_WRONLY"),  # a child's output, into a work folder: RunProcess checks it
    (None, r'"/dev/null"'),
    (None, r"avio_open2?\(.*AVIO_FLAG_READ\b"),
]
COMMENT = re.compile(r"//.*$")
STRING = re.compile(r'"(?:[^"\\]|\\.)*"')


def violations(root):
    for path in sources(root):
        name = path.relative_to(root).as_posix()
        if DOOR.match(name):
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
            if line.startswith("#include") or any(file in (None, name) and re.search(pattern, line) for file, pattern in ALLOWED):
                continue
            code = STRING.sub('""', COMMENT.sub("", line))
            for pattern, reason in FORBIDDEN.items():
                if re.search(pattern, code) and not re.search(r"\bifstream\b", code):
                    yield f"{name}:{number}: {reason}: {line.strip()}"


def main():
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".").resolve()
    found = list(violations(root))
    print("\n".join(found) if found else "nothing but core/disk/ writes to the disk")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
