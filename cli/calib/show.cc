#include <algorithm>
#include <cmath>

#include "cli/calib/calib.h"
#include "cli/program/console.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "core/format.h"
#include "core/units.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

using geometry::Rig;
using geometry::RigCamera;
using nlohmann::ordered_json;

struct Arguments {
  stages::CalibReadOptions read;
  std::vector<std::string> in;
};

/// "-" where the lens does not reach the image's edge.
std::string Degrees(double degrees) { return std::isfinite(degrees) ? Format("%4.0f", degrees) : std::string("   -"); }

std::string Table(const Rig& rig) {
  std::string text = Format("%-14s %-14s %11s %9s %9s %9s %9s  %-15s %26s %9s %s\n", "camera", "lens", "size px", "fx px",
                            "fy px", "cx px", "cy px", "fov deg", "position in world m", "sigma f", "sigma position mm");
  for (const RigCamera& camera : rig.cameras) {
    const geometry::Camera& c = camera.camera;
    const Eigen::Vector3d at = camera.CenterInWorld() + Eigen::Vector3d::Zero();  // no -0
    const Eigen::Vector3d fov = stages::FieldOfViewDeg(c);
    const stages::CameraSigmas sigmas = stages::SigmasOf(camera);
    text += Format("%-14s %-14s %5d x %-4d %9.2f %9.2f %9.2f %9.2f  %s %s %s  %8.3f %8.3f %8.3f", OneLine(c.name).c_str(),
                   std::string(geometry::ToString(c.model)).c_str(), c.width_px, c.height_px, c.fx(), c.fy(), c.cx(), c.cy(),
                   Degrees(fov[0]).c_str(), Degrees(fov[1]).c_str(), Degrees(fov[2]).c_str(), at[0], at[1], at[2]);
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

CommandResult Show(const Arguments& arguments) {
  const calib::ImportedRig imported = stages::ReadCalibrationFiles(arguments.in, arguments.read);
  const Rig& rig = imported.rig;
  CommandResult result;
  result.inputs = arguments.in;
  stages::AddNotes(imported.notes, &result);
  stages::AddCameraMetrics(rig, &result);
  result.metrics["gauge"] = GaugeText(rig.gauge);
  const Eigen::MatrixXd baselines = Baselines(rig);
  auto& rows = result.metrics["baselines_m"] = ordered_json::array();
  for (Eigen::Index i = 0; i < baselines.rows(); ++i) {
    rows.push_back(std::vector<double>(baselines.col(i).data(), baselines.col(i).data() + baselines.rows()));
  }
  result.text = Table(rig);
  if (rig.cameras.size() > 1) result.text += BaselineTable(rig, baselines);
  result.text += "world frame fixed by: " + (GaugeText(rig.gauge).empty() ? "(not said)" : OneLine(GaugeText(rig.gauge)));
  return result;
}

}  // namespace

void RegisterCalibShow(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("show", "Print a calibration as a table");
  AddOption(sub, "IN", arguments->in, "calibration file or folder (opencv, mrcal, easymocap: several)")->required();
  AddReadOptions(sub, arguments->read);
  registry.Add(sub, "calib show", [arguments](CommandContext&) { return Show(*arguments); });
}

}  // namespace mvstudio::cli
