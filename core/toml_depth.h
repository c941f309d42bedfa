#pragma once

#include <string>
#include <string_view>

namespace mvstudio {

/// Number of parts of the longest dotted key of a TOML text ("a.b.c = 1" and "[a.b.c]" have 3). Call before parsing: the
/// parser limits nested values but not keys, and the tree of a key of 100 000 parts overflows the stack when it is
/// destroyed.
size_t TomlKeyParts(std::string_view text);

inline constexpr size_t kMaxTomlKeyParts = 64;

/// Line, from 1, of a brace that closes a list ("[1, }"); 0 where there is none. No TOML has one. toml++ 3.3 takes for granted
/// that no such brace comes where it reads a value of a list: its assertions end the program.
size_t TomlBraceInList(std::string_view text);

/// Throws FormatError (path) for a text that the parser must not see: a key of more than kMaxTomlKeyParts parts, or a brace
/// that closes a list.
void RequireParsableToml(std::string_view text, const std::string& path);

}  // namespace mvstudio
