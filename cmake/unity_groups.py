#!/usr/bin/env python3
"""unity_groups.py SIZE FILE…: which files may be compiled as one translation unit. Prints GROUP FILE lines for CMake.

Two files of a group must not use one name at file scope (in an anonymous namespace, static, or `using ns::Name;`), unless both take it
from the same namespace. Files are taken in the given order; each goes to the first group with room and without its names. A name that
this reading misses shows as a redefinition when compiled.
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
USING = re.compile(r'using ([\w:]+)::(\w+);')
OWN = 'the file itself'


def namespace_of(qualifier):
    """`mvstudio::a`, `::mvstudio::a` and `a` are one namespace within the project; `::a` is another's."""
    return re.sub(r'^(::)?mvstudio::', '', qualifier)


def file_scope_names(path):
    """{name: where it is from} of what stands at file scope, at the start of a line, in the anonymous namespaces of `path`; macros and
    using-declarations everywhere. Where from: a namespace, or OWN."""
    names, anonymous = {}, False
    for line in open(path, encoding='utf-8'):
        using = USING.match(line)
        if re.match(r'namespace \{', line):
            anonymous = True
        elif re.match(r'\}  // namespace$', line):
            anonymous = False
        elif using:
            names[using.group(2)] = namespace_of(using.group(1))
        elif line.startswith('#define') or ((anonymous or line.startswith('static ')) and line[0] not in ' }#/)\n'):
            line = re.sub(r'^template <.*?>\s+', '', line)
            match = next(filter(None, (p.match(line) for p in PATTERNS)), None)
            if match:
                names[match.group(1)] = OWN
    return names


def clash(names, used):
    return any(name in used and (OWN in (where, used[name]) or where != used[name]) for name, where in names.items())


def main():
    size, groups = int(sys.argv[1]), []  # [number of files, names used]
    for path in sys.argv[2:]:
        names = file_scope_names(path)
        for index, (count, used) in enumerate(groups):
            if count < size and not clash(names, used):
                break
        else:
            index = len(groups)
            groups.append([0, {}])
        groups[index][0] += 1
        groups[index][1].update(names)
        print(f'g{index} {path}')


if __name__ == '__main__':
    main()
