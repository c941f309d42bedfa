#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/skeleton/skeleton.h"

/// Skeletons as text: TOML in files of their own, JSON with the same keys inside other files (docs/formats.md).
namespace mvstudio::geometry {

inline constexpr size_t kMaxSkeletonJoints = 1000;
inline constexpr uintmax_t kMaxSkeletonBytes = 1 << 20;

/// Throws FormatError (path, key) for what is no skeleton: damaged text, no joints or too many, a name twice, joints that do
/// not exist, bones twice, ranges that are empty or not finite, parents that go in a circle, and keys that nobody knows.
Skeleton SkeletonFromToml(const std::string& text, const std::string& path);

/// The same of a JSON object; `where` is its place in `path`.
Skeleton SkeletonFromJson(const std::string& text, const std::string& path, const std::string& where);

/// Reading it gives the same skeleton.
std::string SkeletonToJson(const Skeleton& skeleton);

/// Equal for spellings of one joint: case, "_", "-", "." and blanks do not matter, nor where and how the side is written:
/// "LShoulder", "left_shoulder", "shoulder.L", "Left Shoulder". Words of COCO-WholeBody, Halpe and Panoptic for joints that
/// OpenPose calls otherwise become OpenPose's: "bodycenter" is "midhip", "left_forefinger1" is "lindex1".
std::string JointKey(const std::string& name);

/// The joint of that name, else the only one with its JointKey; -1: there is none, or several.
int FindJoint(const Skeleton& skeleton, const std::string& name);

/// For a message: "joint `X` is not in skeleton S; did you mean `Y`? Its joints are A, B, …".
std::string UnknownJoint(const Skeleton& skeleton, const std::string& name);

/// Two of `names` that are the same joint of the skeleton, as "`a` and `b`"; empty: there are none.
std::string TwiceTheSameJoint(const Skeleton& skeleton, const std::vector<std::string>& names);

/// Equal for spellings of one skeleton: "BODY_25B", "body25b", "Coco-17".
std::string SkeletonKey(const std::string& name);

namespace internal {

/// A file of geometry/skeleton/known/.
struct KnownSkeleton {
  const char* name;
  const char* toml;
};
std::vector<KnownSkeleton> KnownSkeletons();

}  // namespace internal
}  // namespace mvstudio::geometry
