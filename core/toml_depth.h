#pragma once

#include <string_view>

namespace mvstudio {

/// Number of parts of the longest dotted key of a TOML text ("a.b.c = 1" and "[a.b.c]" have 3). Call before parsing: the
/// parser limits nested values but not keys, and the tree of a key of 100 000 parts overflows the stack when it is
/// destroyed.
size_t TomlKeyParts(std::string_view text);

inline constexpr size_t kMaxTomlKeyParts = 64;

}  // namespace mvstudio
