#include "dataset/pose/pose3d_compare.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/statistics.h"
#include "geometry/rig/alignment.h"

namespace mvstudio::dataset {
namespace {

using JointsByName = std::map<std::string, JointRow>;
struct Pair {
  const JointRow* joint;
  const JointRow* reference;
};

// Quantiles of chi-squared with 3 degrees of freedom.
constexpr double kChiSquared68 = 3.5058820;
constexpr double kChiSquared95 = 7.8147279;

std::vector<Pair> PairPersons(const JointsByName& person, const std::map<int, JointsByName>& references) {
  std::vector<Pair> best;
  double best_mean = std::numeric_limits<double>::infinity();
  for (const auto& [id, reference] : references) {
    std::vector<Pair> pairs;
    double sum = 0;
    for (const auto& [name, joint] : person) {
      const auto it = reference.find(name);
      if (it == reference.end()) continue;
      pairs.push_back({&joint, &it->second});
      sum += (joint.x_in_world - it->second.x_in_world).norm();
    }
    if (pairs.empty() || sum / static_cast<double>(pairs.size()) >= best_mean) continue;
    best_mean = sum / static_cast<double>(pairs.size());
    best = std::move(pairs);
  }
  return best;
}

std::vector<Pair> PairAll(const JointTable& pose, const JointTable& reference) {
  std::vector<Pair> pairs;
  for (const auto& [frame, persons] : pose) {
    const auto it = reference.find(frame);
    if (it == reference.end()) continue;
    for (const auto& [id, person] : persons) {
      const std::vector<Pair> of_person = PairPersons(person, it->second);
      pairs.insert(pairs.end(), of_person.begin(), of_person.end());
    }
  }
  return pairs;
}

geometry::Rigid3 Align(const std::vector<Pair>& pairs, bool* aligned) {
  Eigen::Matrix3Xd from(3, pairs.size()), to(3, pairs.size());
  for (size_t i = 0; i < pairs.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = pairs[i].joint->x_in_world;
    to.col(static_cast<Eigen::Index>(i)) = pairs[i].reference->x_in_world;
  }
  const geometry::Alignment alignment = geometry::AlignPoints(from, to);
  *aligned = alignment.status == Status::kOk;
  return *aligned ? alignment.b_from_a : geometry::Rigid3{};
}

void CountCoverage(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance, Pose3dComparison* result) {
  const Eigen::LLT<Eigen::Matrix3d> factor(covariance);
  if (factor.info() != Eigen::Success) return;
  const double distance = error.dot(factor.solve(error));
  ++result->num_covariance;
  result->coverage68 += distance <= kChiSquared68;
  result->coverage95 += distance <= kChiSquared95;
}

void Summarize(std::vector<double> distances_mm, Pose3dComparison* result) {
  std::sort(distances_mm.begin(), distances_mm.end());
  const size_t n = distances_mm.size();
  result->num = static_cast<int>(n);
  if (n == 0) return;
  for (const double distance : distances_mm) result->mean_mm += distance / static_cast<double>(n);
  result->median_mm = LinearQuantile(distances_mm, 0.5);
  result->p95_mm = ShareQuantile(distances_mm, 0.95);
  result->max_mm = distances_mm.back();
}

/// Covariance of the mean of independent joints.
std::optional<Eigen::Matrix3d> MeanCovariance(const std::vector<const JointRow*>& joints) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const JointRow* joint : joints) {
    if (!joint->covariance) return std::nullopt;
    sum += *joint->covariance;
  }
  return sum / static_cast<double>(joints.size() * joints.size());
}

}  // namespace

JointTable ToTable(const std::vector<JointRow>& rows) {
  JointTable table;
  for (const JointRow& row : rows) {
    if (row.status == Status::kOk) table[row.frame][row.person][row.joint] = row;
  }
  return table;
}

JointTable ToTable(const std::map<int, std::map<int, Coco19Pose>>& poses) {
  JointTable table;
  for (const auto& [frame, persons] : poses) {
    for (const auto& [person, pose] : persons) {
      for (int k = 0; k < 19; ++k) {
        if (!pose.valid[k]) continue;
        JointRow& row = table[frame][person][body::Coco19().joints[k]];
        row.status = Status::kOk;
        row.x_in_world = pose.x_in_world.col(k);
      }
    }
  }
  return table;
}

JointTable ToCoco19Table(const Pose3d& pose) {
  const body::Skeleton skeleton = SkeletonOf(pose);
  const auto sources = body::Coco19From(skeleton);
  const JointTable joints = ToTable(pose.rows);
  JointTable table = ToTable(ToCoco19(pose));
  for (auto& [frame, persons] : table) {
    for (auto& [person, rows] : persons) {
      for (int k = 0; k < 19; ++k) {
        const auto row = rows.find(body::Coco19().joints[k]);
        if (row == rows.end()) continue;
        std::vector<const JointRow*> from;
        for (const int source : sources[k]) from.push_back(&joints.at(frame).at(person).at(skeleton.joints[source]));
        row->second.covariance = MeanCovariance(from);
      }
    }
  }
  return table;
}

Pose3dComparison ComparePose3d(const JointTable& pose, const JointTable& reference, bool align) {
  Pose3dComparison result;
  const std::vector<Pair> pairs = PairAll(pose, reference);
  geometry::Rigid3 reference_from_pose;
  if (align) reference_from_pose = Align(pairs, &result.aligned);
  const Eigen::Matrix3d rotation = reference_from_pose.rotation.toRotationMatrix();
  std::vector<double> distances_mm;
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d error = reference_from_pose * pair.joint->x_in_world - pair.reference->x_in_world;
    distances_mm.push_back(1000 * error.norm());
    if (pair.joint->covariance) CountCoverage(error, rotation * *pair.joint->covariance * rotation.transpose(), &result);
  }
  Summarize(std::move(distances_mm), &result);
  if (result.num_covariance > 0) {
    result.coverage68 /= result.num_covariance;
    result.coverage95 /= result.num_covariance;
  }
  return result;
}

}  // namespace mvstudio::dataset
