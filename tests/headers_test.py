#!/usr/bin/env python3
"""Checks that every header stands alone: what it names it includes, itself or by way of the project's headers.

Usage: headers_test.py [PROJECT_ROOT]; prints FILE:LINE: REASON, exits 1 when there is one. Reads the text instead of compiling it:
compilers need a second a header. Looked for are names of the standard library, Eigen's, and the types of the project.
"""

import functools
import pathlib
import re
import sys

from modules import sources

# Where the standard library declares what headers here name; of several headers one is enough.
STANDARD = {
    "algorithm": "adjacent_find all_of any_of clamp copy copy_n count count_if equal fill fill_n find find_if lower_bound max max_element min "
                 "min_element minmax none_of nth_element remove_if reverse rotate sort stable_sort transform unique upper_bound",
    "any": "any",
    "array": "array",
    "atomic": "atomic atomic_bool atomic_int",
    "cctype": "isalnum tolower",
    "charconv": "from_chars to_chars",
    "chrono": "chrono",
    "cmath": "abs acos asin atan atan2 ceil copysign cos cosh exp expm1 fabs floor fma fmod frexp hypot isfinite isinf isnan nan ldexp llround "
             "log log10 log1p log2 lround nearbyint pow round sin sinh sqrt tan tanh trunc cbrt rint remainder",
    "complex": "complex",
    "condition_variable": "condition_variable",
    "cstddef": "byte max_align_t",
    "cstdio": "snprintf sscanf FILE",
    "cstdlib": "free malloc strtod strtol abs getenv",
    "cstring": "memcmp memcpy memset strlen strerror",
    "deque": "deque",
    "exception": "exception exception_ptr current_exception rethrow_exception uncaught_exceptions",
    "filesystem": "filesystem",
    "fstream": "ifstream",
    "functional": "function hash invoke less greater reference_wrapper ref cref plus",
    "future": "future async",
    "initializer_list": "initializer_list",
    "ios": "streamsize ios",
    "iosfwd": "ostream istream",
    "istream": "istream",
    "iterator": "back_inserter begin end next prev distance make_move_iterator forward_iterator_tag input_iterator_tag",
    "limits": "numeric_limits",
    "list": "list",
    "map": "map multimap",
    "memory": "make_shared make_unique shared_ptr unique_ptr weak_ptr addressof",
    "mutex": "lock_guard mutex once_flag call_once recursive_mutex scoped_lock unique_lock",
    "new": "bad_alloc",
    "numeric": "accumulate iota inner_product gcd",
    "optional": "nullopt nullopt_t optional make_optional",
    "ostream": "ostream endl",
    "queue": "queue priority_queue",
    "random": "mt19937 mt19937_64 normal_distribution uniform_real_distribution uniform_int_distribution",
    "set": "set multiset",
    "sstream": "ostringstream istringstream stringstream",
    "stdexcept": "runtime_error logic_error invalid_argument out_of_range",
    "string": "string to_string stod stoi stoll getline u32string",
    "string_view": "string_view",
    "system_error": "errc error_code",
    "thread": "thread this_thread",
    "tuple": "tuple tie make_tuple apply get tuple_size ignore",
    "type_traits": "conditional_t decay_t enable_if_t false_type integral_constant invoke_result_t is_arithmetic_v is_base_of_v is_const_v "
                   "is_convertible_v is_enum_v is_floating_point_v is_integral_v is_same_v is_signed_v is_trivially_copyable_v "
                   "is_invocable_v remove_const_t remove_cv_t remove_reference_t true_type underlying_type_t void_t is_constructible_v "
                   "is_void_v remove_cvref_t common_type_t make_unsigned_t is_unsigned_v is_same",
    "unordered_map": "unordered_map",
    "unordered_set": "unordered_set",
    "utility": "declval exchange forward get index_sequence index_sequence_for integer_sequence make_index_sequence make_pair move pair swap "
               "as_const in_place",
    "variant": "variant visit monostate get get_if holds_alternative",
    "vector": "vector",
}
ANY = {"size_t", "ptrdiff_t", "move", "forward", "swap", "get", "begin", "end", "nullptr_t"}  # every container brings them
WHERE = {}
for _header, _names in STANDARD.items():
    for _name in _names.split():
        WHERE.setdefault(_name, set()).add(_header)
WHERE["ostream"] |= {"sstream", "iostream", "fstream"}
WHERE["istream"] |= {"sstream", "iostream", "fstream"}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.M)
SKIPPED = re.compile(r'R"(?P<end>[^()\\\s]*)\(.*?\)(?P=end)"|"(?:[^"\\\n]|\\.)*"|//[^\n]*|/\*.*?\*/', re.S)
STD_NAME = re.compile(r"\bstd::(\w+)")
INTEGER = re.compile(r"(?<![\w:])(?:std::)?u?int(?:_fast|_least)?(?:8|16|32|64|ptr|max)_t\b|\bU?INT(?:8|16|32|64)_(?:MAX|MIN)\b")
DECLARED = re.compile(r"\b(?:struct|class|union|using|enum(?:\s+(?:class|struct))?|typename|concept)\s+([A-Z]\w*)")
DEFINED = re.compile(r"^(?:template <[^\n]*>\s*)?(?:struct|class|union|enum(?: class)?) ([A-Z]\w*)\s*(?:final\s*)?(?::[^;{]*)?\{|^using ([A-Z]\w*) =", re.M)
TYPE = re.compile(r"(?<![\w.>])([A-Z]\w*[a-z]\w*)\b(?!\s*\()")


def blanked(text):
    """The text without comments and literals, line by line as before."""
    return SKIPPED.sub(lambda found: "\n" * found.group().count("\n"), text)


class Tree:
    def __init__(self, texts):
        self.includes = {p: [(kind, name) for kind, name in INCLUDE.findall(t)] for p, t in texts.items()}
        self.code = {p: blanked("".join("\n" if INCLUDE.match(line) else line for line in t.splitlines(True))) for p, t in texts.items()}
        self.defined = {}
        for path, code in self.code.items():
            for first, second in DEFINED.findall(code):
                self.defined.setdefault(first or second, set()).add(path)

    @functools.lru_cache(maxsize=None)
    def reach(self, path):
        """(own headers, other headers) that `path` includes, directly or by way of own ones; `path` among them."""
        own, others, todo = {path}, set(), [path]
        while todo:
            for _, name in self.includes[todo.pop()]:
                if name not in self.includes:
                    others.add(name)
                elif name not in own:
                    own.add(name)
                    todo.append(name)
        return own, others

    def missing(self, line, path):
        """Yields reasons for a line of a header."""
        own, others = self.reach(path)
        for name in STD_NAME.findall(line):
            if name in ANY or INTEGER.match(name):
                continue
            if name not in WHERE:
                yield f"std::{name} is not in the table of headers_test.py"
            elif not WHERE[name] & others:
                yield f"std::{name} without <{min(WHERE[name])}>"
        if INTEGER.search(line) and not {"cstdint", "cinttypes"} & others:
            yield f"{INTEGER.search(line).group()} without <cstdint>"
        if "Eigen::" in line and not any(other.startswith("Eigen/") for other in others):
            yield "Eigen:: without a header of Eigen"
        for name in TYPE.findall(line):
            homes = self.defined.get(name)
            if homes and not homes & own and not any(name in self.declared(header) for header in own):
                yield f"{name} without {min(homes)}"

    @functools.lru_cache(maxsize=None)
    def declared(self, path):
        return set(DECLARED.findall(self.code[path]))

    def check(self, path):
        """Yields (line number, reason), each name once."""
        seen = set()
        for number, line in enumerate(self.code[path].splitlines(), 1):
            for reason in self.missing(line, path):
                if reason not in seen:
                    seen.add(reason)
                    yield number, reason


def self_test():
    tree = Tree({
        "a/a.h": '#include <vector>\n#include "a/b.h"\nstd::vector<B> F(std::string s);  // std::map\nuint8_t G(const Pose& c);\n',
        "a/b.h": "#include <cmath>\nstruct B {\n  struct D {};\n  Eigen::Vector2d x;\n};\n",
        "a/c.h": "struct Pose {};\nclass B;\nB* H(D d, std::nonsense e);\n",
    })
    assert list(tree.check("a/a.h")) == [(3, "std::string without <string>"), (4, "uint8_t without <cstdint>"), (4, "Pose without a/c.h")]
    assert list(tree.check("a/b.h")) == [(4, "Eigen:: without a header of Eigen")]
    assert list(tree.check("a/c.h")) == [(3, "std::nonsense is not in the table of headers_test.py")]


def main():
    self_test()
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
    paths = sources(root, ".h")
    tree = Tree({str(p.relative_to(root)): p.read_text(encoding="utf-8") for p in paths})
    found = [f"{path}:{line}: {reason}" for path in tree.code for line, reason in tree.check(path)]
    print("\n".join(found + [f"{len(paths)} headers, {len(found)} names that they do not include"]))
    return 1 if found or not paths else 0


if __name__ == "__main__":
    sys.exit(main())
