#include "stages/align/describe.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/format.h"
#include "core/units.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibration_use.h"

namespace mvstudio::stages {
namespace {

using calib::RigAlignment;
using nlohmann::ordered_json;

/// What was put right about the corners.
CommandResult DescribeFindings(const calib::CornerFindings& found) {
  CommandResult result;
  for (const calib::RotatedCamera& camera : found.rotated)
    result.warnings.push_back(
        {"CAL-NUMBERING", NumberingText(camera), "use a board with an odd and an even number of corners, or one with markers"});
  if (!found.numbers_text.empty())
    result.warnings.push_back(
        {"CAL-FRAMES", found.numbers_text, "number the frames by their time stamps, or give them as option 'timestamps' FILE"});
  return result;
}

CommandResult DescribeFloor(const FeetFloor& floor) {
  const double sigma_deg = RadToDeg(floor.tilt_sigma_rad), rotated_deg = RadToDeg(floor.rotated_rad);
  CommandResult result;
  ordered_json& json = result.metrics["floor"];
  json["tilt_sigma_deg"] = FiniteOrNull(sigma_deg);
  json["turned_deg"] = FiniteOrNull(rotated_deg);
  json["level"] = floor.level;
  json["joint_height_mm"] = ordered_json::object();
  for (const auto& [joint, height_m] : floor.joint_height_m) json["joint_height_mm"][joint] = FiniteOrNull(1e3 * height_m);
  if (floor.status != Status::kOk) return result;
  result.text =
      Format("z turned by %.2f degrees, tilt known to %.2f degrees; z = 0: %s\n", rotated_deg, sigma_deg, floor.level.c_str());
  constexpr double kMostTiltDeg = 1;
  if (sigma_deg > kMostTiltDeg) {
    result.warnings.push_back({"CAL-FLOOR", Format("the floor's tilt is known to %.1f degrees only", sigma_deg),
                               "let people walk about more, in more than one direction"});
  }
  return result;
}

ordered_json AlignMotionJson(const geometry::Rigid3& new_from_old) {
  const Eigen::Quaterniond& q = new_from_old.rotation;
  const Eigen::Vector3d& t = new_from_old.translation;
  return {{"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}}, {"translation", {t.x(), t.y(), t.z()}}};
}

CommandResult DescribeUnaligned(const RigAlignment& aligned) {
  CommandResult result;
  result.exit = kExitIllPosed;
  result.errors.push_back({"CAL-UNSOLVED", aligned.message, "status " + std::string(ToString(aligned.status))});
  return result;
}

CommandResult DescribeAlignment(const RigAlignment& aligned, bool by_lengths) {
  CommandResult result;
  ordered_json& m = result.metrics;
  m["status"] = std::string(ToString(aligned.status));
  m["num_points"] = aligned.num_points, m["num_used"] = aligned.num_used;
  m["rms_px"] = FiniteOrNull(aligned.rms_px), m["rms_mm"] = FiniteOrNull(1e3 * aligned.rms_m);
  for (const std::string& point : aligned.gross)
    result.warnings.push_back({"CAL-CLICK", point + " off", "mark it again, or check its coordinates"});
  if (aligned.status != Status::kOk) return result;
  m["new_from_old"] = AlignMotionJson(aligned.new_from_old);
  m["scale"] = aligned.scale;
  m["gauge"] = GaugeText(aligned.rig.gauge);
  if (by_lengths) return result;
  const std::string rms = std::isfinite(aligned.rms_px) ? Format("%.3f px", aligned.rms_px) : LengthText(aligned.rms_m);
  result.text = Format("%d of %d points, rms %s", aligned.num_used, aligned.num_points, rms.c_str());
  if (aligned.scale != 1) result.text += Format(", scale %.6f", aligned.scale);
  result.text += "\n";
  return result;
}

/// A board that does not lie where the rig says it is.
CommandResult DescribeMisfit(const AlignReport& report) {
  constexpr double kMostPx = 1;
  CommandResult result;
  if (!(report.aligned.rms_px > kMostPx) || report.options.floor_board < 0) return result;
  result.warnings.push_back({"CAL-ALIGN",
                             Format("the board lies %.2f px (rms) off the rig's projections", report.aligned.rms_px),
                             "check the board's squares, and with mvstudio calib eval whether a camera has moved"});
  return result;
}

/// Where the cameras are beside the floor.
CommandResult DescribeHeights(const geometry::Rig& rig, bool has_floor) {
  CommandResult result;
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  size_t below = 0;
  ordered_json& heights = result.metrics["camera_height_m"] = ordered_json::object();
  for (const geometry::RigCamera& camera : rig.cameras) {
    const double z = camera.CenterInWorld().z();
    heights[camera.camera.name] = FiniteOrNull(z);
    lowest = std::min(lowest, z), highest = std::max(highest, z), below += z < 0;
  }
  result.text =
      Format("cameras between z = %.2f and %.2f m; world fixed by: %s\n", lowest, highest, GaugeText(rig.gauge).c_str());
  if (!has_floor || below == 0) return result;
  result.warnings.push_back({"CAL-FLOOR", Format("%zu of %zu cameras are below the floor", below, rig.cameras.size()),
                             "check the frame of the board, or whether the people's joints are those of this calibration"});
  return result;
}

}  // namespace

CommandResult Describe(const AlignReport& report) {
  const RigAlignment& aligned = report.aligned;
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  if (report.options.floor_board >= 0) result.text = RemarksOn(report.corners);
  result.Add(DescribeFindings(report.found));
  if (report.floor) result.Add(DescribeFloor(*report.floor));
  const bool solved = aligned.status == Status::kOk, by_lengths = report.lengths.has_value();
  if (by_lengths && solved) result.Add(DescribeLengths(*report.lengths));
  result.Add(DescribeAlignment(aligned, by_lengths));
  if (!solved) {
    result.Add(DescribeUnaligned(aligned));
    return result;
  }
  result.Add(DescribeMisfit(report));
  result.Add(DescribeHeights(aligned.rig, report.HasFloor()));
  result.outputs.push_back({report.options.out, "calibration"});
  result.Add(DescribeWrittenCovariance(aligned.rig, aligned.unknown));
  return result;
}

}  // namespace mvstudio::stages
