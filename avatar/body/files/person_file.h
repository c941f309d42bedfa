#pragma once

#include <Eigen/Core>
#include <map>
#include <string>

#include "avatar/body/body_template.h"

namespace mvstudio::body {

/// A body that was fitted to a person, and what the fit found beside it.
struct PersonFile {
  BodyTemplate body;
  std::map<std::string, Eigen::MatrixXd> extras;  // by names of letters, digits and _; any numbers, NaN too
};

/// `body.npz` (docs/formats.md). What is read is bit for bit what was written. Writing throws ContractViolation for what
/// reading would refuse; reading throws IoError, or FormatError that names the file and the array: for sizes that do not
/// match, indices out of range, parents that do not come before their children, weights that do not sum to one, numbers
/// that are not finite or beyond 1000 m, and arrays that are missing or not known.
void WritePersonFile(const std::string& path, const PersonFile& person);
PersonFile ReadPersonFile(const std::string& path);

/// Same with the bytes of the file.
std::string PersonFileBytes(const PersonFile& person);
PersonFile ParsePersonFile(const std::string& bytes, const std::string& path);

}  // namespace mvstudio::body
