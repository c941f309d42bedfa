#!/usr/bin/env python3
"""unity_groups.py SIZE FILE…: which files may be compiled as one translation unit. Prints GROUP FILE lines for CMake.

Two files of a group must not use one name at file scope (in an anonymous namespace, or static). Files are taken in the given order;
each goes to the first group with room and without its names. A name that this reading misses shows as a redefinition when compiled.
"""
import re
import sys

PATTERNS = [re.compile(p) for p in (
    r'(?:struct|class|enum class|enum|union) (\w+)',
    r'using (\w+) =',
    r'(?:inline |static |thread_local )*(?:constexpr|const|static|thread_local|std::\w+)[^(=]*?\b(\w+)(?:\[\w*\])*\s*(?:=|\{|;)',
    r'[\w:<>,&*\s\[\]]+?[\s&*](\w+)\(',
    r'#define (\w+)',
)]


def file_scope_names(path):
    """Names that stand at file scope, at the start of a line, in the anonymous namespaces of `path`; and its macros."""
    names, anonymous = set(), False
    for line in open(path, encoding='utf-8'):
        if re.match(r'namespace \{', line):
            anonymous = True
        elif re.match(r'\}  // namespace$', line):
            anonymous = False
        elif line.startswith('#define') or ((anonymous or line.startswith('static ')) and line[0] not in ' }#/)\n'):
            line = re.sub(r'^template <.*?>\s+', '', line)
            match = next(filter(None, (p.match(line) for p in PATTERNS)), None)
            if match:
                names.add(match.group(1))
    return names


def main():
    size, groups = int(sys.argv[1]), []  # [number of files, names used]
    for path in sys.argv[2:]:
        names = file_scope_names(path)
        for index, (count, used) in enumerate(groups):
            if count < size and not names & used:
                break
        else:
            index = len(groups)
            groups.append([0, set()])
        groups[index][0] += 1
        groups[index][1] |= names
        print(f'g{index} {path}')


if __name__ == '__main__':
    main()
