#include "avatar/body/files/person_check.h"

#include <cmath>
#include <set>

#include "avatar/body/offset_net/offset_net.h"
#include "core/label.h"

namespace mvstudio::body::internal {
namespace {

constexpr float kWeightSumTolerance = 1e-4f;

using Problem = std::optional<BodyProblem>;

std::string Number(Eigen::Index value) { return std::to_string(value); }

Problem SizeProblem(const char* array, Eigen::Index size, Eigen::Index wanted) {
  if (size == wanted) return {};
  return BodyProblem{array, "has " + Number(size) + " rows, not " + Number(wanted)};
}

template <class Derived>
Problem NumberProblem(const char* array, const Eigen::DenseBase<Derived>& values) {
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    for (Eigen::Index row = 0; row < values.rows(); ++row) {
      if (!(std::abs(values(row, column)) <= kMaxCoordinate))
        return BodyProblem{array, "row " + Number(column) + " holds a number that is not finite or beyond 1000"};
    }
  }
  return {};
}

/// `noun` is what a value numbers, `first` and `end` its range.
template <class Derived>
Problem RangeProblem(const char* array, const Eigen::DenseBase<Derived>& values, const char* noun, Eigen::Index first,
                     Eigen::Index end) {
  for (Eigen::Index column = 0; column < values.cols(); ++column) {
    for (Eigen::Index row = 0; row < values.rows(); ++row) {
      if (values(row, column) < first || values(row, column) >= end)
        return BodyProblem{array, "row " + Number(column) + " has " + noun + " " + std::to_string(values(row, column))};
    }
  }
  return {};
}

Eigen::Map<const Eigen::RowVectorXi> RowOf(const std::vector<int>& values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

Problem MeshProblem(const BodyTemplate& body) {
  const Eigen::Index vertices = body.vertices.cols(), faces = body.faces.cols();
  if (vertices == 0) return BodyProblem{"vertices", "is empty"};
  if (faces == 0) return BodyProblem{"faces", "is empty"};
  if (auto p = NumberProblem("vertices", body.vertices)) return p;
  if (auto p = RangeProblem("faces", body.faces, "the vertex", 0, vertices)) return p;
  if (auto p = SizeProblem("face_part", static_cast<Eigen::Index>(body.face_part.size()), faces)) return p;
  if (auto p = RangeProblem("face_part", RowOf(body.face_part), "the part", 1, kNumParts + 1)) return p;
  if (auto p = SizeProblem("face_uv", body.face_uv.cols(), 3 * faces)) return p;
  for (Eigen::Index i = 0; i < body.face_uv.cols(); ++i) {
    for (const float value : {body.face_uv(0, i), body.face_uv(1, i)}) {
      if (!(value >= 0 && value <= 1)) return BodyProblem{"face_uv", "row " + Number(i / 3) + " leaves [0, 1]"};
    }
  }
  return {};
}

Problem NamesProblem(const std::vector<std::string>& names) {
  if (names.empty()) return BodyProblem{"bone_names", "is empty"};
  if (names.size() > kMaxBones) return BodyProblem{"bone_names", "has more than 65,535 rows"};
  std::set<std::string> seen;
  for (const std::string& name : names) {
    const std::string why = WhyNotALabel(name);
    if (!why.empty()) return BodyProblem{"bone_names", "a name " + why};
    if (!seen.insert(name).second) return BodyProblem{"bone_names", "has two bones called '" + name + "'"};
  }
  return {};
}

Problem BonesProblem(const BodyTemplate& body) {
  if (auto p = NamesProblem(body.bone_names)) return p;
  const auto bones = static_cast<Eigen::Index>(body.bone_names.size());
  if (auto p = SizeProblem("bone_parents", static_cast<Eigen::Index>(body.bone_parents.size()), bones)) return p;
  if (auto p = SizeProblem("bone_roles", static_cast<Eigen::Index>(body.bone_roles.size()), bones)) return p;
  for (const BoneRole role : body.bone_roles) {
    const int number = static_cast<int>(role);
    if (number < 0 || number >= kNumBoneRoles) return BodyProblem{"bone_roles", "has the role " + std::to_string(number)};
  }
  if (body.bone_parents[0] != -1) return BodyProblem{"bone_parents", "does not begin with the root, -1"};
  for (int b = 1; b < static_cast<int>(bones); ++b) {
    const int parent = body.bone_parents[static_cast<size_t>(b)];
    if (parent < 0 || parent >= b)
      return BodyProblem{"bone_parents", "row " + Number(b) + " has the parent " + Number(parent) + ", which is not before it"};
  }
  if (auto p = SizeProblem("bone_heads", body.bone_heads.cols(), bones)) return p;
  if (auto p = NumberProblem("bone_heads", body.bone_heads)) return p;
  if (auto p = SizeProblem("bone_tails", body.bone_tails.cols(), bones)) return p;
  return NumberProblem("bone_tails", body.bone_tails);
}

Problem SkinProblem(const BodyTemplate& body) {
  const auto bones = static_cast<Eigen::Index>(body.bone_names.size());
  if (auto p = SizeProblem("skin_bones", body.skin_bones.cols(), body.vertices.cols())) return p;
  if (auto p = RangeProblem("skin_bones", body.skin_bones, "the bone", 0, bones)) return p;
  if (auto p = SizeProblem("skin_weights", body.skin_weights.cols(), body.vertices.cols())) return p;
  for (Eigen::Index i = 0; i < body.skin_weights.cols(); ++i) {
    const Eigen::Vector4f weights = body.skin_weights.col(i);
    if (!(weights.minCoeff() >= 0)) return BodyProblem{"skin_weights", "row " + Number(i) + " has a weight below 0 or none"};
    if (!(std::abs(weights.sum() - 1) <= kWeightSumTolerance))
      return BodyProblem{"skin_weights", "row " + Number(i) + " does not sum to 1"};
  }
  return {};
}

}  // namespace

std::optional<BodyProblem> ProblemOf(const BodyTemplate& body) {
  if (auto p = MeshProblem(body)) return p;
  if (auto p = BonesProblem(body)) return p;
  if (auto p = SkinProblem(body)) return p;
  if (body.pose_directions.size() > 0) {
    const auto wanted = 9 * (static_cast<Eigen::Index>(body.bone_names.size()) - 1);
    if (auto p = SizeProblem("pose_directions", body.pose_directions.cols(), wanted)) return p;
    if (auto p = SizeProblem("pose_directions", body.pose_directions.rows(), 3 * body.vertices.cols())) return p;
    if (auto p = NumberProblem("pose_directions", body.pose_directions)) return p;
  }
  if (body.moving_offsets) {
    const auto* net = dynamic_cast<const OffsetNet*>(body.moving_offsets.get());
    if (net == nullptr) return BodyProblem{"moving_offsets", "are of a kind that has no file"};
    if (auto p = SizeProblem("moving_offsets", net->num_vertices(), body.vertices.cols())) return p;
  }
  if (auto p = SizeProblem("coco19", body.coco19.cols(), 19)) return p;
  if (auto p = NumberProblem("coco19", body.coco19)) return p;
  const Eigen::Map<const Eigen::Matrix<int, 1, 19>> bones(body.coco19_bone.data());
  return RangeProblem("coco19_bone", bones, "the bone", 0, static_cast<Eigen::Index>(body.bone_names.size()));
}

}  // namespace mvstudio::body::internal
