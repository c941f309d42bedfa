#pragma once

#include <string>

namespace mvstudio::detect {

/// SHA-512 (FIPS 180-4) as npm writes it: "sha512-" and the base64 of the digest.
std::string Sha512Integrity(const std::string& bytes);
/// The same of a file, read in pieces. Throws IoError.
std::string Sha512IntegrityOfFile(const std::string& path);

}  // namespace mvstudio::detect
