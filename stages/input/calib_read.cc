#include "stages/input/calib_read.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "core/error.h"
#include "core/some_of.h"
#include "core/units.h"
#include "dataset/exports/read/layout_read.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/panoptic_files.h"
#include "geometry/rig/lenses_only.h"
#include "geometry/rig/meeting.h"
#include "geometry/rig/plausible.h"
#include "geometry/rigid/decompositions.h"

namespace mvstudio::stages {

std::vector<std::string> CalibrationFormatChoices() {
  std::vector<std::string> choices = {"auto"};
  for (const auto format : calib::kAllCalibrationFormats) choices.emplace_back(calib::ToString(format));
  for (const auto layout : calib::kDatasetLayouts) choices.emplace_back(calib::ToString(layout));
  for (const char* other : {"qualisys", "pose2sim", "aniposelib"}) choices.emplace_back(other);
  return choices;
}

std::string ToString(const ImageSize& size) {
  return size.width_px == 0 ? "" : std::to_string(size.width_px) + "x" + std::to_string(size.height_px);
}

void FromString(const std::string& text, ImageSize* size) {
  ImageSize read;
  char end = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &read.width_px, &read.height_px, &end) != 2 || read.width_px <= 0 ||
      read.height_px <= 0) {
    throw UsageError("option 'size' " + text + ": expected WIDTHxHEIGHT in pixels, e.g. option 'size' 640x480");
  }
  *size = read;
}

namespace {

calib::ImportedRig ReadPanoptic(const std::string& path, const calib::ReadOptions& options) {
  dataset::PanopticCalibrationFile file = dataset::ReadPanopticCalibrationFile(path);
  std::vector<double> skews_px;
  for (dataset::PanopticCamera& camera : file.cameras) skews_px.push_back(std::exchange(camera.K(0, 1), 0));
  calib::ImportedRig imported{dataset::ToRig(file, path), {}};
  for (size_t i = 0; i < skews_px.size(); ++i) {
    if (skews_px[i] == 0) continue;
    calib::ReplaceSkew(skews_px[i], options, path, "cameras[" + std::to_string(i) + "].K", &imported.rig.cameras[i],
                       &imported.notes);
  }
  for (const dataset::PanopticNameConflict& conflict : dataset::PanopticNameConflicts(file.cameras)) {
    imported.notes.push_back({"CAL-NAME", "cameras[" + std::to_string(conflict.camera) + "]: " + conflict.text,
                              "leave panel and node out of the file where they number something else"});
  }
  const std::string keys = dataset::UnusedKeysOf(file, path);
  if (!keys.empty()) imported.notes.push_back(calib::UnusedKeysNote(keys));
  return imported;
}

/// The poses as the options say that the file means them.
void MendPoses(const CalibReadOptions& options, calib::CalibrationFormat format, calib::ImportedRig* imported) {
  if (options.invert) {
    const bool panoptic = format == calib::CalibrationFormat::kPanoptic;
    imported->rig = geometry::WithPosesInverted(
        imported->rig, panoptic ? dataset::OursFromPanoptic() : Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
    const geometry::AxesMeeting meeting = geometry::MeetingOfAxes(imported->rig);
    if (format == calib::CalibrationFormat::kNerfstudio && meeting.sharp() && meeting.in_front == 0) {
      imported->rig = geometry::WithAxesRotated(imported->rig);
      imported->notes.push_back({"CAL-INVERT",
                                 "inverted with OpenGL's axes (y up, looking along -z): otherwise the cameras "
                                 "look away from the place where their axes meet",
                                 ""});
    }
  }
  if (options.mirror) imported->rig = geometry::WithAxesMirrored(imported->rig);
}

/// Cameras whose file states another size than the option, which is for files without one.
void NoteStatedSizes(const ImageSize& asked, const std::string& path, calib::ImportedRig* imported) {
  if (asked.width_px == 0) return;
  std::vector<std::string> others;
  for (const geometry::RigCamera& camera : imported->rig.cameras) {
    const ImageSize size{camera.camera.width_px, camera.camera.height_px};
    if (ToString(size) != ToString(asked)) others.push_back(camera.camera.name + " " + ToString(size));
  }
  if (others.empty()) return;
  imported->notes.push_back(
      {"CAL-STATED-SIZE",
       "option 'size' " + ToString(asked) + " is not used where " + path + " states the size itself: " + SomeOf(others),
       "for images of another size, `mvstudio calib resize` makes a calibration"});
}

}  // namespace

calib::ImportedRig ReadCalibrationFiles(const std::vector<std::string>& named, const CalibReadOptions& options) {
  if (named.empty()) throw UsageError("no calibration file is named");
  std::vector<std::string> paths;
  for (const std::string& path : named) paths.push_back(calib::CalibrationIn(path));
  calib::ReadOptions read;
  read.width_px = options.size.width_px, read.height_px = options.size.height_px;
  read.metres_per_unit = MetresPer(options.unit);
  read.qca_distortion_divisor = options.qca_distortion_divisor;
  read.lens = options.lens;
  read.allow_approximation_px = options.allow_approximation_px, read.frame_rate_hz = options.frame_rate_hz;
  const auto layout = options.from ? std::nullopt : exports::DetectLayout(paths.front());
  const calib::CalibrationFormat format = options.from ? *options.from
                                          : layout     ? layout->format
                                                       : calib::DetectFormat(paths.front());
  const std::vector<std::string> files = layout && paths.size() == 1 ? std::vector<std::string>{layout->path} : paths;
  if (format == calib::CalibrationFormat::kPanoptic && paths.size() > 1) {
    throw UsageError(paths[1] + ": Panoptic's calibration is one file");
  }
  if (calib::IsDatasetLayout(format) && paths.size() > 1)
    throw UsageError(paths[1] + ": the cameras of " + std::string(ToString(format)) + " are one file or folder");
  calib::ImportedRig imported = format == calib::CalibrationFormat::kPanoptic ? ReadPanoptic(files[0], read)
                                : calib::IsDatasetLayout(format)              ? exports::ReadLayout(format, files[0], read)
                                                                              : calib::ReadCalibration(format, files, read);
  MendPoses(options, format, &imported);
  if (options.unit != calib::LengthUnit::kMetre && !calib::NamesNoUnit(format)) {
    imported.notes.push_back({"CAL-UNIT",
                              "option 'unit' " + std::string(ToString(options.unit)) + " changes nothing in " + named.front() +
                                  ": the format " + std::string(calib::ToString(format)) + " has a unit of its own",
                              "option 'out-unit' of calib convert writes other units, in formats that name none"});
  }
  NoteStatedSizes(options.size, named.front(), &imported);
  if (geometry::HasLensesOnly(imported.rig)) imported.rig.gauge = geometry::kLensesOnly;
  const bool in_centimetres = format == calib::CalibrationFormat::kPanoptic || options.unit == calib::LengthUnit::kCentimetre;
  Append(geometry::ConflictsIn(imported.rig, in_centimetres), &imported.notes);
  return imported;
}

void RequirePoses(const geometry::Rig& rig, const std::string& path) {
  if (!geometry::HasLensesOnly(rig)) return;
  throw FormatError(path, "",
                    "holds lenses only, and where the cameras stand is unknown: place them by boards (`mvstudio calibrate`) "
                    "or by people or a wand (`mvstudio calib refine`, option 'from-keypoints')");
}

void AddImplausible(const geometry::Rig& rig, InputNotes* notes) { AddNotes(geometry::ConflictsIn(rig), notes); }

void AddNotes(const std::vector<Notice>& more, InputNotes* notes) {
  for (const Notice& note : more) {
    const bool said = std::any_of(notes->warnings.begin(), notes->warnings.end(),
                                  [&](const auto& warning) { return warning.code == note.code && warning.text == note.text; });
    if (!said) notes->warnings.push_back(note);
  }
}

Eigen::Vector3d FieldOfViewDeg(const geometry::Camera& camera) {
  const geometry::Projector projector(camera);
  const double right = camera.width_px - 0.5, bottom = camera.height_px - 0.5;
  const auto angle = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const Eigen::Vector2d middle((right - 0.5) / 2, (bottom - 0.5) / 2);
    const auto from = projector.Unproject(a), to = projector.Unproject(b), centre = projector.Unproject(middle);
    if (from.status != Status::kOk || to.status != Status::kOk || centre.status != Status::kOk) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    // By way of the centre, so that more than 180 degrees count as such.
    const auto between = [](const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
      return std::atan2(u.cross(v).norm(), u.dot(v));
    };
    return RadToDeg(between(from.ray_in_cam, centre.ray_in_cam) + between(centre.ray_in_cam, to.ray_in_cam));
  };
  return {angle({-0.5, (bottom - 0.5) / 2}, {right, (bottom - 0.5) / 2}),
          angle({(right - 0.5) / 2, -0.5}, {(right - 0.5) / 2, bottom}), angle({-0.5, -0.5}, {right, bottom})};
}

CameraSigmas SigmasOf(const geometry::RigCamera& camera) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  CameraSigmas sigmas{none, none, none};
  if (camera.params_covariance) {
    sigmas.focal_px = std::sqrt(std::max((*camera.params_covariance)(0, 0), (*camera.params_covariance)(1, 1)));
  }
  if (!camera.cam_from_world_covariance) return sigmas;
  const Eigen::Matrix<double, 6, 6>& cov = *camera.cam_from_world_covariance;
  // Centre = -R^T t; under a left perturbation (w, v) it moves by R^T (w x t - v).
  const Eigen::Vector3d& t = camera.cam_from_world.translation;
  Eigen::Matrix<double, 3, 6> j;
  j << 0, t.z(), -t.y(), -1, 0, 0, -t.z(), 0, t.x(), 0, -1, 0, t.y(), -t.x(), 0, 0, 0, -1;
  const auto largest = [](const Eigen::Matrix3d& m) { return std::sqrt(std::max(0.0, geometry::SymmetricEigenvalues(m)[2])); };
  sigmas.rotation_rad = largest(cov.topLeftCorner<3, 3>());
  sigmas.position_m = largest(j * cov * j.transpose());
  return sigmas;
}

CommandResult DescribeCameras(const geometry::Rig& rig) {
  using nlohmann::ordered_json;
  CommandResult result;
  result.metrics["num_cameras"] = rig.cameras.size();
  auto& list = result.metrics["cameras"] = ordered_json::array();
  for (const geometry::RigCamera& camera : rig.cameras) {
    const geometry::Camera& c = camera.camera;
    const Eigen::Vector3d centre = camera.CenterInWorld() + Eigen::Vector3d::Zero();  // no -0
    const Eigen::Vector3d fov = FieldOfViewDeg(c);
    const CameraSigmas sigmas = SigmasOf(camera);
    ordered_json entry = {{"name", c.name},
                          {"model", std::string(geometry::ToString(c.model))},
                          {"size_px", {c.width_px, c.height_px}},
                          {"focal_px", {c.fx(), c.fy()}},
                          {"center_px", {c.cx(), c.cy()}},
                          {"center_in_world_m", {centre[0], centre[1], centre[2]}},
                          {"height_m", centre[2]}};
    entry["fov_deg"] = {FiniteOrNull(fov[0]), FiniteOrNull(fov[1]), FiniteOrNull(fov[2])};
    entry["valid_radius"] = FiniteOrNull(geometry::ValidRadius(c));
    entry["sigma_focal_px"] = FiniteOrNull(sigmas.focal_px);
    entry["sigma_rotation_deg"] = FiniteOrNull(RadToDeg(sigmas.rotation_rad));
    entry["sigma_position_mm"] = FiniteOrNull(1e3 * sigmas.position_m);
    if (camera.time_offset)
      entry["time_offset"] = {{"frames", camera.time_offset->frames},
                              {"sigma_frames", camera.time_offset->sigma_frames},
                              {"rate", camera.time_offset->rate}};
    list.push_back(entry);
  }
  return result;
}

}  // namespace mvstudio::stages
