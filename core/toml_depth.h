#pragma once

#include <string_view>

namespace mvstudio {

/// Parts of the longest dotted key of a TOML text ("a.b.c = 1" and "[a.b.c]" have 3). The parser has a limit on nested values
/// but none on keys, and a key of 100 000 parts makes a tree that overflows the stack when it is taken down: ask before
/// parsing.
size_t TomlKeyParts(std::string_view text);

inline constexpr size_t kMaxTomlKeyParts = 64;

}  // namespace mvstudio
