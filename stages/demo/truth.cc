#include "stages/demo/truth.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

#include "core/statistics.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::stages {
namespace {

using JointKey = std::tuple<int, int, std::string>;  ///< frame, person, joint

std::map<JointKey, Eigen::Vector3d> TrueJoints(const std::string& folder) {
  std::map<JointKey, Eigen::Vector3d> truth;
  for (const auto& row : dataset::ReadPose3d(folder).rows) {
    if (row.status == Status::kOk) truth[{row.frame, row.person, row.joint}] = row.x_in_world;
  }
  return truth;
}

double ShareBelow(const std::vector<double>& values, double limit) {
  if (values.empty()) return NAN;
  return static_cast<double>(std::count_if(values.begin(), values.end(), [&](double v) { return v <= limit; })) /
         static_cast<double>(values.size());
}

double MeanOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value / static_cast<double>(values.size());
  return values.empty() ? NAN : sum;
}

}  // namespace

StudioComparison CompareStudio(const std::string& session, const std::string& calibration, const std::string& points) {
  StudioComparison result;
  result.rig = geometry::CompareRigs(geometry::ReadRig(calibration), geometry::ReadRig(session + "/truth/calibration.json"));
  const geometry::Rigid3& truth_from_rig = result.rig.reference_from_rig;
  const Eigen::Matrix3d rotation = truth_from_rig.rotation.toRotationMatrix();
  const std::map<JointKey, Eigen::Vector3d> truth = TrueJoints(session + "/truth/pose3d");
  std::vector<double> errors_mm, sigmas_mm, squared_distances;
  for (const auto& row : dataset::ReadPose3d(points).rows) {
    const auto expected = truth.find({row.frame, row.person, row.joint});
    if (row.status != Status::kOk || expected == truth.end()) continue;
    const Eigen::Vector3d error = truth_from_rig * row.x_in_world - expected->second;
    errors_mm.push_back(1000 * error.norm());
    sigmas_mm.push_back(1000 * row.sigma_m);
    if (!row.covariance) continue;
    const Eigen::Matrix3d covariance = rotation * *row.covariance * rotation.transpose();
    squared_distances.push_back(error.dot(covariance.ldlt().solve(error)));
  }
  result.num_joints = static_cast<int>(errors_mm.size());
  result.joints_median_mm = UpperMedian(errors_mm);
  result.joints_mean_mm = MeanOf(errors_mm);
  result.predicted_sigma_median_mm = UpperMedian(sigmas_mm);
  // Quantiles of the chi-square distribution with three degrees of freedom.
  result.coverage68 = ShareBelow(squared_distances, 3.5059);
  result.coverage95 = ShareBelow(squared_distances, 7.8147);
  return result;
}

}  // namespace mvstudio::stages
