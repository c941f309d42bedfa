#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/label.h"
#include "geometry/rig/message_text.h"
#include "geometry/rig/rig_covariance.h"
#include "geometry/rig/rig_io.h"

namespace mvstudio::geometry {
namespace {

using internal::Json;
using internal::Shown;

template <class Derived>
Json VectorToJson(const Eigen::MatrixBase<Derived>& vector) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < vector.size(); ++i) json.push_back(static_cast<double>(vector[i]));
  return json;
}

Json MatrixToJson(const Eigen::MatrixXd& matrix) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) json.push_back(VectorToJson(Eigen::VectorXd(matrix.row(i))));
  return json;
}

Json TimeOffsetToJson(const TimeOffset& offset) {
  Json json = {{"frames", offset.frames}, {"sigma_frames", offset.sigma_frames}};
  if (offset.rate != 0) json["rate"] = offset.rate, json["sigma_rate"] = offset.sigma_rate;
  return json;
}

/// One line for each entry, so that files can be read and compared by eye.
std::string CameraToText(const RigCamera& camera) {
  const bool splined = camera.camera.model == LensModel::kSplined;
  const std::vector<std::string> names = ParamNames(splined ? LensModel::kPinhole : camera.camera.model);
  Json intrinsics;
  for (size_t i = 0; i < names.size(); ++i) intrinsics[names[i]] = camera.camera.params[static_cast<Eigen::Index>(i)];
  if (splined) intrinsics["control_points"] = VectorToJson(camera.camera.params.tail(camera.camera.params.size() - 4));
  Json json;
  json["name"] = camera.camera.name;
  json["model"] = ToString(camera.camera.model);
  json["size_px"] = {camera.camera.width_px, camera.camera.height_px};
  if (splined) {
    const SplineGrid& grid = camera.camera.spline;
    json["spline"] = {{"order", grid.order}, {"cols", grid.cols}, {"rows", grid.rows}, {"fov_x_deg", grid.fov_x_deg}};
  }
  json["intrinsics"] = intrinsics;
  json["cam_from_world"] = {{"rotation_xyzw", VectorToJson(camera.cam_from_world.rotation.coeffs())},
                            {"translation", VectorToJson(camera.cam_from_world.translation)}};
  if (camera.params_covariance) json["intrinsics_covariance"] = MatrixToJson(*camera.params_covariance);
  if (camera.cam_from_world_covariance) json["cam_from_world_covariance"] = MatrixToJson(*camera.cam_from_world_covariance);
  if (camera.time_offset) json["time_offset"] = TimeOffsetToJson(*camera.time_offset);
  std::string text;
  for (const auto& [key, value] : json.items()) {
    text += (text.empty() ? "    {\n      " : ",\n      ") + Json(key).dump() + ": " + value.dump();
  }
  return text + "\n    }";
}

/// One line a row of the lower triangle; why it is left out where it is too large for a text file; nothing where it is absent
/// or stale. Rows of unknown blocks are zero.
std::string JointCovarianceToText(const Rig& rig) {
  if (!HasJointCovariance(rig)) return "";
  const std::string why = WhyJointCovarianceLeftOut(rig);
  if (!why.empty()) return ",\n  \"joint_covariance_left_out\": " + Json(why).dump();
  const Eigen::MatrixXd joint = StatedCovarianceOf(rig).joint;
  std::string text = ",\n  \"joint_covariance_lower\": [\n";
  for (Eigen::Index i = 0; i < joint.rows(); ++i) {
    text += (i ? ",\n    " : "    ") + VectorToJson(Eigen::VectorXd(joint.row(i).head(i + 1))).dump();
  }
  return text + "\n  ]";
}

/// One line a board; nothing without boards.
std::string BoardsToText(const Rig& rig) {
  std::string text;
  for (const RigBoard& board : rig.boards) {
    const Json json{{"board", board.board}, {"bend_m", VectorToJson(board.bend_m)}, {"stretch", VectorToJson(board.stretch)}};
    text += (text.empty() ? "  \"boards\": [\n    " : ",\n    ") + json.dump();
  }
  return text.empty() ? "" : text + "\n  ],\n";
}

void ValidateForWriting(const Rig& rig) {
  MVS_CHECK(!rig.cameras.empty(), "a rig without cameras cannot be written");
  std::set<std::string> names;
  for (const RigCamera& camera : rig.cameras) {
    const std::string who = "camera '" + camera.camera.name + "': ";
    Validate(camera.camera);
    MVS_CHECK(!camera.camera.name.empty() && names.insert(camera.camera.name).second, who << "the name is empty or used twice");
    const std::string why = WhyNotALabel(camera.camera.name);
    if (!why.empty())
      throw UsageError("camera " + Shown(camera.camera.name) + " " + why + ": no calibration can hold that name");
    MVS_CHECK(camera.cam_from_world.translation.allFinite(), who << "the translation is not finite");
    MVS_CHECK(std::abs(camera.cam_from_world.rotation.norm() - 1) < 1e-9, who << "the rotation is not a unit quaternion");
    const auto& params = camera.params_covariance;
    const Eigen::Index count = camera.camera.params.size();
    MVS_CHECK(!params || (params->rows() == count && params->cols() == count && params->allFinite()),
              who << "the covariance of the intrinsics has the wrong size or is not finite");
    MVS_CHECK(!camera.cam_from_world_covariance || camera.cam_from_world_covariance->allFinite(),
              who << "the covariance of cam_from_world is not finite");
    const TimeOffset offset = camera.time_offset.value_or(TimeOffset());
    MVS_CHECK(std::isfinite(offset.frames) && offset.sigma_frames >= 0 && std::isfinite(offset.sigma_frames) &&
                  std::isfinite(offset.rate) && offset.sigma_rate >= 0 && std::isfinite(offset.sigma_rate),
              who << "the time offset is not finite");
  }
  for (const RigBoard& board : rig.boards)
    MVS_CHECK(board.bend_m.allFinite() && board.stretch.allFinite(), "board " << board.board << ": its shape is not finite");
}

}  // namespace

std::string WhyJointCovarianceLeftOut(const Rig& rig) {
  if (!HasJointCovariance(rig) || rig.joint_covariance->rows() <= kMaxJointUnknowns) return "";
  return "the joint covariance has " + std::to_string(rig.joint_covariance->rows()) + " unknowns, a file holds up to " +
         std::to_string(kMaxJointUnknowns) +
         ": every camera keeps its own covariance, the correlations between lenses and poses and between cameras are left out, "
         "and what is computed from the file takes them for independent";
}

std::string RigToJsonText(const Rig& rig) {
  ValidateForWriting(rig);
  try {
    std::string text = "{\n  \"schema\": " + Json(kCalibrationSchema).dump() +
                       ",\n  \"unit\": \"m\",\n  \"gauge\": " + Json(GaugeText(rig.gauge)).dump() + ",\n" + BoardsToText(rig) +
                       "  \"cameras\": [\n";
    for (size_t i = 0; i < rig.cameras.size(); ++i) text += (i ? ",\n" : "") + CameraToText(rig.cameras[i]);
    return text + "\n  ]" + JointCovarianceToText(rig) + "\n}\n";
  } catch (const Json::exception& error) {
    throw ContractViolation(std::string("a camera name or the gauge is not UTF-8: ") + error.what());
  }
}

void WriteRig(const Rig& rig, const std::string& path) { WriteFileAtomic(path, RigToJsonText(rig)); }

}  // namespace mvstudio::geometry
