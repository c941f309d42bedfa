#include "avatar/splats/bend.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/check.h"

namespace mvstudio::splats {
namespace {

/// Sums over the vertices of a bone.
struct BoneSums {
  double weight = 0;
  Eigen::Vector3d rest = Eigen::Vector3d::Zero(), posed = Eigen::Vector3d::Zero();
  Eigen::Matrix3d product = Eigen::Matrix3d::Zero();  // posed times rest
};

std::vector<BoneSums> SumsOf(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices) {
  std::vector<BoneSums> sums(body.bone_parents.size());
  for (Eigen::Index i = 0; i < vertices.cols(); ++i) {
    Eigen::Index most = 0;
    const double share = body.skin_weights.col(i).maxCoeff(&most), weight = std::pow(share, 8);
    const Eigen::Vector3d rest = body.vertices.col(i).cast<double>(), posed = vertices.col(i).cast<double>();
    if (!(weight > 0) || !posed.allFinite()) continue;
    BoneSums& sum = sums[static_cast<size_t>(body.skin_bones(most, i))];
    sum.weight += weight;
    sum.rest += weight * rest, sum.posed += weight * posed;
    sum.product += weight * posed * rest.transpose();
  }
  return sums;
}

/// world_from_body of a bone; nothing where its vertices lie on a line.
std::optional<Eigen::Matrix3d> RotationOf(const BoneSums& sum) {
  if (!(sum.weight > 0)) return std::nullopt;
  const Eigen::Matrix3d covariance = sum.product - sum.posed * sum.rest.transpose() / sum.weight;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  constexpr double kLeast = 1e-6;  // of the largest: a plane has two
  if (!(svd.singularValues()[1] > kLeast * svd.singularValues()[0]) || !(svd.singularValues()[0] > 1e-12)) return std::nullopt;
  Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

/// Calls `visit(coefficient index, factor of it, kind)` for each number of Gaussian i that is not multiplied by 0; kinds 0:
/// offset, 1: opacity, 2 to 4: R, G, B.
template <class S, class Visitor>
void ForEachBend(const BasicCloud<S>& cloud, size_t i, const Bending<S>& bending, Visitor&& visit) {
  constexpr S kUnits[kBendKinds] = {S(kBendOffset), S(kBendOpacity), S(kBendColour), S(kBendColour), S(kBendColour)};
  for (int slot = 0; slot < kBendBones; ++slot) {
    const int bone = bending.bones(slot, cloud.face[i]);
    if (bone < 0) continue;
    for (int axis = 0; axis < 3; ++axis) {
      const S turn = bending.turns(axis, bone);
      if (turn == 0) continue;
      const size_t at = i * static_cast<size_t>(kBendSize) + static_cast<size_t>((slot * 3 + axis) * kBendKinds);
      for (int kind = 0; kind < kBendKinds; ++kind) visit(at + static_cast<size_t>(kind), turn * kUnits[kind], kind);
    }
  }
}

/// The number of a Gaussian that a kind changes.
template <class P>
auto& Changed(P& values, size_t i, int kind) {
  if (kind == 0) return values.offset[i];
  if (kind == 1) return values.opacity[i];
  return values.colour[i * static_cast<size_t>(3 * BasisSize(values.degree)) + static_cast<size_t>(kind - 2)];
}

}  // namespace

Eigen::Matrix3Xf BoneTurns(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices) {
  MVS_CHECK(vertices.cols() == body.vertices.cols(), vertices.cols() << " vertices of a body of " << body.vertices.cols());
  const std::vector<BoneSums> sums = SumsOf(body, vertices);
  std::vector<Eigen::Matrix3d> rotations;
  Eigen::Matrix3Xf turns = Eigen::Matrix3Xf::Zero(3, static_cast<Eigen::Index>(sums.size()));
  for (size_t b = 0; b < sums.size(); ++b) {
    const int parent = body.bone_parents[b];
    const Eigen::Matrix3d around = parent < 0 ? Eigen::Matrix3d::Identity() : rotations[static_cast<size_t>(parent)];
    rotations.push_back(RotationOf(sums[b]).value_or(around));
    if (parent < 0) continue;
    const Eigen::AngleAxisd turn(Eigen::Matrix3d(around.transpose() * rotations[b]));
    turns.col(static_cast<Eigen::Index>(b)) = (turn.angle() * turn.axis()).cast<float>();
  }
  return turns;
}

Eigen::Matrix2Xi BonesOfFaces(const body::BodyTemplate& body) {
  Eigen::Matrix2Xi out = Eigen::Matrix2Xi::Constant(2, body.faces.cols(), -1);
  std::vector<float> total(body.bone_parents.size(), 0.f);
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    std::array<int, 12> bones;
    for (int k = 0; k < 12; ++k) {
      const int vertex = body.faces(k / 4, f);
      bones[static_cast<size_t>(k)] = body.skin_bones(k % 4, vertex);
      total[static_cast<size_t>(body.skin_bones(k % 4, vertex))] += body.skin_weights(k % 4, vertex);
    }
    std::sort(bones.begin(), bones.end());
    for (int slot = 0; slot < kBendBones; ++slot) {
      float most = 0;
      for (const int bone : bones)
        if (total[static_cast<size_t>(bone)] > most) most = total[static_cast<size_t>(bone)], out(slot, f) = bone;
      if (out(slot, f) >= 0) total[static_cast<size_t>(out(slot, f))] = 0;
    }
    for (const int bone : bones) total[static_cast<size_t>(bone)] = 0;
  }
  return out;
}

template <class S>
BasicCloud<S> Bent(const BasicCloud<S>& cloud, const Bending<S>& bending) {
  if (!cloud.values.bends) return cloud;
  BasicCloud<S> out = cloud;
  out.values.bends = false, out.values.bend.clear();
  for (size_t i = 0; i < cloud.size(); ++i)
    ForEachBend(cloud, i, bending,
                [&](size_t at, S factor, int kind) { Changed(out.values, i, kind) += factor * cloud.values.bend[at]; });
  return out;
}

template <class S>
void AddBendGradient(const BasicCloud<S>& cloud, const Bending<S>& bending, const Parameters<S>& by_bent, Parameters<S>* out) {
  MVS_CHECK(cloud.values.bends == out->bends && by_bent.size() == cloud.size(), "gradients of another cloud");
  if (!cloud.values.bends) return;
  for (size_t i = 0; i < cloud.size(); ++i)
    ForEachBend(cloud, i, bending, [&](size_t at, S factor, int kind) { out->bend[at] += factor * Changed(by_bent, i, kind); });
}

template BasicCloud<float> Bent(const BasicCloud<float>&, const Bending<float>&);
template BasicCloud<double> Bent(const BasicCloud<double>&, const Bending<double>&);
template void AddBendGradient(const BasicCloud<float>&, const Bending<float>&, const Parameters<float>&, Parameters<float>*);
template void AddBendGradient(const BasicCloud<double>&, const Bending<double>&, const Parameters<double>&,
                              Parameters<double>*);

}  // namespace mvstudio::splats
