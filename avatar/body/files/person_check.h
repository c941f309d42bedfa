// Private: the checks that reading and writing share.
#pragma once

#include <optional>
#include <string>

#include "avatar/body/body_template.h"

/// What makes a body usable; internal to avatar/body/files.
namespace mvstudio::body::internal {

inline constexpr double kMaxCoordinate = 1000;  // metres; also of numbers without a unit
inline constexpr size_t kMaxBones = 65535;      // what 16 bits number

struct BodyProblem {
  std::string array, what;  // "faces", "face 3 has the vertex 99"
};

/// The first thing that is wrong with a body, by the name of its field.
std::optional<BodyProblem> ProblemOf(const BodyTemplate& body);

}  // namespace mvstudio::body::internal
