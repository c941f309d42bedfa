#include <algorithm>
#include <cmath>

#include "core/format.h"
#include "core/text/one_line.h"
#include "geometry/rig/lenses_only.h"
#include "stages/calib_files/describe.h"

namespace mvstudio::stages {
namespace {

using geometry::Rig;
using geometry::RigCamera;
using nlohmann::ordered_json;

/// "-" where the lens does not reach the image's edge.
std::string DegreesCell(double degrees) { return std::isfinite(degrees) ? Format("%4.0f", degrees) : std::string("   -"); }

std::string RigTable(const Rig& rig) {
  std::string text = Format("%-14s %-14s %11s %9s %9s %9s %9s  %-15s %26s %9s %s\n", "camera", "lens", "size px", "fx px",
                            "fy px", "cx px", "cy px", "fov deg", "position in world m", "sigma f", "sigma position mm");
  for (const RigCamera& camera : rig.cameras) {
    const geometry::Camera& c = camera.camera;
    const Eigen::Vector3d at = camera.CenterInWorld() + Eigen::Vector3d::Zero();  // no -0
    const Eigen::Vector3d fov = FieldOfViewDeg(c);
    const CameraSigmas sigmas = SigmasOf(camera);
    text += Format("%-14s %-14s %5d x %-4d %9.2f %9.2f %9.2f %9.2f  %s %s %s  %8.3f %8.3f %8.3f", OneLine(c.name).c_str(),
                   std::string(geometry::ToString(c.model)).c_str(), c.width_px, c.height_px, c.fx(), c.fy(), c.cx(), c.cy(),
                   DegreesCell(fov[0]).c_str(), DegreesCell(fov[1]).c_str(), DegreesCell(fov[2]).c_str(), at[0], at[1], at[2]);
    text += std::isfinite(sigmas.focal_px) ? Format(" %9.3f", sigmas.focal_px) : std::string("         -");
    text += std::isfinite(sigmas.position_m) ? Format(" %8.3f\n", 1e3 * sigmas.position_m) : std::string("        -\n");
    const std::vector<std::string> names = geometry::ParamNames(c);
    const Eigen::Index shown = std::min<Eigen::Index>(c.params.size(), 16);
    for (Eigen::Index i = 4; i < shown; ++i) {
      text += (i == 4 ? "               " : " ") + names[static_cast<size_t>(i)] + Format("=%.6g", c.params[i]);
    }
    if (shown < c.params.size()) text += Format(" … %d more", static_cast<int>(c.params.size() - shown));
    if (c.params.size() > 4) text += "\n";
  }
  return text;
}

/// Distances of the camera centres, m. (C, C)
Eigen::MatrixXd Baselines(const Rig& rig) {
  const Eigen::Index count = static_cast<Eigen::Index>(rig.cameras.size());
  Eigen::MatrixXd baselines(count, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j) {
      baselines(i, j) = (rig.cameras[i].CenterInWorld() - rig.cameras[j].CenterInWorld()).norm();
    }
  }
  return baselines;
}

std::string BaselineTable(const Rig& rig, const Eigen::MatrixXd& baselines) {
  constexpr size_t kMax = 12;
  std::string text = "distances between cameras, m\n               ";
  const size_t count = std::min(rig.cameras.size(), kMax);
  for (size_t j = 0; j < count; ++j) text += Format(" %8.8s", OneLine(rig.cameras[j].camera.name).c_str());
  for (size_t i = 0; i < count; ++i) {
    text += Format("\n%-15.15s", OneLine(rig.cameras[i].camera.name).c_str());
    for (size_t j = 0; j < count; ++j)
      text += Format(" %8.4f", baselines(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
  }
  return text + (rig.cameras.size() > kMax ? "\n(the others are in the JSON)\n" : "\n");
}

}  // namespace

CommandResult Describe(const CalibShowReport& report) {
  const Rig& rig = report.rig;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.Add(DescribeCameras(rig));
  const std::string gauge = GaugeText(rig.gauge);
  result.metrics["gauge"] = gauge;
  const Eigen::MatrixXd baselines = Baselines(rig);
  auto& rows = result.metrics["baselines_m"] = ordered_json::array();
  for (Eigen::Index i = 0; i < baselines.rows(); ++i) {
    rows.push_back(std::vector<double>(baselines.col(i).data(), baselines.col(i).data() + baselines.rows()));
  }
  result.text = RigTable(rig);
  if (rig.cameras.size() > 1 && !geometry::HasLensesOnly(rig)) result.text += BaselineTable(rig, baselines);
  result.text += "world frame fixed by: " + (gauge.empty() ? "(not said)" : OneLine(gauge));
  return result;
}

}  // namespace mvstudio::stages
