#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "core/disk/files.h"
#include "core/format.h"
#include "core/statistics.h"
#include "dataset/markers/gait_events.h"
#include "dataset/markers/joint_angles.h"
#include "stages/people/marker_export.h"

namespace mvstudio::stages {
namespace {

bool HasUp(const dataset::Pose3d& pose) { return pose.world.find("axes of camera ") == std::string::npos; }

AngleReport::Angle AngleFigures(const markers::AngleTake& take, size_t angle) {
  std::vector<double> values, sigmas;
  AngleReport::Angle figures;
  figures.name = markers::AngleDefinitions()[angle].name;
  for (int f = 0; f < take.num_frames(); ++f) {
    const markers::Angle& at = take.At(f, angle);
    if (at.status != markers::AngleStatus::kOk) {
      ++figures.missing[std::string(ToString(at.status))];
      continue;
    }
    values.push_back(at.deg);
    if (std::isfinite(at.sigma_deg)) sigmas.push_back(at.sigma_deg);
  }
  figures.num_frames = static_cast<int>(values.size());
  if (values.empty()) return figures;
  figures.min_deg = *std::min_element(values.begin(), values.end());
  figures.max_deg = *std::max_element(values.begin(), values.end());
  figures.median_sigma_deg = UpperMedian(std::move(sigmas), std::nan(""));
  return figures;
}

}  // namespace

AngleFiles AnglesOfPerson(const markers::MarkerTake& take, const dataset::Pose3d& pose, const std::string& name) {
  std::map<std::pair<int, std::string>, const dataset::JointRow*> rows;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.person == take.person && row.status == Status::kOk) rows[{row.frame, row.joint}] = &row;
  }
  const auto covariance = [&](int frame, const std::string& joint) -> std::optional<Eigen::Matrix3d> {
    const auto found = rows.find({frame, joint});
    if (found == rows.end()) return std::nullopt;
    const dataset::JointRow& row = *found->second;
    if (row.covariance) return row.covariance;
    if (!(row.sigma_m > 0)) return std::nullopt;
    return Eigen::Matrix3d(row.sigma_m * row.sigma_m * Eigen::Matrix3d::Identity());
  };
  const markers::AngleTake angles = AnglesOf(take, HasUp(pose), covariance);
  AngleFiles files;
  files.csv = AnglesCsvText(angles), files.mot = MotText(angles, name);
  files.report.num_frames = angles.num_frames();
  for (size_t a = 0; a < markers::AngleDefinitions().size(); ++a) files.report.angles.push_back(AngleFigures(angles, a));
  return files;
}

std::vector<GaitOfPerson> WriteGaitEvents(const std::vector<MarkerWork>& work, const dataset::Pose3d& pose,
                                          const std::string& folder, const std::string& final_folder) {
  std::vector<GaitOfPerson> persons;
  for (const MarkerWork& person : work) {
    GaitOfPerson& gait = persons.emplace_back();
    gait.person = person.after.person, gait.report = FindGaitEvents(person.after, HasUp(pose));
    if (gait.report.events.empty()) continue;
    const std::string name = "person" + std::to_string(gait.person) + ".events.csv";
    WriteFileAtomic((std::filesystem::path(folder) / name).string(), GaitCsvText(gait.report, person.after));
    gait.file = (std::filesystem::path(final_folder) / name).string();
  }
  return persons;
}

}  // namespace mvstudio::stages
