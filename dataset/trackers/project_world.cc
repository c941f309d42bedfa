#include "dataset/trackers/project_world.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "core/csv.h"
#include "core/error.h"
#include "core/statistics.h"
#include "core/text/shortest_text.h"
#include "core/units.h"

namespace mvstudio::dataset {
namespace {

using Eigen::Vector3d;

/// By coordinates, over all frames and animals.
Vector3d MedianOf(const std::vector<JointRow>& rows, const std::string& joint, const std::string& path) {
  std::vector<double> values[3];
  for (const JointRow& row : rows) {
    if (row.joint != joint || row.status != Status::kOk) continue;
    for (int k = 0; k < 3; ++k) values[k].push_back(row.x_in_world[k]);
  }
  if (values[0].empty())
    throw FormatError(path, "triangulation.axes", "no point of the take is called `" + joint + "`, or it has no position");
  Vector3d median;
  for (int k = 0; k < 3; ++k) {
    std::vector<double>& v = values[k];
    std::sort(v.begin(), v.end());
    median[k] = (v[(v.size() - 1) / 2] + v[v.size() / 2]) / 2;
  }
  return median;
}

}  // namespace

ProjectWorld WorldOfProject(const ProjectSettings& settings, const std::vector<JointRow>& rows, const std::string& path) {
  ProjectWorld world;
  world.text = "right-handed, of the project's configuration:";
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  if (settings.axes.size() == 2) {
    const ProjectSettings::Axis &first = settings.axes[0], &second = settings.axes[1];
    const Vector3d a = MedianOf(rows, first.to, path) - MedianOf(rows, first.from, path);
    const Vector3d b = MedianOf(rows, second.to, path) - MedianOf(rows, second.from, path);
    const Vector3d across = b - b.dot(a) / a.squaredNorm() * a;
    constexpr double kLeastSine = 0.02;
    if (!(a.norm() > 0) || !(across.norm() > kLeastSine * b.norm()))
      throw FormatError(path, "triangulation.axes", "both axes have the same direction in this take");
    const int i = first.axis - 'x', j = second.axis - 'x', k = 3 - i - j;
    axes.row(i) = a.normalized(), axes.row(j) = across.normalized();
    const Eigen::RowVector3d third = axes.row(i).cross(axes.row(j));
    axes.row(k) = (j - i + 3) % 3 == 1 ? third : Eigen::RowVector3d(-third);
    for (const ProjectSettings::Axis& axis : settings.axes)
      world.text += std::string(" ") + axis.axis + " from " + axis.from + " to " + axis.to + ",";
  }
  world.new_from_old.rotation = axes;
  if (!settings.reference_point.empty()) {
    world.new_from_old.translation = -(axes * MedianOf(rows, settings.reference_point, path));
    world.text += " origin at " + settings.reference_point + ",";
  }
  world.text.pop_back();
  return world;
}

void MoveTo(const ProjectWorld& world, std::vector<JointRow>* rows) {
  const Eigen::Matrix3d rotation(world.new_from_old.rotation);
  for (JointRow& row : *rows) {
    if (row.status != Status::kOk) continue;
    row.x_in_world = rotation * row.x_in_world + world.new_from_old.translation;
    if (row.covariance) row.covariance = Eigen::Matrix3d(rotation * *row.covariance * rotation.transpose());
  }
}

std::string ProjectAnglesCsv(const ProjectSettings& settings, const std::vector<JointRow>& rows) {
  std::map<std::pair<int, int>, std::map<std::string, Vector3d>> postures;
  for (const JointRow& row : rows) {
    if (row.status == Status::kOk) postures[{row.frame, row.person}][row.joint] = row.x_in_world;
  }
  std::string text = "frame,person,angle,value_deg\n";
  for (const auto& [key, joints] : postures) {
    for (const ProjectSettings::HingeAngle& angle : settings.angles) {
      const auto a = joints.find(angle.joints[0]), b = joints.find(angle.joints[1]), c = joints.find(angle.joints[2]);
      if (a == joints.end() || b == joints.end() || c == joints.end()) continue;
      const Vector3d u = a->second - b->second, v = c->second - b->second;
      text += std::to_string(key.first) + "," + std::to_string(key.second) + "," + CsvCell(angle.name) + ",";
      AppendShortestText(RadToDeg(std::atan2(u.cross(v).norm(), u.dot(v))), &text);
      text += "\n";
    }
  }
  return text;
}

}  // namespace mvstudio::dataset
