#pragma once

#include <string>

namespace mvstudio::detect {

/// SHA-512 (FIPS 180-4) in npm's format: "sha512-" and the base64 of the digest.
std::string Sha512Integrity(const std::string& bytes);

}  // namespace mvstudio::detect
