#include <set>

#include "geometry/skeleton/skeleton_text.h"
#include "tests/fuzz/fuzz.h"

/// Skeletons as users write them, and as pose3d.json and datasets keep them.
namespace mvstudio::fuzz {
namespace {

void RequireIndices(const std::vector<std::pair<int, int>>& pairs, int num_joints, const char* what) {
  for (const auto& [a, b] : pairs) {
    Require(a >= 0 && a < num_joints && b >= 0 && b < num_joints && a != b,
            std::string(what) + " of joints that are not there");
  }
}

/// Every joint has one way to the only root.
void RequireTree(const std::vector<int>& parents, size_t num_joints) {
  Require(parents.size() == num_joints, "not a parent for each joint");
  int roots = 0;
  for (size_t j = 0; j < num_joints; ++j) {
    roots += parents[j] < 0;
    size_t steps = 0;
    for (int at = static_cast<int>(j); at >= 0; at = parents[static_cast<size_t>(at)]) {
      Require(at < static_cast<int>(num_joints) && ++steps <= num_joints, "parents go in a circle");
    }
  }
  Require(roots == 1, "more or fewer than one root");
}

void RequireSound(const geometry::Skeleton& skeleton) {
  const int count = static_cast<int>(skeleton.joints.size());
  Require(count > 0 && skeleton.joints.size() <= geometry::kMaxSkeletonJoints, "no joints, or too many");
  Require(std::set<std::string>(skeleton.joints.begin(), skeleton.joints.end()).size() == skeleton.joints.size(),
          "a joint twice");
  RequireIndices(skeleton.bones, count, "a bone");
  RequireIndices(MirrorJoints(skeleton), count, "a pair");
  RequireTree(HierarchyOf(skeleton), skeleton.joints.size());
  Require(skeleton.lengths.empty() || skeleton.lengths.size() == skeleton.bones.size(), "not a range for each bone");
  for (const geometry::LengthRange& range : skeleton.lengths)
    Require(range.min_m >= 0 && range.min_m <= range.max_m, "an empty range");
  Require(BoneColours(skeleton).size() == skeleton.bones.size(), "not a colour for each bone");
  for (const auto& bone : skeleton.bones) Require(!BoneName(skeleton, bone).empty(), "a bone without a name");
}

/// What is kept in other files is the same skeleton.
void RequireKept(const geometry::Skeleton& skeleton) {
  const std::string kept = SkeletonToJson(skeleton);
  geometry::Skeleton back;
  Require(Accepts([&] { back = geometry::SkeletonFromJson(kept, "pose3d.json", "skeleton"); }),
          "what was written cannot be read");
  RequireSound(back);
  Require(SkeletonToJson(back) == kept, "the skeleton changes when it is written and read");
}

}  // namespace

MVS_FUZZ_TARGET(skeleton_toml, bytes) {
  geometry::Skeleton skeleton;
  if (!Accepts([&] { skeleton = geometry::SkeletonFromToml(std::string(bytes), "mouse.toml"); })) return;
  RequireSound(skeleton);
  RequireKept(skeleton);
}

MVS_FUZZ_TARGET(skeleton_json, bytes) {
  geometry::Skeleton skeleton;
  if (!Accepts([&] { skeleton = geometry::SkeletonFromJson(std::string(bytes), "pose3d.json", "skeleton"); })) return;
  RequireSound(skeleton);
  RequireKept(skeleton);
}

}  // namespace mvstudio::fuzz
