#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "body/skeleton.h"

/// Skeletons as text: TOML in files of their own, JSON with the same keys inside other files (docs/formats.md).
namespace mvstudio::body {

inline constexpr size_t kMaxSkeletonJoints = 1000;
inline constexpr uintmax_t kMaxSkeletonBytes = 1 << 20;

/// Throws FormatError (path, key) for what is no skeleton: damaged text, no joints or too many, a name twice, joints that do
/// not exist, bones twice, ranges that are empty or not finite, parents that go in a circle, and keys that nobody knows.
Skeleton SkeletonFromToml(const std::string& text, const std::string& path);

/// The same of a JSON object; `where` is its place in `path`.
Skeleton SkeletonFromJson(const std::string& text, const std::string& path, const std::string& where);

/// Reading it gives the same skeleton.
std::string SkeletonToJson(const Skeleton& skeleton);

namespace internal {

/// A file of body/skeletons/.
struct KnownSkeleton {
  const char* name;
  const char* toml;
};
std::vector<KnownSkeleton> KnownSkeletons();

}  // namespace internal
}  // namespace mvstudio::body
